#include "mpm/surface/boundary_mesh.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "mpm/lattice/bonds.h"
#include "mpm/surface/surface_places.h"

namespace tissue_sim {
namespace {

/// The points around a corner of cubes that hold on to one another there.
struct CornerPoints {
  int corner[3];         ///< between the sites corner - 1 and corner of each axis
  std::int32_t of[8];    ///< by place (x + 2 y + 4 z), -1 for none
  unsigned members = 0;  ///< places of those that hold on to one another, a bit each

  CornerPoints(const LatticeBody& body, const Points& points, const int (&at)[3],
               std::int32_t point)
      : corner{at[0], at[1], at[2]} {
    for (int s = 0; s < 8; ++s) {
      of[s] = body.point(at[0] - 1 + (s & 1), at[1] - 1 + (s >> 1 & 1), at[2] - 1 + (s >> 2));
      if (of[s] == point) members = 1u << s;
    }
    for (unsigned before = 0; before != members;) {
      before = members;
      for (int s = 0; s < 8; ++s) {
        if ((members >> s & 1) == 0) continue;
        for (int axis = 0; axis < 3; ++axis) {
          const int bond =
              (s >> axis & 1) == 0 ? kForwardBond + axis : opposite_bond(kForwardBond + axis);
          if ((points.bonds[of[s]] >> bond & 1) != 0) members |= 1u << (s ^ 1 << axis);
        }
      }
    }
  }
  /// Another number for all other such points.
  std::int64_t key() const {
    const int lowest = __builtin_ctz(members);
    return std::int64_t{8} * of[lowest] + lowest;
  }
};

/// The corner and one of the points that a CornerPoints::key() stands for.
CornerPoints corner_points(const LatticeTissue& tissue, std::int64_t key) {
  const auto point = static_cast<std::int32_t>(key / 8);
  const Points::Site& s = tissue.points.site[point];
  const int at[3] = {s.x + 1 - static_cast<int>(key & 1), s.y + 1 - static_cast<int>(key >> 1 & 1),
                     s.z + 1 - static_cast<int>(key >> 2 & 1)};
  return {tissue.bodies[s.body], tissue.points, at, point};
}

/// The plane of a face; places in cells from the lattice's lowest corner.
struct FacePlane {
  Vec3 place, normal;
};

Vec3 cell_middle(const Points::Site& s) { return {s.x / 2 + 0.5, s.y / 2 + 0.5, s.z / 2 + 0.5}; }

/// Of a bond that a cut or a tear broke.
FacePlane cut_plane(const LatticeBody& body, const Points& points, std::int32_t p, int bond) {
  const Points::Site& s = points.site[p];
  const BondOffset o = bond_offset(bond);
  const int axis = o.x != 0 ? 0 : o.y != 0 ? 1 : 2;
  const bool forward = bond >= kForwardBond;
  const std::int32_t lower = forward ? p : body.point(s.x + o.x, s.y + o.y, s.z + o.z);
  const Crossing* crossing = points.crossings.find(lower, axis);
  const double at = crossing == nullptr ? 0.5 : crossing->place;  // torn: between the two
  FacePlane plane{Vec3(s.x + 0.5, s.y + 0.5, s.z + 0.5) / 2, Vec3(o.x, o.y, o.z)};
  plane.place[axis] += 0.5 * (forward ? at : at - 1);
  if (crossing == nullptr) return plane;
  const bool turned = (crossing->normal[axis] > 0) != forward;
  for (int a = 0; a < 3; ++a) plane.normal[a] = turned ? -crossing->normal[a] : crossing->normal[a];
  return plane;
}

/// Sums over the faces around a vertex.
struct PlaneSums {
  Eigen::Matrix3d normals = Eigen::Matrix3d::Zero();  ///< n n^T
  Vec3 heights = Vec3::Zero();                        ///< n (n . p)
  Vec3 places = Vec3::Zero();
  int count = 0;

