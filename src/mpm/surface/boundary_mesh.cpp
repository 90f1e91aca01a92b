#include "mpm/surface/boundary_mesh.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/contour.h"
#include "mpm/lattice/bonds.h"
#include "mpm/surface/surface_places.h"

namespace tissue_sim {
namespace {

Vec3 cell_middle(const Points::Site& s) {
  const int x = s.x / 2, y = s.y / 2, z = s.z / 2;
  return {x + 0.5, y + 0.5, z + 0.5};
}

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

/// Thickness of the skin, as a share of a point's cube: the lightest that does not swing faster
/// than fluid before it does.
constexpr float kPushedSkin = 0.25f;
/// Tissue that an even pressure meets behind a vertex, in cells, below which the vertex is weak: a
/// whole face has half a cell. Fluid swings with 0.15 of its spacing, a cell at most, as fast as
/// its substeps bear.
constexpr float kBehind = 0.25f;

constexpr int kGrain = 256;

/// Calls f(i, k, node) for the nodes of vertices that take part.
template <class F>
void for_each_share(const BoundaryMesh& mesh, const std::vector<float>& share, const F& f) {
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    for (int k = 0; k < 27; ++k) {
      if (share[27 * i + k] != 0) f(static_cast<std::int32_t>(i), k, mesh.vertices[i].node[k]);
    }
  }
}

/// Replaces the shares of a vertex, of which each node takes but `taken`, by those nearest to them
/// that have their sum and their middle.
void keep_moment(const float* taken, float* share) {
  double sum = 0, got[27];
  Vec3 middle = Vec3::Zero(), now = Vec3::Zero(), at[27];
  for (int k = 0; k < 27; ++k) {
    const int x = k % 3, y = k / 3 % 3, z = k / 9;
    at[k] = Vec3(x, y, z);
    got[k] = static_cast<double>(taken[k]) * share[k];
    sum += got[k];
    middle += share[k] * at[k];
    now += got[k] * at[k];
  }
  if (!(sum > 0)) return;
  now /= sum;
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (int k = 0; k < 27; ++k) {
    at[k] -= now;
    spread += got[k] / sum * at[k] * at[k].transpose();
  }
  // Along an axis on which nothing but one layer of nodes has mass no moment can be kept.
  constexpr double kLeastSpread = 0.02, kMost = 3;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
  axes.computeDirect(spread);
  Vec3 slope = Vec3::Zero();
  for (int a = 0; a < 3; ++a) {
    if (!(axes.eigenvalues()[a] > kLeastSpread)) continue;
    const Vec3 axis = axes.eigenvectors().col(a);
    slope += axis.dot(middle - now) / axes.eigenvalues()[a] * axis;
  }
  double largest = 0;
  for (int k = 0; k < 27; ++k) {
    if (got[k] != 0) largest = std::max(largest, std::fabs(slope.dot(at[k])));
  }
  if (largest > kMost) slope *= kMost / largest;
  for (int k = 0; k < 27; ++k) {
    share[k] = static_cast<float>(got[k] / sum * (1 + slope.dot(at[k])));
  }
}

/// What each vertex stands for at rest [m^2].
std::vector<float> areas_of(const BoundaryMesh& mesh) {
  std::vector<float> area(mesh.vertices.size(), 0.0f);
  for (const BoundaryMesh::Face& face : mesh.faces) {
    for (const int second : {1, 2}) {
      const std::int32_t of[3] = {face.vertex[0], face.vertex[second], face.vertex[second + 1]};
      const Vec3& x = mesh.vertices[of[0]].rest;
      const Vec3 twice = (mesh.vertices[of[1]].rest - x).cross(mesh.vertices[of[2]].rest - x);
      for (const std::int32_t v : of) area[v] += static_cast<float>(twice.norm() / 6);
    }
  }
  return area;
}

/// Finds the vertices that an even pressure would drive off, and who takes it in their place.
void find_weak(const LatticeTissue& tissue, BoundaryMesh& mesh) {
  BoundaryMesh::Support& of = mesh.support;
  const Nodes& nodes = tissue.nodes;
  const std::vector<float> area = areas_of(mesh);
  std::vector<float> by_mass(nodes.size(), 0.0f);  // area that pushes a node, by its mass
  tissue.cpu->for_each(
      static_cast<int>(of.node.size()),
      [&](int n) {
        float sum = 0;
        for (std::int32_t e = of.begin[n]; e < of.begin[n + 1]; ++e) {
          sum += std::fabs(of.share[e]) * area[of.vertex[e]];
        }
        by_mass[of.node[n]] = nodes.inv_mass[of.node[n]] * sum;
      },
      kGrain);
  const auto vertices = static_cast<int>(mesh.vertices.size());
  std::vector<float> takes(vertices, 1.0f);  // more than 1: so many times what is asked
  tissue.cpu->for_each(
      vertices,
      [&](int i) {
        const BoundaryMesh::Vertex& v = mesh.vertices[i];
        const AxisWeights weights(v.place);
        float sum = 0;
        for (int k = 0; k < 27; ++k) sum += std::fabs(weights.at(k)) * by_mass[v.node[k]];
        const LatticeBody& body = tissue.bodies[tissue.points.site[v.point].body];
        const double density = body.material_of(tissue.points, v.point).density;
        if (sum > 0) takes[i] = static_cast<float>(1 / (kBehind * density * body.cell_size * sum));
      },
      kGrain);
  of.weak.clear();
  of.around.clear();
  of.weak_of.assign(vertices, -1);
  for (int i = 0; i < vertices; ++i) {
    if (!(takes[i] < 1)) continue;
    of.weak_of[i] = static_cast<std::int32_t>(of.weak.size());
    of.weak.push_back({i, takes[i], 0, 0});
  }
  std::vector<std::vector<std::int32_t>> around(of.weak.size());
  for (const BoundaryMesh::Face& face : mesh.faces) {
    for (int k = 0; k < 4; ++k) {
      const std::int32_t weak = of.weak_of[face.vertex[k]];
      for (const int step : {1, 3}) {
        if (weak >= 0) around[weak].push_back(face.vertex[(k + step) % 4]);
      }
    }
  }
  for (std::size_t w = 0; w < of.weak.size(); ++w) {
    float sum = 0;
    for (const std::int32_t v : around[w]) sum += std::min(1.0f, takes[v]);
    of.weak[w].begin = static_cast<std::int32_t>(of.around.size());
    for (const std::int32_t v : around[w]) {
      if (sum > 0) of.around.push_back({v, std::min(1.0f, takes[v]) / sum});
    }
    of.weak[w].end = static_cast<std::int32_t>(of.around.size());
    if (!(sum > 0)) of.weak[w].takes = 1;
  }
}

}  // namespace

