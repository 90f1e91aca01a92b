// Wounds: the loops of cut edges between two pieces get a surface each, and all is made anew that
// hangs on triangles.
#include <algorithm>
#include <cmath>
#include <map>
#include <unordered_set>

#include "fragments/pieces.h"
#include "pbd/cap_mesh.h"
#include "pbd/cut.h"
#include "pbd/model.h"
#include "pbd/pbd_pieces.h"
#include "pbd/surface_mesh.h"
#include "pbd/wound_loops.h"

namespace tissue_sim {
namespace pbd {
namespace {

/// Of triangles: from, to.
class Edges {
 public:
  using Edge = std::pair<std::int32_t, std::int32_t>;
  void insert(const Edge& e) { all_.insert(key(e)); }
  std::size_t count(const Edge& e) const { return all_.count(key(e)); }

 private:
  static std::uint64_t key(const Edge& e) {
    return static_cast<std::uint64_t>(e.first) << 32 | static_cast<std::uint32_t>(e.second);
  }
  std::unordered_set<std::uint64_t> all_;
};

/// The smallest angle of a surface that would close a wound [rad]. 0 if it has an edge that is too
/// short, or one that a triangle has already in this sense.
double soundness(const State& s, const std::vector<std::int32_t>& loop, const Edges& edges,
                 const std::vector<Vec3>& corners, const CapMesh& cap) {
  std::vector<Vec3> x = corners;
  x.insert(x.end(), cap.inner.begin(), cap.inner.end());
  double least = cap.triangles.empty() ? 0 : 4;
  for (const auto& t : cap.triangles) {
    const double angle = smallest_angle(x[t[0]], x[t[1]], x[t[2]]);
    if (!(angle > 0)) return 0;  // nor if it is not a number
    least = std::min(least, angle);
    const int n = static_cast<int>(loop.size());
    for (int i = 0; i < 3; ++i) {
      const int a = t[i], b = t[(i + 1) % 3];
      if (!((x[a] - x[b]).norm() > 0.1 * s.mean_edge)) return 0;
      if (a < n && b < n && edges.count({loop[a], loop[b]}) != 0) return 0;
    }
  }
  for (const std::vector<double>& of : cap.weights) {
    for (const double w : of) {
      if (!std::isfinite(w)) return 0;
    }
  }
  return least;
}

/// Where triangles join two of a loop's vertices already, on either side of the wound (`joined`:
/// pairs of what `copied` vertices are copies of), an edge across gets a vertex in its middle.
void split_chords(const std::vector<Vec3>& corners, const std::vector<std::int32_t>& copied,
                  const Edges& joined, CapMesh& cap) {
  const int n = static_cast<int>(corners.size());
  std::map<std::pair<int, int>, int> middle;
  for (std::size_t t = 0; t < cap.triangles.size(); ++t) {  // and those that this adds
    for (int i = 0; i < 3; ++i) {
      const std::array<int, 3> c = cap.triangles[t];
      const int a = c[i], b = c[(i + 1) % 3];
      if (a >= n || b >= n || (a + 1) % n == b || (b + 1) % n == a) continue;
      if (joined.count(std::minmax(copied[a], copied[b])) == 0) continue;
      const auto next = n + static_cast<int>(cap.inner.size());
      const auto [at, is_new] = middle.try_emplace(std::minmax(a, b), next);
      if (is_new) {
        cap.inner.push_back(0.5 * (corners[a] + corners[b]));
        cap.weights.emplace_back(n, 0.0);
        cap.weights.back()[a] = cap.weights.back()[b] = 0.5;
      }
      cap.triangles[t][(i + 1) % 3] = at->second;
      cap.triangles.push_back(c);
      cap.triangles.back()[i] = at->second;
    }
  }
}

/// A loop that was closed: the vertices that its own are copies of, and how.
struct Closed {
  std::vector<std::int32_t> loop;
  CapMesh cap;
};

/// What closed the other side of the wound, seen from this one; no triangles where none did. With
/// it the volumes of both sides add up.
CapMesh mirrored(const std::vector<Closed>& all, const std::vector<std::int32_t>& loop) {
  const int n = static_cast<int>(loop.size());
  for (const Closed& other : all) {
    if (static_cast<int>(other.loop.size()) != n) continue;
    for (int turn = 0; turn < n; ++turn) {
      const auto there = [&](int i) { return (turn - i + n) % n; };
      int same = 0;
      while (same < n && other.loop[there(same)] == loop[same]) ++same;
      if (same < n) continue;
      CapMesh cap = other.cap;
      for (auto& t : cap.triangles) {
        for (int& k : t) k = k < n ? there(k) : k;
        std::swap(t[1], t[2]);
      }
      for (std::size_t i = 0; i < cap.weights.size(); ++i) {
        for (int k = 0; k < n; ++k) cap.weights[i][k] = other.cap.weights[i][there(k)];
      }
      return cap;
    }
  }
  return {};
}

/// A surface that closes a wound: what closed its `other_side`, the blade's sheets, a smooth one,
/// or at last one that any loop has. The first that is sound, or the one that is soundest; no
/// triangles where all are slivers, and the wound stays open.
CapMesh choose_cap(const State& s, const std::vector<std::int32_t>& loop, const Edges& edges,
                   const Edges& joined, const std::vector<Vec3>& corners, double size,
                   CapMesh other_side) {
  constexpr double kSound = 0.05, kBearable = 0.001;  // [rad]
  CapMesh best;
  double most = kBearable;
  std::vector<std::int32_t> copied;
  for (const std::int32_t v : loop) copied.push_back(s.copy_of[v]);
  const auto is_sound = [&](CapMesh cap) {
    for (const bool is_widened : {false, true}) {
      if (is_widened) widen_angles(corners, cap);
      CapMesh tried = cap;
      split_chords(corners, copied, joined, tried);
      const double angle = soundness(s, loop, edges, corners, tried);
      if (angle > most) {
        most = angle;
        best = std::move(tried);
      }
      if (most > kSound) return true;
    }
    return false;
  };
  if (is_sound(std::move(other_side)) || is_sound(fill_loop(corners, size, s.wounds)) ||
      is_sound(fill_loop(corners, size))) {
    return best;
  }
  for (const double rise : {0.0, -0.3, 0.3, -0.6, 0.6, -1.0, 1.0}) {
    if (is_sound(fill_by_rings(corners, size, rise * size))) break;
  }
  return best;
}

}  // namespace

/// What the lips of a slit whose vertices do not match leave between them, of an edge's square for
/// each edge.
static constexpr double kLipsApart = 0.05;

std::vector<std::int32_t> close_wounds(State& s, std::vector<std::int32_t>& origin) {
  UnionFind linked = pbd::joined(s);
  // Components that each vertex's copies lie in: a wound within one piece is a slit, not an end.
  std::map<std::int32_t, std::set<std::int32_t>> of_copies;
  for (int v = 0; v < s.vertices.size(); ++v) {
    if (s.stroke[v] >= 0) of_copies[s.copy_of[v]].insert(linked.root(v));
  }
  Edges edges, joined;  // of `joined`, what they are copies of, in order
  const auto add_edges = [&](const Triangle& t, bool is_wall) {
    for (int i = 0; i < 3; ++i) {
      const std::int32_t a = t[i], b = t[(i + 1) % 3];
      if (s.stroke[a] < 0 || s.stroke[b] < 0) continue;
      edges.insert({a, b});
      if (!is_wall) joined.insert(std::minmax(s.copy_of[a], s.copy_of[b]));
    }
  };
  for (const Triangle& t : s.triangles) add_edges(t, false);
  std::vector<std::int32_t> starts;
  std::vector<Closed> closed;
  // Whether a loop was closed, or needs not be.
  const auto close = [&](const std::vector<std::int32_t>& loop, bool only_holes) {
    int between = 0;
    for (const std::int32_t v : loop) between += of_copies[s.copy_of[v]].size() > 1 ? 1 : 0;
    std::vector<Vec3> corners;
    double edge = 0;
    Vec3 area = Vec3::Zero();
    for (std::size_t i = 0; i < loop.size(); ++i) {
      corners.push_back(s.vertices.reference[loop[i]]);
      const Vec3& next = s.vertices.reference[loop[(i + 1) % loop.size()]];
      edge += (corners[i] - next).norm() / static_cast<double>(loop.size());
      area += 0.5 * (corners[i] - corners[0]).cross(next - corners[0]);
    }
    const bool is_hole = area.norm() > kLipsApart * static_cast<double>(loop.size()) * edge * edge;
    const bool is_end = !only_holes && 2 * between >= static_cast<int>(loop.size());
    if (!is_end && !is_hole) return true;
    std::vector<std::int32_t> copied;
    for (const std::int32_t v : loop) copied.push_back(s.copy_of[v]);
    const CapMesh cap = choose_cap(s, loop, edges, joined, corners,
                                   std::max(edge, 0.8 * s.mean_edge), mirrored(closed, copied));
    if (cap.triangles.empty()) return !is_hole;
    closed.push_back({copied, cap});
    std::vector<std::int32_t> index = loop;
    for (std::size_t i = 0; i < cap.inner.size(); ++i) {
      const std::int32_t n = add_vertex(s, cap.inner[i], s.vertices.body[loop[0]]);
      origin.push_back(loop[0]);
      Vertices& v = s.vertices;
      for (int a = 0; a < 3; ++a) {  // as the loop has moved
        double moved = 0, speed = 0;
        for (std::size_t k = 0; k < loop.size(); ++k) {
          const double w = cap.weights[i][k];
          moved += w * (v.x[4 * loop[k] + a] - corners[k][a]);
          speed += w * v.v[4 * loop[k] + a];
        }
        v.x[4 * n + a] = static_cast<float>(cap.inner[i][a] + moved);
        v.v[4 * n + a] = static_cast<float>(speed);
      }
      v.surface[n] = 1;
      for (const Region& region : s.scene.bodies[v.body[n]].anchors) {
        if (region.contains(cap.inner[i])) v.anchored[n] = 1;
      }
      index.push_back(n);
    }
    for (const auto& t : cap.triangles) {
      s.triangles.push_back({index[t[0]], index[t[1]], index[t[2]]});
      s.cut.push_back(1);
      add_edges(s.triangles.back(), true);
    }
    starts.insert(starts.end(), index.begin(), index.end());
    return true;
  };
  bool all = true;
  for (const std::vector<std::int32_t>& loop : open_loops(s)) {
    for (LoopPart& part : simple_loops(s, loop)) {
      bool closed = close(part.loop, false);
      if (!closed && part.twin >= 0) {  // with the edge from the twin, which may not be taken
        part.loop[0] = part.twin;
        closed = close(part.loop, false);
      }
      all = closed && all;
    }
  }
  if (all) return starts;
  for (const std::vector<std::int32_t>& loop : open_loops(s)) close(loop, true);  // with its slits
  return starts;
}

namespace {

Motion motion_of(const State& s, int body, const Vec3* about) {
  const Vertices& v = s.vertices;
  Motion m;
  for (int i = 0; i < v.size(); ++i) {
    if (v.body[i] != body || v.anchored[i] != 0) continue;
    m.mass += v.mass[i];
    m.centre += v.mass[i] * v.position(i);
    m.linear += v.mass[i] * v.velocity(i);
  }
  if (m.mass > 0) m.centre /= m.mass;
  const Vec3 at = about != nullptr ? *about : m.centre;
  for (int i = 0; i < v.size(); ++i) {
    if (v.body[i] != body || v.anchored[i] != 0) continue;
    const Vec3 r = v.position(i) - at;
    m.angular += v.mass[i] * r.cross(v.velocity(i));
    m.inertia += v.mass[i] * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
  }
  return m;
}

/// Masses that are shared out anew must not change what moves: a rigid motion takes the difference.
void restore(State& s, int body, const Motion& before) {
  Vertices& v = s.vertices;
  const Motion now = motion_of(s, body, nullptr);
  if (!(now.mass > 0)) return;
  const Vec3 add = (before.linear - now.linear) / now.mass;
  // Each about its own centre, which masses that change places move: nothing else moved.
  const Vec3 spin = now.inertia.fullPivLu().solve(Vec3(before.angular - now.angular));
  for (int i = 0; i < v.size(); ++i) {
    if (v.body[i] != body || v.anchored[i] != 0) continue;
    const Vec3 change = add + spin.cross(v.position(i) - now.centre);
    for (int a = 0; a < 3; ++a) v.v[4 * i + a] += static_cast<float>(change[a]);
  }
}

}  // namespace

std::vector<Motion> motions(const State& s) {
  std::vector<Motion> of;
  for (std::size_t b = 0; b < s.scene.bodies.size(); ++b) {
    of.push_back(motion_of(s, static_cast<int>(b), nullptr));
  }
  return of;
}

void after_cut(State& s, std::vector<std::int32_t>& origin) {
  const int bodies = static_cast<int>(s.scene.bodies.size());
  if (s.tetrahedra.empty()) {
    UnionFind skin = skins(s);  // those found while the skin still hung together go when it parts
    s.internal.erase(std::remove_if(s.internal.begin(), s.internal.end(),
                                    [&skin](const InternalPair& p) {
                                      return p.is_late && skin.root(p.a) != skin.root(p.b);
                                    }),
                     s.internal.end());
    std::vector<std::int32_t> starts = close_wounds(s, origin);
    for (int v = s.vertices.size() - static_cast<int>(origin.size()); v < s.vertices.size(); ++v) {
      starts.push_back(v);
    }
    starts.insert(starts.end(), s.bare.begin(), s.bare.end());
    s.bare.clear();
    std::sort(starts.begin(), starts.end());
    starts.erase(std::unique(starts.begin(), starts.end()), starts.end());
    for (int b = 0; b < bodies; ++b) {
      std::vector<int> own;
      for (const std::int32_t v : starts) {
        if (s.vertices.body[v] == b) own.push_back(v);
      }
      if (!own.empty()) add_internal_links(s, b, own);
    }
  }
  share_out_mass(s);
}

void after_cuts(State& s, const std::vector<Motion>& before) {
  make_surface_constraints(s);
  make_tet_constraints(s);
  pack(s);
  for (std::size_t b = 0; b < before.size(); ++b) restore(s, static_cast<int>(b), before[b]);
}

}  // namespace pbd
}  // namespace tissue_sim
