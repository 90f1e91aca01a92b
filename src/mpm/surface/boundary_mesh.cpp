#include "mpm/surface/boundary_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/contour.h"
#include "mpm/lattice/bonds.h"
#include "mpm/surface/surface_places.h"

namespace tissue_sim {
namespace {

Vec3 cell_middle(const Points::Site& s) { return {s.x / 2 + 0.5, s.y / 2 + 0.5, s.z / 2 + 0.5}; }

/// Of a bond that a cut or a tear broke, in cubes of points.
Contour::Plane cut_plane(const LatticeBody& body, const Points& points, std::int32_t p, int bond) {
  const Points::Site& s = points.site[p];
  const BondOffset o = bond_offset(bond);
  const int axis = o.x != 0 ? 0 : o.y != 0 ? 1 : 2;
  const bool forward = bond >= kForwardBond;
  const std::int32_t lower = forward ? p : body.point(s.x + o.x, s.y + o.y, s.z + o.z);
  const Crossing* crossing = points.crossings.find(lower, axis);
  const double at = crossing == nullptr ? 0.5 : crossing->place;  // torn: between the two
  Contour::Plane plane{Vec3(s.x + 0.5, s.y + 0.5, s.z + 0.5), Vec3(o.x, o.y, o.z)};
  plane.place[axis] += forward ? at : at - 1;
  if (crossing == nullptr) return plane;
  const bool turned = (crossing->normal[axis] > 0) != forward;
  for (int a = 0; a < 3; ++a) plane.normal[a] = turned ? -crossing->normal[a] : crossing->normal[a];
  return plane;
}

/// What make_contour() asks.
class PointCubes {
 public:
  PointCubes(const LatticeTissue& tissue, const std::vector<OuterPlace>& outer)
      : tissue_(tissue), points_(tissue.points), next_outer_(outer.begin()) {}
  std::int32_t size() const { return points_.size(); }
  std::array<int, 3> at(std::int32_t p) const {
    const Points::Site& s = points_.site[p];
    return {s.x, s.y, s.z};
  }
  std::int32_t find(std::int32_t p, int x, int y, int z) const {
    return tissue_.bodies[points_.site[p].body].point(x, y, z);
  }
  unsigned held(std::int32_t p) const { return points_.bonds[p]; }
  bool was_held(std::int32_t p, int bond) const {
    return (whole_bonds(tissue_.bodies[points_.site[p].body], points_, p) >> bond & 1) != 0;
  }
  Contour::Plane plane(std::int32_t p, int bond) {
    const Points::Site& s = points_.site[p];
    if (was_held(p, bond)) return cut_plane(tissue_.bodies[s.body], points_, p, bond);
    while (next_outer_->point < p || next_outer_->bond < bond) ++next_outer_;
    const OuterPlace& o = *next_outer_;
    return {2 * (cell_middle(s) + Vec3(o.place[0], o.place[1], o.place[2])),
            Vec3(o.normal[0], o.normal[1], o.normal[2])};
  }

 private:
  const LatticeTissue& tissue_;
  const Points& points_;
  std::vector<OuterPlace>::const_iterator next_outer_;
};

BoundaryMesh::Vertex make_vertex(const LatticeTissue& tissue, const Contour::Vertex& of) {
  const Vec3 place = of.place / 2;  // in cells
  BoundaryMesh::Vertex v{-1, {}, {}, {}};
  const auto distance = [&](std::int32_t p) {  // what an anchor holds comes after all that moves
    const bool moves = tissue.points.free_volume_of(p) > 0;
    return (place - cell_middle(tissue.points.site[p])).cwiseAbs().maxCoeff() + (moves ? 0 : 100);
  };
  for (int k = 0; k < 8 && of.cube[k] >= 0; ++k) {
    if (v.point < 0 || distance(of.cube[k]) < distance(v.point) - 1e-6) v.point = of.cube[k];
  }
  const Points::Site& site = tissue.points.site[v.point];
  const Vec3 from_middle = place - cell_middle(site);
  const LatticeBody& b = tissue.bodies[site.body];
  for (int a = 0; a < 3; ++a) v.place[a] = static_cast<float>(from_middle[a]);
  v.rest = b.node_position(site.x / 2, site.y / 2, site.z / 2) +
           b.cell_size * Vec3(v.place[0], v.place[1], v.place[2]);
  for (int k = 0; k < 27; ++k) {
    v.node[k] = tissue.fields->node(b, site, k);
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
  ++mesh.made;
  mesh.shown = 0;
  if (points.outer.empty() && mesh.outer.empty()) mesh.outer = find_outer_places(tissue);
  const std::vector<OuterPlace>& outer = points.outer.empty() ? mesh.outer : points.outer;
  PointCubes cubes(tissue, outer);
  const Contour contour = make_contour(cubes);
  mesh.faces.clear();
  for (const Contour::Face& f : contour.faces) {
    BoundaryMesh::Face face{{}, f.cube, static_cast<std::uint8_t>(cubes.was_held(f.cube, f.side))};
    std::copy_n(f.vertex, 4, face.vertex);
    mesh.faces.push_back(face);
  }
  mesh.vertices.clear();
  for (const Contour::Vertex& v : contour.vertices) {
    mesh.vertices.push_back(make_vertex(tissue, v));
  }
}

}  // namespace tissue_sim