void pass_on(const BoundaryMesh::Support& of, std::vector<std::array<float, 3>>& push) {
  constexpr int kRounds = 6;
  std::vector<std::array<float, 3>> left(of.weak.size()), next(of.weak.size());
  for (std::size_t w = 0; w < of.weak.size(); ++w) std::swap(left[w], push[of.weak[w].vertex]);
  for (int round = 0; round < kRounds; ++round) {
    std::fill(next.begin(), next.end(), std::array<float, 3>{});
    for (std::size_t w = 0; w < of.weak.size(); ++w) {
      const BoundaryMesh::Support::Weak& weak = of.weak[w];
      const std::array<float, 3>& all = left[w];
      if (all[0] == 0 && all[1] == 0 && all[2] == 0) continue;
      for (int a = 0; a < 3; ++a) push[weak.vertex][a] += weak.takes * all[a];
      for (std::int32_t e = weak.begin; e < weak.end; ++e) {
        const std::int32_t v = of.around[e].vertex, other = of.weak_of[v];
        std::array<float, 3>& to = other < 0 ? push[v] : next[other];
        for (int a = 0; a < 3; ++a) to[a] += (1 - weak.takes) * of.around[e].share * all[a];
      }
    }
    left.swap(next);
  }
  for (std::size_t w = 0; w < of.weak.size(); ++w) {
    for (int a = 0; a < 3; ++a) push[of.weak[w].vertex][a] += left[w][a];
  }
}

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

