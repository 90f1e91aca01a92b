#include "mls/surface.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <tuple>

#include "frame/put_faces.h"
#include "geometry/contour.h"
#include "geometry/lattice.h"
#include "geometry/nearest.h"
#include "geometry/nearest_surface.h"

namespace tissue_sim {
namespace {

using Cube = MlsSurface::Cube;

std::int32_t find_cube(const MlsSurface& surface, const MlsSurface::Lattice& body, int x, int y,
                       int z) {
  const auto before = [](const Cube& c, const std::tuple<int, int, int>& at) {
    return std::make_tuple(c.z, c.y, c.x) < at;
  };
  const auto end = surface.cubes.begin() + body.end;
  const auto found =
      std::lower_bound(surface.cubes.begin() + body.begin, end, std::make_tuple(z, y, x), before);
  if (found == end || found->x != x || found->y != y || found->z != z) return -1;
  return static_cast<std::int32_t>(found - surface.cubes.begin());
}

std::int32_t neighbour(const MlsSurface& surface, std::int32_t cube, int k) {
  const Cube& c = surface.cubes[cube];
  const CubeSide side(k);
  int at[3] = {c.x, c.y, c.z};
  at[side.axis] += side.sign;
  return find_cube(surface, surface.bodies[surface.body[cube]], at[0], at[1], at[2]);
}

/// The nearest node of the body that no gap parts from a place.
std::int32_t owner(const NearestPoints& tree, const NearGaps& gaps, const std::vector<Vec3>& places,
                   const Vec3& x, std::vector<Neighbour>& found) {
  constexpr int kAsked = 8;
  tree.nearest(x, gaps.empty() ? 1 : kAsked, found);
  for (const Neighbour& n : found) {
    if (gaps.joined(x, places[n.index])) return n.index;
  }
  return found[0].index;
}

void add_body(const MlsState& s, std::int16_t number, std::int32_t first, std::int32_t last,
              MlsSurface& surface) {
  const Body& body = s.scene.bodies[number];
  const double edge = mls_spacing(s.scene);
  const Lattice lattice = make_lattice(body, 2 * edge, nullptr);
  const std::vector<Vec3> places(s.nodes.place.begin() + first, s.nodes.place.begin() + last);
  const NearestPoints tree(places);
  std::vector<Neighbour> found;
  const auto begin = static_cast<std::int32_t>(surface.cubes.size());
  for (const Lattice::Site& site : lattice.sites) {
    const Vec3 middle = lattice.origin + edge * Vec3(site.x + 0.5, site.y + 0.5, site.z + 0.5);
    surface.cubes.push_back({site.x, site.y, site.z,
                             first + owner(tree, s.nodes.gaps[number], places, middle, found), 0});
    surface.body.push_back(number);
  }
  const auto end = static_cast<std::int32_t>(surface.cubes.size());
  surface.bodies.push_back({lattice.origin, edge, begin, end});
  const NearestSurface nearest(body, 2 * edge);
  for (std::int32_t c = begin; c < end; ++c) {
    for (int k = 0; k < kCubeSides; ++k) {
      if (neighbour(surface, c, k) >= 0) surface.cubes[c].whole |= 1u << k;
    }
  }
  for (const Lattice::Gap& gap : lattice.gaps) {
    const std::int32_t lower = begin + gap.site, upper = neighbour(surface, lower, 3 + gap.axis);
    surface.cubes[lower].whole &= ~(1u << (3 + gap.axis));
    if (upper >= 0) surface.cubes[upper].whole &= ~(1u << (2 - gap.axis));
  }
  for (std::int32_t c = begin; c < end; ++c) {
    const Cube& cube = surface.cubes[c];
    for (int k = 0; k < kCubeSides; ++k) {
      if ((cube.whole >> k & 1) != 0) continue;
      const CubeSide side(k);
      Vec3 at(cube.x + 0.5, cube.y + 0.5, cube.z + 0.5), out = Vec3::Zero();
      out[side.axis] = side.sign;
      at += 0.5 * out;
      SurfacePoint on;
      const Vec3 place = lattice.origin + edge * at;
      if (!nearest.find(place, out, on) || (on.place - place).norm() > edge) on = {place, out};
      surface.outer.push_back({c, k, (on.place - lattice.origin) / edge, on.normal});
    }
  }
}

/// Which way the cut between two nodes looks, to either side: of the plane through all places where
/// it passes pairs of theirs. 0 where these lie in none.
Vec3 cut_normal(const MlsState& s, std::int32_t i, std::int32_t j) {
  constexpr double kSpread = 0.02, kFlat = 0.1;  // of variances: second to first, third to second
  Vec3 sum = Vec3::Zero();
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  int count = 0;
  for (const std::int32_t node : {i, j}) {
    for (std::int32_t e = s.pairs.begin[node]; e < s.pairs.begin[node + 1]; ++e) {
      if (s.pairs.crossed[e] == 0) continue;
      const Vec3 way = s.nodes.place[s.pairs.other[e]] - s.nodes.place[node];
      const Vec3 at =
          s.nodes.place[node] - s.nodes.place[i] + crossing_place(s.pairs.crossed[e]) * way;
      sum += at;
      squares += at * at.transpose();
      ++count;
    }
  }
  if (count < 3) return Vec3::Zero();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
  eigen.computeDirect(squares / count - sum * sum.transpose() / (count * count));
  const Vec3& variance = eigen.eigenvalues();
  const bool plane = variance[1] > kSpread * variance[2] && variance[0] < kFlat * variance[1];
  return plane ? Vec3(eigen.eigenvectors().col(0)) : Vec3(Vec3::Zero());
}

/// What make_contour() asks.
class Cubes {
 public:
  Cubes(const MlsState& state, const std::vector<std::int32_t>& piece, const MlsSurface& surface)
      : s_(state), surface_(surface), next_(surface.outer.begin()), held_(surface.cubes.size(), 0) {
    for (std::int32_t c = 0; c < size(); ++c) {
      for (int k = 0; k < kCubeSides; ++k) {
        if ((surface.cubes[c].whole >> k & 1) == 0) continue;
        const std::int32_t i = surface.cubes[c].node;
        const std::int32_t j = surface.cubes[neighbour(surface, c, k)].node;
        const std::int32_t e = i == j ? -1 : s_.pairs.find(i, j);
        const bool held = e < 0 ? piece[i] == piece[j] : s_.pairs.crossed[e] == 0;
        held_[c] |= held ? 1u << k : 0;
      }
    }
  }
  std::int32_t size() const { return static_cast<std::int32_t>(surface_.cubes.size()); }
  std::array<int, 3> at(std::int32_t c) const {
    const Cube& cube = surface_.cubes[c];
    return {cube.x, cube.y, cube.z};
  }
  std::int32_t find(std::int32_t c, int x, int y, int z) const {
    return find_cube(surface_, surface_.bodies[surface_.body[c]], x, y, z);
  }
  unsigned held(std::int32_t c) const { return held_[c]; }
  Contour::Plane plane(std::int32_t c, int k) {
    const Cube& cube = surface_.cubes[c];
    if ((cube.whole >> k & 1) == 0) {
      while (next_->cube != c || next_->side != k) ++next_;
      return {next_->place, next_->normal};
    }
    const CubeSide side(k);
    const MlsSurface::Lattice& body = surface_.bodies[surface_.body[c]];
    const std::int32_t i = cube.node, j = surface_.cubes[neighbour(surface_, c, k)].node;
    const std::int32_t e = i == j ? -1 : s_.pairs.find(i, j);
    const double share =
        e < 0 || s_.pairs.crossed[e] == 0 ? 0.5 : crossing_place(s_.pairs.crossed[e]);
    const Vec3 &a = s_.nodes.place[i], &b = s_.nodes.place[j];
    const Vec3 place = a + share * (b - a);
    Vec3 normal = cut_normal(s_, i, j);
    if (normal.isZero()) normal[side.axis] = side.sign;
    return {(place - body.origin) / body.edge, normal};
  }

