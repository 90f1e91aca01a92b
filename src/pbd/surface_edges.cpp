#include "pbd/surface_edges.h"

#include <algorithm>
#include <cmath>

#include "pbd/model.h"

namespace tissue_sim {
namespace pbd {
namespace {

constexpr int kFreshOfPart = 256;
/// Two triangles at a wound that lie on one another, as where its wall ran along the skin, are a
/// flake without thickness: nothing there resists bending, and which way round they lie, a sign,
/// would turn by rounding [rad]. What a mesh came with stays.
constexpr float kFolded = 3.0f;

/// A triangle's side.
struct Side {
  std::int32_t a, b, opposite;  ///< a < b
  double area;
};

/// The triangles of an edge that is made anew.
struct Around {
  std::int32_t edge;
  int count;                ///< of triangles
  double area, least_area;  ///< of them, and of the smallest [m^2]
};

std::int32_t low_end(const Triangle& t, int side) { return std::min(t[side], t[(side + 1) % 3]); }

/// Angle at rest, and how vertices move for a turn of it; whether it is to resist.
bool bends(const State& s, SurfaceEdge& e) {
  const std::array<std::int32_t, 4> at = {e.left, e.right, e.a, e.b};
  Vertex<float> v[4];
  const Vec3& origin = s.vertices.reference[e.a];
  for (int i = 0; i < 4; ++i) {
    const Vec3 x = s.vertices.reference[at[i]] - origin;
    v[i] = {static_cast<float>(x.x()), static_cast<float>(x.y()), static_cast<float>(x.z()), 0};
  }
  const auto parts = Bending::parts(v);
  e.angle = parts.angle;
  if (std::fabs(e.angle) > kFolded && (s.stroke[e.a] >= 0 || s.stroke[e.b] >= 0)) return false;
  Vector<float> g[4];
  Bending::gradients(v, parts, g);
  for (int i = 0; i < 4; ++i) e.squares[i] = dot(g[i], g[i]);
  return true;
}

void make_edge(const State& s, const Around& around, SurfaceEdge& e) {
  const PbdOptions& pbd = s.scene.pbd;
  const auto& x = s.vertices.reference;
  const Body& body = s.scene.bodies[s.vertices.body[e.a]];
  const Material& m = material_at(s.scene, body, 0.5 * (x[e.a] + x[e.b]));
  const double l2 = (x[e.a] - x[e.b]).squaredNorm();
  const bool tets = pbd.model == PbdModel::kTetrahedra;
  const double thick = tets ? 0 : 0.5 * (s.half_depth[e.a] + s.half_depth[e.b]);
  const double stiffness = pbd.edge * m.young_modulus * thick * around.area / l2;
  e.length = static_cast<float>((x[e.a] - x[e.b]).norm());
  e.compliance = stiffness > 0 ? static_cast<float>(1 / stiffness) : -1;
  e.bending = 0;
  if (around.count != 2 || e.left == e.right) return;  // a triangle and its back have no angle
  const double even = 2 / std::sqrt(3.0) * 2 * around.least_area / std::sqrt(l2);
  const double plate = m.young_modulus * std::pow(std::min(std::sqrt(l2), even), 3) /
                       (12 * (1 - m.poisson_ratio * m.poisson_ratio));
  const double bending = pbd.bending * 3 * plate * l2 / around.area;
  if (bending > 0 && bends(s, e)) e.bending = bending;
}

}  // namespace

std::vector<std::uint8_t> SurfaceEdges::changed_vertices(const State& s) {
  const std::size_t count = s.vertices.reference.size(), known = vertices_.size();
  std::vector<std::uint8_t> changed(count, 0);
  vertices_.resize(count);
  for (std::size_t v = 0; v < count; ++v) {
    const double depth = v < s.half_depth.size() ? s.half_depth[v] : 0;
    const MadeOf now = {s.vertices.reference[v], depth, s.stroke[v] >= 0};
    changed[v] = v < known && vertices_[v] == now ? 0 : 1;
    vertices_[v] = now;
  }
  return changed;
}

/// Of each vertex: whether any of the edges of which it is the lower end is to be made anew.
std::vector<std::uint8_t> SurfaceEdges::changed_ends(const State& s) {
  const std::vector<std::uint8_t> changed = changed_vertices(s);
  std::vector<std::uint8_t> ends = changed;
  const auto mark = [&ends](const Triangle& t) {
    for (int i = 0; i < 3; ++i) {
      const auto low = static_cast<std::size_t>(low_end(t, i));
      if (low < ends.size()) ends[low] = 1;
    }
  };
  const std::size_t both = std::min(triangles_.size(), s.triangles.size());
  for (std::size_t t = 0; t < both; ++t) {
    const Triangle& now = s.triangles[t];
    if (now == triangles_[t] && changed[now[0]] + changed[now[1]] + changed[now[2]] == 0) continue;
    mark(triangles_[t]);
    mark(now);
  }
  std::for_each(triangles_.begin() + static_cast<std::ptrdiff_t>(both), triangles_.end(), mark);
  std::for_each(s.triangles.begin() + static_cast<std::ptrdiff_t>(both), s.triangles.end(), mark);
  triangles_ = s.triangles;
  return ends;
}

void SurfaceEdges::update(State& s) {
  const std::vector<std::uint8_t> is_changed = changed_ends(s);
  std::vector<Side> sides;
  for (const Triangle& t : s.triangles) {
    for (int i = 0; i < 3; ++i) {
      const std::int32_t low = low_end(t, i);
      if (is_changed[low] == 0) continue;
      sides.push_back({low, std::max(t[i], t[(i + 1) % 3]), t[(i + 2) % 3], area_of(s, t)});
    }
  }
  // Those of an edge stay in the order of the triangles.
  std::stable_sort(sides.begin(), sides.end(), [](const Side& p, const Side& q) {
    return p.a < q.a || (p.a == q.a && p.b < q.b);
  });
  edges_.swap(last_);
  edges_.clear();
  std::vector<std::int32_t> begin;
  begin.reserve(is_changed.size() + 1);
  std::vector<Around> fresh;
  auto side = sides.begin();
  for (int a = 0; a < s.vertices.size(); ++a) {
    begin.push_back(static_cast<std::int32_t>(edges_.size()));
    if (is_changed[a] == 0) {
      edges_.insert(edges_.end(), last_.begin() + begin_[a], last_.begin() + begin_[a + 1]);
      continue;
    }
    for (std::int32_t b = -1; side != sides.end() && side->a == a; b = (side++)->b) {
      if (side->b != b) {
        fresh.push_back({static_cast<std::int32_t>(edges_.size()), 1, side->area, side->area});
        edges_.push_back({a, side->b, side->opposite, -1, 0, -1, 0, {}, 0});
        continue;
      }
      Around& around = fresh.back();
      if (++around.count == 2) edges_.back().right = side->opposite;
      around.area += side->area;
      around.least_area = std::min(around.least_area, side->area);
    }
  }
  begin.push_back(static_cast<std::int32_t>(edges_.size()));
  begin_.swap(begin);
  const auto count = static_cast<int>(fresh.size());
  s.cpu.for_each((count + kFreshOfPart - 1) / kFreshOfPart, [&](int part) {
    for (int i = part * kFreshOfPart; i < std::min(count, (part + 1) * kFreshOfPart); ++i) {
      make_edge(s, fresh[i], edges_[fresh[i].edge]);
    }
  });
}

}  // namespace pbd
}  // namespace tissue_sim
