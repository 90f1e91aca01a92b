// Cuts of the surface model: edges that a blade passes are split, those along its line are cut
// (surface_trace.h); vertices come apart into the groups of triangles around them that still hang
// together. Internal constraints that the blade passes go.
#include <algorithm>
#include <cmath>
#include <map>

#include "pbd/cut.h"
#include "pbd/surface_trace.h"

namespace tissue_sim {
namespace pbd {
namespace {

class SurfaceCut {
 public:
  SurfaceCut(State& s, const std::vector<Vec3>& before, const std::vector<SweepPart>& parts,
             std::vector<std::int32_t>& origin)
      : s_(s), before_(before), parts_(parts), origin_(origin) {}

  int remove_internal(const std::vector<std::uint8_t>* whole) {
    constexpr int kPairsOfPart = 1024;
    const auto count = static_cast<int>(s_.internal.size());
    std::vector<std::uint8_t> passed(count, 0);
    s_.cpu.for_each((count + kPairsOfPart - 1) / kPairsOfPart, [&](int part) {
      for (int k = part * kPairsOfPart; k < std::min(count, (part + 1) * kPairsOfPart); ++k) {
        const InternalPair& p = s_.internal[k];
        if (whole == nullptr || (*whole)[p.a] == 0) passed[k] = is_passed(p) ? 1 : 0;
      }
    });
    std::vector<InternalPair> kept;
    for (int k = 0; k < count; ++k) {
      const InternalPair& p = s_.internal[k];
      if (passed[k] == 0) {
        kept.push_back(p);
        continue;
      }
      for (const std::int32_t v : {p.a, p.b}) {
        ++s_.vertices.cut_links[v];
        touched_.insert(v);
      }
    }
    const int removed = static_cast<int>(s_.internal.size() - kept.size());
    s_.internal.swap(kept);
    return removed;
  }

  /// Vertices of cut edges come apart.
  void part_vertices(const std::vector<Edge>& fresh) {
    std::map<std::int32_t, std::vector<int>> around;
    for (const Edge& e : fresh) {
      for (const std::int32_t v : e) {
        around[v];
        ++s_.vertices.cut_links[v];
        touched_.insert(v);
      }
    }
    for (std::size_t t = 0; t < s_.triangles.size(); ++t) {
      for (const std::int32_t v : s_.triangles[t]) {
        const auto at = around.find(v);
        if (at != around.end()) at->second.push_back(static_cast<int>(t));
      }
    }
    for (const auto& [v, triangles] : around) part_vertex(v, triangles);
    // Which side the internal constraints of a vertex that came apart belong to, new rays tell.
    std::vector<InternalPair> kept;
    for (const InternalPair& p : s_.internal) {
      if (parted_.count(p.a) == 0 && parted_.count(p.b) == 0) kept.push_back(p);
    }
    s_.internal.swap(kept);
    s_.bare.insert(s_.bare.end(), parted_.begin(), parted_.end());
  }

  /// Keeps what the blade swept, as far as the tissue around has moved back.
  void remember() {
    Vec3 moved = Vec3::Zero();
    for (const std::int32_t v : touched_)
      moved += s_.vertices.position(v) - s_.vertices.reference[v];
    if (!touched_.empty()) moved /= static_cast<double>(touched_.size());
    for (const SweepPart& part : parts_) {
      for (const SweptEdge& e : part.edges) {
        s_.wounds.push_back({e.a0 - moved, e.b0 - moved, e.a1 - moved, e.b1 - moved});
      }
    }
  }

  int touched() const { return static_cast<int>(touched_.size()); }

 private:
  bool is_passed(const InternalPair& p) const {
    const MovingSegment whole = {place_before(s_, before_, p.a), place_before(s_, before_, p.b),
                                 s_.vertices.position(p.a), s_.vertices.position(p.b)};
    for (const SweepPart& part : parts_) {
      bool is_aside = false;
      for (int k = 0; k < 3; ++k) {
        is_aside = is_aside || sweep::largest(whole, k) < part.box.min[k] ||
                   sweep::least(whole, k) > part.box.max[k];
      }
      if (is_aside) continue;
      const MovingSegment link = whole.during(part.begin, part.end);
      for (const SweptEdge& edge : part.edges) {
        if (!stays_aside(edge, link) && edge_passes<Vec3>(edge, link)) return true;
      }
    }
    return false;
  }

