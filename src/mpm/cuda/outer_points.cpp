#include <algorithm>

#include "contact/surface_spring.h"
#include "mpm/cuda/on_device.h"
#include "mpm/cuda/parts_on_device.h"
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
    return !has_jaws(tool.type) && tool.type != ToolType::kScalpel &&
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

// Which tissue on a GPU instruments and the ground may meet in a part of a frame.

namespace {

constexpr double kSurfaceReach = 0.5;  // from the points of a cell to its surface, at most [cells]

/// Whether any of these may be within its margin of what a collider sweeps.
template <class Margin>
bool may_meet(const CudaTissue& d, const std::vector<BlockMotion>& motion, const Margin& margin) {
  const auto meets = [](const BlockMotion& m, double far, const CudaBox& reach) {
    bool meets = true;
    for (int a = 0; a < 3; ++a) {
      meets = meets && m.box.min[a] - far <= reach.max[a] && reach.min[a] <= m.box.max[a] + far;
    }
    return meets;
  };
  return std::any_of(motion.begin(), motion.end(), [&](const BlockMotion& m) {
    const double far = margin(m);
    return std::any_of(d.host_reach.data(), d.host_reach.data() + d.host_reach.size(),
                       [&](const CudaBox& reach) { return meets(m, far, reach); });
  });
}

CudaReach reach(const CudaTissue& d) {
  CudaReach reach{d.reach.data(),
                  static_cast<int>(d.host_reach.size()),
                  0,
                  static_cast<float>(d.run.frame->duration),
                  static_cast<float>((0.5 + kSurfaceReach) * d.state.scene.cell_size),
                  d.went.empty() ? nullptr : d.u_went.data()};
  for (int c = 0; c < reach.collider_count; ++c) {
    if (d.host_colliders[c].kind == Collider::kBlade) reach.blades |= 1u << c;
  }
  return reach;
}

}  // namespace

void find_near(CudaTissue& d) {
  // A little more than the GPU finds, for what it finds must be done.
  const double cell = (1 + kSurfaceReach) * d.state.scene.cell_size;
  d.may_meet =
      may_meet(d, d.state.motion,
               [&](const BlockMotion& m) { return m.speed * d.run.frame->duration + cell; }) ||
      may_meet(d, d.went, [&](const BlockMotion&) { return cell; });
  if (!d.may_meet) {
    d.with.clear(d.stream);
    return;
  }
  const std::size_t cells = d.of_blocks.partial.size();
  d.near_cells.resize(cells);
  d.near_listed.resize(cells);
  d.near_count.resize(1);
  launch_near(d.tables(), d.present(), d.measures.data(), reach(d),
              {d.near_cells.data(), d.near_count.data(), d.near_listed.data(), cells,
               d.marks.data(), d.marks.size(), d.pushed_parts.data(), d.pushed_parts.size()},
              d.stream);
}

void look_for_missed(CudaTissue& d) {
  if (!d.may_meet) return;
  d.any_missed.resize(1);
  d.host_missed.resize(1);
  launch_missed(d.tables(), d.present(), d.measures.data(), reach(d), d.near_listed.data(),
                d.any_missed.data(), d.stream);
  d.any_missed.download(d.host_missed.data(), 1, d.stream);
}

bool missed_contact(const CudaTissue& d) {
  if (d.may_meet) return d.host_missed[0] != 0;
  const double reach = kSurfaceReach * d.state.scene.cell_size;
  return may_meet(d, d.state.motion, [reach](const BlockMotion&) { return reach; });
}

}  // namespace tissue_sim
