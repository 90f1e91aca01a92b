// Wounds: the loops of cut edges between two pieces get a surface each, and all is made anew that
// hangs on triangles.
#include <algorithm>
#include <cmath>
#include <map>

#include "fragments/pieces.h"
#include "pbd/cap_mesh.h"
#include "pbd/cut.h"
#include "pbd/model.h"
#include "pbd/pbd_pieces.h"
#include "pbd/surface_mesh.h"

namespace tissue_sim {
namespace pbd {
namespace {

/// Loops of edges that have one triangle, against that triangle's sense; only of vertices that lie
/// on strokes.
std::vector<std::vector<std::int32_t>> open_loops(const State& s) {
  std::map<std::pair<std::int32_t, std::int32_t>, int> count;
  for (const Triangle& t : s.triangles) {
    for (int i = 0; i < 3; ++i) {
      const std::int32_t a = t[i], b = t[(i + 1) % 3];
      ++count[{std::min(a, b), std::max(a, b)}];
    }
  }
  std::map<std::int32_t, std::int32_t> next;  // the cap's way around is the other one
  std::set<std::int32_t> forked;
  for (const Triangle& t : s.triangles) {
    for (int i = 0; i < 3; ++i) {
      const std::int32_t a = t[i], b = t[(i + 1) % 3];
      if (count[{std::min(a, b), std::max(a, b)}] != 1) continue;
      if (s.stroke[a] < 0 || s.stroke[b] < 0) continue;
      if (!next.emplace(b, a).second) forked.insert(b);
    }
  }
  std::vector<std::vector<std::int32_t>> loops;
  std::set<std::int32_t> seen;
  for (const auto& [start, to] : next) {
    if (seen.count(start) != 0) continue;
    std::vector<std::int32_t> loop;
    std::int32_t v = start;
    bool is_loop = true;
    for (;;) {
      if (!seen.insert(v).second || forked.count(v) != 0) {
        is_loop = v == start && forked.count(v) == 0;
        break;
      }
      loop.push_back(v);
      const auto at = next.find(v);
      if (at == next.end()) {
        is_loop = false;
        break;
      }
      v = at->second;
    }
    if (is_loop && loop.size() >= 3) loops.push_back(loop);
  }
  return loops;
}

/// A loop that comes back to the same place goes around a slit there, whose lips lie on one
/// another, or is two loops that touch: each part by itself, without what has no area.
std::vector<std::vector<std::int32_t>> simple_loops(const State& s,
                                                    const std::vector<std::int32_t>& loop) {
  const double same = 0.1 * s.mean_edge;
  std::vector<std::vector<std::int32_t>> simple;
  std::vector<std::int32_t> way;
  for (const std::int32_t v : loop) {
    const Vec3& x = s.vertices.reference[v];
    std::size_t from = 0;
    while (from < way.size() && (s.vertices.reference[way[from]] - x).norm() > same) ++from;
    if (from == way.size()) {
      way.push_back(v);
      continue;
    }
    if (way.size() - from >= 3) simple.emplace_back(way.begin() + from, way.end());
    way.resize(from + 1);
  }
  if (way.size() >= 3) simple.push_back(way);
  return simple;
}

/// Whether a wound may be closed so: what makes slivers leaves it open.
bool is_sound(const State& s, const std::vector<Vec3>& corners, const CapMesh& cap) {
  constexpr double kLeastAngle = 0.05;  // [rad], 3 degrees
  std::vector<Vec3> x = corners;
  x.insert(x.end(), cap.inner.begin(), cap.inner.end());
  for (const auto& t : cap.triangles) {
    // Not a number is no more than anything.
    if (!(smallest_angle(x[t[0]], x[t[1]], x[t[2]]) > kLeastAngle)) return false;
    for (int i = 0; i < 3; ++i) {
      if (!((x[t[i]] - x[t[(i + 1) % 3]]).norm() > 0.05 * s.mean_edge)) return false;
    }
  }
  for (const std::vector<double>& of : cap.weights) {
    for (const double w : of) {
      if (!std::isfinite(w)) return false;
    }
  }
  return !cap.triangles.empty();
}

}  // namespace

std::vector<std::int32_t> close_wounds(State& s, std::vector<std::int32_t>& origin) {
  UnionFind linked = joined(s);
  // Components that each vertex's copies lie in: a wound within one piece is a slit, not an end.
  std::map<std::int32_t, std::set<std::int32_t>> of_copies;
  for (int v = 0; v < s.vertices.size(); ++v) {
    if (s.stroke[v] >= 0) of_copies[s.copy_of[v]].insert(linked.root(v));
  }
  std::vector<std::int32_t> starts;
  std::vector<std::vector<std::int32_t>> loops;
  for (const std::vector<std::int32_t>& loop : open_loops(s)) {
    for (std::vector<std::int32_t>& part : simple_loops(s, loop)) loops.push_back(std::move(part));
  }
  for (const std::vector<std::int32_t>& loop : loops) {
    int between = 0;
    for (const std::int32_t v : loop) between += of_copies[s.copy_of[v]].size() > 1 ? 1 : 0;
    if (2 * between < static_cast<int>(loop.size())) continue;
    std::vector<Vec3> corners;
    double edge = 0;
    for (std::size_t i = 0; i < loop.size(); ++i) {
      corners.push_back(s.vertices.reference[loop[i]]);
      edge += (corners[i] - s.vertices.reference[loop[(i + 1) % loop.size()]]).norm() / loop.size();
    }
    const double size = std::max(edge, 0.8 * s.mean_edge);
    CapMesh cap = fill_loop(corners, size, s.wounds);
    if (!is_sound(s, corners, cap)) cap = fill_loop(corners, size);
    if (!is_sound(s, corners, cap)) continue;
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
        v.x[4 * n + a] = v.predicted[4 * n + a] = static_cast<float>(cap.inner[i][a] + moved);
        v.v[4 * n + a] = static_cast<float>(speed);
      }
      v.surface[n] = 1;
      for (const Region& region : s.scene.bodies[v.body[n]].anchors) {
        if (region.contains(cap.inner[i])) v.anchored[n] = 1;
      }
      index.push_back(n);
    }
    for (const auto& t : cap.triangles)
      s.triangles.push_back({index[t[0]], index[t[1]], index[t[2]]});
    starts.insert(starts.end(), index.begin(), index.end());
  }
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