  void part_vertex(std::int32_t v, const std::vector<int>& triangles) {
    std::map<int, int> group;
    for (const int t : triangles) group[t] = t;
    std::map<std::int32_t, std::vector<int>> by_other;  // those of each edge at v
    for (const int t : triangles) {
      for (const std::int32_t c : s_.triangles[t]) {
        if (c != v) by_other[c].push_back(t);
      }
    }
    for (bool again = true; again;) {
      again = false;
      for (const auto& [other, of] : by_other) {
        if (s_.cut_edges.count(edge_of(v, other)) != 0) continue;
        for (const int t : of) {
          const int low = std::min(group[of[0]], group[t]);
          if (group[of[0]] == low && group[t] == low) continue;
          group[of[0]] = group[t] = low;
          again = true;
        }
      }
    }
    std::map<int, std::int32_t> vertex;  // of each group; the lowest keeps v
    for (const int t : triangles) {
      const auto [at, is_new] = vertex.try_emplace(group[t], v);
      if (is_new && vertex.size() > 1) at->second = copy_vertex(s_, v, origin_);
      if (at->second == v) continue;
      const std::int32_t w = at->second;
      for (const std::int32_t c : s_.triangles[t]) {  // what is cut stays so under the new name
        if (c != v && s_.cut_edges.count(edge_of(v, c)) != 0) s_.cut_edges.insert(edge_of(w, c));
      }
      for (std::int32_t& c : s_.triangles[t]) c = c == v ? w : c;
    }
    if (vertex.size() < 2) return;
    parted_.insert(v);
    for (auto* ends : {&s_.fronts, &s_.starts}) {
      for (std::set<std::int32_t>& of : *ends) {
        if (of.count(v) == 0) continue;
        for (const auto& [first, w] : vertex) of.insert(w);
      }
    }
  }

  State& s_;
  const std::vector<Vec3>& before_;
  const std::vector<SweepPart>& parts_;
  std::vector<std::int32_t>& origin_;
  std::set<std::int32_t> touched_, parted_;
};

}  // namespace

int copy_vertex(State& s, int of, std::vector<std::int32_t>& origin) {
  Vertices& v = s.vertices;
  const int n = add_vertex(s, v.reference[of], v.body[of]);
  for (Array<float>* x : {&v.x, &v.moved, &v.v}) {
    for (int a = 0; a < 4; ++a) (*x)[4 * n + a] = (*x)[4 * of + a];
  }
  v.anchored[n] = v.anchored[of];
  v.surface[n] = 1;
  v.cut_links[n] = v.cut_links[of];
  v.whole_links[n] = v.whole_links[of];
  s.half_depth[n] = s.half_depth[of];
  s.stroke[n] = s.stroke[of];
  s.blade_normal[n] = s.blade_normal[of];
  s.blade_point[n] = s.blade_point[of];
  s.copy_of[n] = s.copy_of[of];
  origin.push_back(of);
  return n;
}

bool cut_surface(State& s, const BladePath& path, const std::vector<Vec3>& before, int stroke,
                 std::vector<std::int32_t>& origin, CutReport& report,
                 const std::vector<std::uint8_t>* whole) {
  const std::vector<SweepPart> parts = sweep_parts(path);
  SurfaceCut cut(s, before, parts, origin);
  const int internal = cut.remove_internal(whole);
  SurfaceTrace trace(s, before, stroke, parts, origin, whole);
  trace.run();
  cut.part_vertices(trace.fresh());
  s.fronts.back().clear();  // a whole path does not go on
  s.starts.back().clear();
  report.bonds_broken += internal + static_cast<int>(trace.fresh().size());
  report.points_separated += cut.touched();
  if (internal == 0 && !trace.split_any() && trace.fresh().empty()) return false;
  cut.remember();
  return true;
}

}  // namespace pbd
}  // namespace tissue_sim
