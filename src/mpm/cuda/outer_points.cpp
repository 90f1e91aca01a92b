#include "mpm/cuda/outer_points.h"

#include <algorithm>

#include "contact/surface_spring.h"
#include "mpm/surface/surface_places.h"

namespace tissue_sim {
namespace {

constexpr int kSweeps = 3;         // over the surfaces at a point
constexpr double kFarthest = 0.5;  // from a point to its place along an axis [cells]

using Cell = std::array<int, 4>;  // body, x, y, z

/// Cells that have nodes which faces hold.
std::set<Cell> cells_beside(const AnchorFaces& faces, const LatticeTissue& tissue) {
  std::set<std::int32_t> held;
  for (const FaceRow& row : faces.rows) {
    for (int k = 0; k < kRowNodes; ++k) {
      if (row.weight[k] != 0) held.insert(row.node[k]);
    }
  }
  std::set<Cell> cells;
  if (held.empty()) return cells;
  for (std::size_t b = 0; b < tissue.bodies.size(); ++b) {
    tissue.bodies[b].for_each_node([&](int node, int x, int y, int z) {
      if (held.count(node) == 0) return;
      for (int k = 0; k < 27; ++k) {
        cells.insert({static_cast<int>(b), x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1});
      }
    });
  }
  return cells;
}

using Places = const OuterPlace*;  // of a point

Vec3 vector_of(const float (&x)[3]) { return Vec3(x[0], x[1], x[2]); }

/// The point's own place brought onto the surface at each of these.
Vec3 place_amid(Places first, Places last, const Points::Site& s) {
  const Vec3 from(s.x & 1 ? 0.25 : -0.25, s.y & 1 ? 0.25 : -0.25, s.z & 1 ? 0.25 : -0.25);
  Vec3 x = from;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (Places o = first; o != last; ++o) {
      const Vec3 normal = vector_of(o->normal);
      x += normal.dot(vector_of(o->place) - x) * normal;
    }
  }
  return x.cwiseMax(from - Vec3::Constant(kFarthest)).cwiseMin(from + Vec3::Constant(kFarthest));
}

/// Whether any two look away from one another.
bool face_away(Places first, Places last) {
  constexpr double kAway = -0.5;  // cosine
  for (Places one = first; one != last; ++one) {
    for (Places o = one + 1; o != last; ++o) {
      if (vector_of(one->normal).dot(vector_of(o->normal)) < kAway) return true;
    }
  }
  return false;
}

float area_amid(Places first, Places last, double edge) {
  float most = 0;
  for (Places one = first; one != last; ++one) {
    double area = 0;
    for (Places o = first; o != last; ++o) {
      area += place_area(o->normal, o->bond, static_cast<float>(edge)) *
              std::max(0.0, vector_of(o->normal).dot(vector_of(one->normal)));
    }
    most = std::max(most, static_cast<float>(area));
  }
  return most;
}

float4 plane_amid(Places first, Places last) {
  constexpr double kOneWay = 0.8;  // length of the mean of normals that look one way
  const Vec3 one = vector_of(first->normal);
  Vec3 sum = Vec3::Zero();
  for (Places o = first; o != last; ++o) {  // of a sheet's two sides either will do
    const Vec3 normal = vector_of(o->normal);
    sum += normal.dot(one) < 0 ? -normal : normal;
  }
  const Vec3 normal = sum / static_cast<double>(last - first);
  if (normal.norm() <= kOneWay) return {0, 0, 0, -1};
  int axis = 0;
  normal.cwiseAbs().maxCoeff(&axis);
  const Vec3 of_axis = normal / normal[axis];
  return {static_cast<float>(of_axis[0]), static_cast<float>(of_axis[1]),
          static_cast<float>(of_axis[2]), static_cast<float>(axis)};
}

}  // namespace

bool has_thin_tools(const Scene& scene) {
  return std::any_of(scene.tools.begin(), scene.tools.end(), [&](const Tool& tool) {
    return tool.type != ToolType::kGrasper && tool.type != ToolType::kScalpel &&
           stiffer_across(static_cast<float>(tool.radius), static_cast<float>(scene.cell_size)) > 1;
  });
}

std::vector<std::int32_t> across_sheet(const LatticeTissue& tissue, std::int32_t point) {
  const Array<std::uint8_t>& bonds = tissue.points.bonds;
  const Points::Site& s = tissue.points.site[point];
  std::vector<std::int32_t> across;
  for (int k = 0; k < kBondCount; ++k) {
    const int behind = opposite_bond(k);
    if ((bonds[point] >> k & 1) != 0 || (bonds[point] >> behind & 1) == 0) continue;
    const BondOffset to = bond_offset(behind);
    const std::int32_t other = tissue.bodies[s.body].point(s.x + to.x, s.y + to.y, s.z + to.z);
    if ((bonds[other] >> behind & 1) == 0) across.push_back(other);
  }
  return across;
}

OuterPoints::OuterPoints(const LatticeTissue& tissue, const AnchorFaces& faces)
    : whole_(find_outer_places(tissue)), beside_anchors_(cells_beside(faces, tissue)) {}

CudaOuterPlace OuterPoints::of(const LatticeTissue& tissue, std::int32_t p) const {
  const Points::Site& s = tissue.points.site[p];
  const LatticeBody& body = tissue.bodies[s.body];
  CudaOuterPlace at;
  OuterPlace places[kBondCount];
  const Places first = places;
  const Places last = first + places_of_point(body, tissue.points, whole_, p, places);
  if (first == last) return at;
  const bool was_cut = tissue.points.bonds[p] != whole_bonds(body, tissue.points, p);
  // Springs as stiff as a surface give energy to slices that a cut left so thin.
  if (was_cut && (face_away(first, last) || !across_sheet(tissue, p).empty())) return at;
  const bool is_soft = beside_anchors_.count({s.body, s.x / 2, s.y / 2, s.z / 2}) > 0;
  const Vec3 x = place_amid(first, last, s);
  at.place = {static_cast<float>(x[0]), static_cast<float>(x[1]), static_cast<float>(x[2]),
              is_soft ? kSoftPlace : kStiffPlace};
  at.plane = plane_amid(first, last);
  at.area = area_amid(first, last, body.cell_size / 2);
  return at;
}

}  // namespace tissue_sim