void find_support(const LatticeTissue& tissue, BoundaryMesh& mesh) {
  BoundaryMesh::Support& of = mesh.support;
  if (of.made == mesh.made) return;
  of.made = mesh.made;
  const Points& points = tissue.points;
  const Nodes& nodes = tissue.nodes;
  const auto vertices = static_cast<int>(mesh.vertices.size());
  std::vector<float> share(std::size_t{27} * vertices, 0.0f), skin(vertices, 0.0f);
  tissue.cpu->for_each(
      vertices,
      [&](int i) {
        const BoundaryMesh::Vertex& v = mesh.vertices[i];
        if (!(points.free_volume_of(v.point) > 0)) return;
        const AxisWeights weights(v.place);
        float of_moving = 0;  // the rest has no mass that could take a part
        for (int k = 0; k < 27; ++k) of_moving += nodes.inv_mass[v.node[k]] > 0 ? weights.at(k) : 0;
        if (!(of_moving > 0)) return;
        for (int k = 0; k < 27; ++k) {
          if (!(nodes.inv_mass[v.node[k]] > 0)) continue;
          share[std::size_t{27} * i + k] = weights.at(k) / of_moving;
        }
        const LatticeBody& body = tissue.bodies[points.site[v.point].body];
        skin[i] = static_cast<float>(kPushedSkin * body.material_of(points, v.point).density *
                                     std::pow(body.cell_size / 2, 3));
      },
      kGrain);

  std::vector<std::int32_t> at(nodes.size() + 1, 0);
  for_each_share(mesh, share, [&](std::int32_t, int, std::int32_t node) { ++at[node]; });
  of.node.clear();
  of.begin.assign(1, 0);
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    const std::int32_t count = at[n];
    at[n] = of.begin.back();
    if (count == 0) continue;
    of.node.push_back(static_cast<std::int32_t>(n));
    of.begin.push_back(of.begin.back() + count);
  }
  std::vector<std::size_t> entry(of.begin.back());
  of.vertex.resize(entry.size());
  of.share.resize(entry.size());
  for_each_share(mesh, share, [&](std::int32_t i, int k, std::int32_t node) {
    of.vertex[at[node]] = i;
    entry[at[node]++] = std::size_t{27} * i + k;
  });
  std::vector<float> takes(nodes.size(), 0.0f);  // of its share, each node
  const auto count = static_cast<int>(of.node.size());
  tissue.cpu->for_each(
      count,
      [&](int n) {
        float mass = 0;
        for (std::int32_t e = of.begin[n]; e < of.begin[n + 1]; ++e) {
          mass += std::fabs(share[entry[e]]) * skin[of.vertex[e]];
        }
        takes[of.node[n]] = std::min(1.0f, nodes.mass[of.node[n]] / mass);
      },
      kGrain);
  tissue.cpu->for_each(
      vertices,
      [&](int i) {
        float taken[27], least = 1, *of_vertex = &share[std::size_t{27} * i];
        for (int k = 0; k < 27; ++k) {
          taken[k] = takes[mesh.vertices[i].node[k]];
          if (of_vertex[k] != 0) least = std::min(least, taken[k]);
        }
        if (least < 1) keep_moment(taken, of_vertex);
      },
      kGrain);
  tissue.cpu->for_each(
      count,
      [&](int n) {
        for (std::int32_t e = of.begin[n]; e < of.begin[n + 1]; ++e) of.share[e] = share[entry[e]];
      },
      kGrain);
  find_weak(tissue, mesh);

  of.corner_begin.assign(vertices + 1, 0);
  for (const BoundaryMesh::Face& face : mesh.faces) {
    for (const int k : {0, 1, 2, 0, 2, 3}) ++of.corner_begin[face.vertex[k] + 1];
  }
  for (int i = 0; i < vertices; ++i) of.corner_begin[i + 1] += of.corner_begin[i];
  of.corner.resize(of.corner_begin.back());
  at.assign(of.corner_begin.begin(), of.corner_begin.end() - 1);
  std::int32_t corner = 0;
  for (const BoundaryMesh::Face& face : mesh.faces) {
    for (const int k : {0, 1, 2, 0, 2, 3}) of.corner[at[face.vertex[k]]++] = corner++;
  }
}

}  // namespace tissue_sim