 private:
  const MlsState& s_;
  const MlsSurface& surface_;
  std::vector<MlsSurface::Plane>::const_iterator next_;
  std::vector<std::uint8_t> held_;
};

MlsSurface::Vertex vertex_of(const MlsState& s, const MlsSurface& surface,
                             const Contour::Vertex& v) {
  const MlsSurface::Lattice& body = surface.bodies[surface.body[v.cube[0]]];
  MlsSurface::Vertex made{body.origin + body.edge * v.place, {}, {}};
  constexpr double kLeast = 1e-3;  // weight of a node that reaches no more
  double sum = 0, weight[8] = {};
  int n = 0;
  for (int k = 0; k < 8 && v.cube[k] >= 0; ++k) {
    const std::int32_t i = surface.cubes[v.cube[k]].node;
    if (std::find(made.node, made.node + n, i) != made.node + n) continue;
    const double reach = s.pairs.support[i];
    const double r2 = (made.rest - s.nodes.place[i]).squaredNorm() / (reach * reach);
    weight[n] = std::max(kLeast, r2 < 1 ? std::pow(1 - r2, 3) : 0.0);
    sum += weight[n];
    made.node[n++] = i;
  }
  for (int k = 0; k < n; ++k) made.weight[k] = static_cast<float>(weight[k] / sum);
  return made;
}

void update(const MlsState& s, const std::vector<std::int32_t>& piece, MlsSurface& surface) {
  const Array<std::uint8_t>& crossed = s.pairs.crossed;
  if (!surface.bodies.empty() &&
      std::equal(crossed.begin(), crossed.end(), surface.crossed.begin(), surface.crossed.end())) {
    return;
  }
  if (surface.bodies.empty()) {
    std::int32_t first = 0;
    for (std::size_t b = 0; b < s.scene.bodies.size(); ++b) {
      std::int32_t last = first;
      while (last < s.count() && s.nodes.body[last] == static_cast<std::int16_t>(b)) ++last;
      add_body(s, static_cast<std::int16_t>(b), first, last, surface);
      first = last;
    }
  }
  surface.crossed = crossed;
  Cubes cubes(s, piece, surface);
  const Contour contour = make_contour(cubes);
  surface.vertices.clear();
  for (const Contour::Vertex& v : contour.vertices) {
    surface.vertices.push_back(vertex_of(s, surface, v));
  }
  surface.faces.clear();
  for (const Contour::Face& f : contour.faces) {
    const Cube& cube = surface.cubes[f.cube];
    MlsSurface::Face face{{}, cube.node, static_cast<std::uint8_t>(cube.whole >> f.side & 1)};
    std::copy_n(f.vertex, 4, face.vertex);
    surface.faces.push_back(face);
  }
}

/// How a node sees its surroundings deform; the identity where its support spans no space.
Eigen::Matrix3d deformation(const MlsState& s, std::int32_t i) {
  Eigen::Matrix3d f = Eigen::Matrix3d::Identity();
  if (s.sprung[i] != 0) return f;
  Eigen::Matrix3d inverse;
  const auto m = [&](int k) { return static_cast<double>(s.inverse_moment[k][i]); };
  inverse << m(0), m(3), m(4), m(3), m(1), m(5), m(4), m(5), m(2);
  const auto moved = [&](std::int32_t n) { return Vec3(s.position(n) - s.nodes.place[n]); };
  for (std::int32_t e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
    const std::int32_t j = s.pairs.other[e];
    const Vec3 r = s.nodes.place[j] - s.nodes.place[i];
    f += s.pairs.weight[e] * (moved(j) - moved(i)) * (inverse * r).transpose();
  }
  return f;
}

}  // namespace

void read_surface(const MlsState& s, const std::vector<std::int32_t>& piece, MlsSurface& surface,
                  SurfaceTriangles& out) {
  update(s, piece, surface);
  constexpr int kGrain = 256;
  std::vector<Eigen::Matrix3d> f(s.count());
  std::vector<std::uint8_t> seen(s.count(), 0);
  for (const MlsSurface::Vertex& v : surface.vertices) {
    for (int k = 0; k < 8; ++k) seen[v.node[k]] |= v.weight[k] > 0 ? 1 : 0;
  }
  s.cpu->for_each(
      s.count(),
      [&](int i) {
        if (seen[i] != 0) f[i] = deformation(s, i);
      },
      kGrain);
  const auto vertices = static_cast<int>(surface.vertices.size());
  std::vector<std::array<float, 3>> place(vertices);
  s.cpu->for_each(
      vertices,
      [&](int i) {
        const MlsSurface::Vertex& v = surface.vertices[i];
        Vec3 x = Vec3::Zero();
        for (int k = 0; k < 8; ++k) {
          if (!(v.weight[k] > 0)) continue;
          const std::int32_t n = v.node[k];
          x += v.weight[k] * (s.position(n) + f[n] * (v.rest - s.nodes.place[n]));
        }
        place[i] = floats(x);
      },
      kGrain);
  const auto rest = [&surface](std::int32_t v) { return floats(surface.vertices[v].rest); };
  put_faces(surface.faces, place, rest, piece, *s.cpu, out);
}

}  // namespace tissue_sim