  void add(const FacePlane& f) {
    normals += f.normal * f.normal.transpose();
    heights += f.normal * f.normal.dot(f.place);
    places += f.place;
    ++count;
  }
  /// Where the planes meet: of all such places the nearest to the middle of theirs, not farther
  /// from the cubes' corner than a place of the surface may be from its cube.
  Vec3 meeting(const Vec3& corner) const {
    constexpr double kTowardsMiddle = 1e-2, kFarthest = 0.5;  // share; [cells]
    const Vec3 middle = places / count;
    const Eigen::Matrix3d m = normals + kTowardsMiddle * count * Eigen::Matrix3d::Identity();
    const Vec3 x = middle + m.ldlt().solve(heights - normals * middle);
    return x.cwiseMax(corner - Vec3::Constant(kFarthest))
        .cwiseMin(corner + Vec3::Constant(kFarthest));
  }
};

BoundaryMesh::Vertex make_vertex(const LatticeTissue& tissue, std::int64_t key,
                                 const PlaneSums& sums) {
  const CornerPoints around = corner_points(tissue, key);
  const Vec3 corner(around.corner[0], around.corner[1], around.corner[2]);
  const Vec3 place = sums.meeting(corner / 2);
  BoundaryMesh::Vertex v{-1, {}, {}};
  const auto distance = [&](std::int32_t p) {  // what an anchor holds comes after all that moves
    const bool moves = tissue.points.free_volume_of(p) > 0;
    return (place - cell_middle(tissue.points.site[p])).cwiseAbs().maxCoeff() + (moves ? 0 : 100);
  };
  for (int s = 0; s < 8; ++s) {
    if ((around.members >> s & 1) == 0) continue;
    if (v.point < 0 || distance(around.of[s]) < distance(v.point) - 1e-6) v.point = around.of[s];
  }
  const Points::Site& site = tissue.points.site[v.point];
  const Vec3 from_middle = place - cell_middle(site);
  for (int a = 0; a < 3; ++a) v.place[a] = static_cast<float>(from_middle[a]);
  for (int k = 0; k < 27; ++k) {
    v.node[k] = tissue.fields->node(tissue.bodies[site.body], site, k);
  }
  return v;
}

}  // namespace

void update_boundary(const LatticeTissue& tissue, BoundaryMesh& mesh) {
  const Points& points = tissue.points;
  if (mesh.bonds.size() == points.bonds.size() &&
      std::equal(points.bonds.begin(), points.bonds.end(), mesh.bonds.begin())) {
    return;
  }
  mesh.bonds = points.bonds;
  if (points.outer.empty() && mesh.outer.empty()) mesh.outer = find_outer_places(tissue);
  const std::vector<OuterPlace>& outer = points.outer.empty() ? mesh.outer : points.outer;
  mesh.faces.clear();
  std::vector<FacePlane> planes;
  std::vector<std::array<std::int64_t, 4>> keys;
  auto next_outer = outer.begin();
  for (std::int32_t p = 0; p < points.size(); ++p) {
    if (points.bonds[p] == kAllBonds) continue;
    const Points::Site& s = points.site[p];
    const LatticeBody& body = tissue.bodies[s.body];
    const unsigned whole = whole_bonds(body, points, p);
    for (int k = 0; k < kBondCount; ++k) {
      if ((points.bonds[p] >> k & 1) != 0) continue;
      const bool cut = (whole >> k & 1) != 0;
      if (cut) {
        planes.push_back(cut_plane(body, points, p, k));
      } else {
        while (next_outer->point < p || next_outer->bond < k) ++next_outer;
        const OuterPlace& o = *next_outer;
        planes.push_back({cell_middle(s) + Vec3(o.place[0], o.place[1], o.place[2]),
                          Vec3(o.normal[0], o.normal[1], o.normal[2])});
      }
      const BondOffset offset = bond_offset(k);
      const int axis = offset.x != 0 ? 0 : offset.y != 0 ? 1 : 2;
      const bool upwards = k >= kForwardBond;
      keys.emplace_back();
      for (int i = 0; i < 4; ++i) {
        int corner[3] = {s.x, s.y, s.z};
        corner[axis] += upwards ? 1 : 0;
        corner[(axis + 1) % 3] += i == 1 || i == 2 ? 1 : 0;
        corner[(axis + 2) % 3] += i >= 2 ? 1 : 0;
        keys.back()[upwards ? i : 3 - i] = CornerPoints(body, points, corner, p).key();
      }
      mesh.faces.push_back({{}, p, static_cast<std::uint8_t>(cut)});
    }
  }
  std::vector<std::int64_t> all;
  for (const auto& of_face : keys) all.insert(all.end(), of_face.begin(), of_face.end());
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  std::vector<PlaneSums> sums(all.size());
  for (std::size_t f = 0; f < keys.size(); ++f) {
    for (int i = 0; i < 4; ++i) {
      const auto v = std::lower_bound(all.begin(), all.end(), keys[f][i]) - all.begin();
      mesh.faces[f].vertex[i] = static_cast<std::int32_t>(v);
      sums[v].add(planes[f]);
    }
  }
  mesh.vertices.clear();
  for (std::size_t i = 0; i < all.size(); ++i) {
    mesh.vertices.push_back(make_vertex(tissue, all[i], sums[i]));
  }
  // Along the shorter diagonal; places are apart as those in the lattice are.
  const auto at = [&](std::int32_t v) -> Vec3 {
    const BoundaryMesh::Vertex& vertex = mesh.vertices[v];
    return cell_middle(points.site[vertex.point]) +
           Vec3(vertex.place[0], vertex.place[1], vertex.place[2]);
  };
  for (BoundaryMesh::Face& f : mesh.faces) {
    const double even = (at(f.vertex[0]) - at(f.vertex[2])).norm();
    const double odd = (at(f.vertex[1]) - at(f.vertex[3])).norm();
    if (odd < even) std::rotate(f.vertex, f.vertex + 1, f.vertex + 4);
  }
}

}  // namespace tissue_sim
