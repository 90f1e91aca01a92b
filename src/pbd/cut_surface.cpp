// Cuts of the surface model. Where a blade passes an edge the edge gets a vertex there, and both
// its triangles are split: the cut runs along edges. Edges between two places of a stroke, or whose
// triangles the blade parts, are cut; vertices come apart into the groups of triangles around them
// that still hang together. Internal constraints that the blade passes go.
#include <algorithm>
#include <cmath>
#include <map>

#include "pbd/cut.h"

namespace tissue_sim {
namespace pbd {
namespace {

using Edge = std::array<std::int32_t, 2>;
Edge edge_of(std::int32_t a, std::int32_t b) { return {std::min(a, b), std::max(a, b)}; }

/// A new vertex keeps this share of the mesh's mean edge, and of its own edge, off the ends; nearer
/// ones are the end itself. So no edge gets shorter than the first of them.
constexpr double kLeastLength = 0.12, kLeastShare = 0.15;

/// Triangles of each edge.
class EdgeMap {
 public:
  explicit EdgeMap(const State& s) : s_(s) {
    for (std::size_t t = 0; t < s.triangles.size(); ++t) add(static_cast<int>(t));
  }
  void add(int t) {
    const Triangle& c = s_.triangles[t];
    for (int i = 0; i < 3; ++i) edges_[edge_of(c[i], c[(i + 1) % 3])].push_back(t);
  }
  void remove(int t) {
    const Triangle& c = s_.triangles[t];
    for (int i = 0; i < 3; ++i) {
      std::vector<int>& of = edges_[edge_of(c[i], c[(i + 1) % 3])];
      of.erase(std::find(of.begin(), of.end(), t));
    }
  }
  const std::map<Edge, std::vector<int>>& all() const { return edges_; }
  std::vector<int> of(const Edge& e) const {
    const auto at = edges_.find(e);
    return at == edges_.end() ? std::vector<int>() : at->second;
  }

 private:
  const State& s_;
  std::map<Edge, std::vector<int>> edges_;
};

struct Passed {
  Edge edge;
  double place;  ///< from the lower vertex
  Vec3 normal;   ///< of the blade's sweep, world axes
};

class SurfaceCut {
 public:
  SurfaceCut(State& s, const Array<float>& before, int stroke, std::vector<std::int32_t>& origin)
      : s_(s), before_(before), stroke_(stroke), origin_(origin), edges_(s) {}

  /// Cuts by one part of the sweep.
  void pass(const SweepPart& part) {
    for (const Passed& p : passed_edges(part)) insert(p);
    mark_edges(part);
  }

  int remove_internal(const std::vector<SweepPart>& parts) {
    std::vector<InternalPair> kept;
    for (const InternalPair& p : s_.internal) {
      const MovingSegment whole = segment(p.a, p.b);
      bool is_cut = false;
      for (const SweepPart& part : parts) {
        is_cut = is_cut || passes(part, whole, nullptr);
      }
      if (!is_cut) {
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

  /// Vertices of cut edges come apart. Returns how many edges were cut in all passes.
  int part_vertices() {
    std::map<std::int32_t, std::vector<int>> around;
    for (const Edge& e : fresh_) {
      around[e[0]];
      around[e[1]];
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
    return static_cast<int>(fresh_.size());
  }

  /// Keeps what the blade swept, as far as the tissue around has moved back.
  void remember(const std::vector<SweepPart>& parts) {
    Vec3 moved = Vec3::Zero();
    for (const std::int32_t v : touched_)
      moved += s_.vertices.position(v) - s_.vertices.reference[v];
    if (!touched_.empty()) moved /= static_cast<double>(touched_.size());
    for (const SweepPart& part : parts) {
      for (const SweptEdge& e : part.edges) {
        s_.wounds.push_back({e.a0 - moved, e.b0 - moved, e.a1 - moved, e.b1 - moved});
      }
    }
  }

  int touched() const { return static_cast<int>(touched_.size()); }
  bool changed() const { return changed_ || !fresh_.empty(); }

 private:
  MovingSegment segment(std::int32_t a, std::int32_t b) const {
    return {at_before(a), at_before(b), s_.vertices.position(a), s_.vertices.position(b)};
  }
  Vec3 at_before(std::int32_t v) const { return place_before(s_, before_, v); }
  Vec3 middle_before(int t) const {
    const Triangle& c = s_.triangles[t];
    return (at_before(c[0]) + at_before(c[1]) + at_before(c[2])) / 3;
  }
  Vec3 middle(int t) const {
    const Triangle& c = s_.triangles[t];
    return (s_.vertices.position(c[0]) + s_.vertices.position(c[1]) + s_.vertices.position(c[2])) /
           3;
  }

  static bool passes(const SweepPart& part, const MovingSegment& whole, Meeting* meeting) {
    for (int k = 0; k < 3; ++k) {
      if (sweep::largest(whole, k) < part.box.min[k] || sweep::least(whole, k) > part.box.max[k]) {
        return false;
      }
    }
    const MovingSegment link = whole.during(part.begin, part.end);
    for (const SweptEdge& edge : part.edges) {
      if (!stays_aside(edge, link) && edge_passes<Vec3>(edge, link, meeting)) return true;
    }
    return false;
  }

  std::vector<Passed> passed_edges(const SweepPart& part) const {
    std::vector<Passed> passed;
    for (const auto& [e, of] : edges_.all()) {
      if (of.empty()) continue;
      Meeting meeting;
      if (passes(part, segment(e[0], e[1]), &meeting)) {
        passed.push_back({e, meeting.place, meeting.normal});
      }
    }
    return passed;
  }

  /// World axes to reference space, as a normal of a surface goes, by a triangle's motion.
  Vec3 to_reference(int t, const Vec3& normal) const {
    const Triangle& c = s_.triangles[t];
    Eigen::Matrix3d now, then;
    now.col(0) = s_.vertices.position(c[1]) - s_.vertices.position(c[0]);
    now.col(1) = s_.vertices.position(c[2]) - s_.vertices.position(c[0]);
    now.col(2) = now.col(0).cross(now.col(1)).stableNormalized();
    then.col(0) = s_.vertices.reference[c[1]] - s_.vertices.reference[c[0]];
    then.col(1) = s_.vertices.reference[c[2]] - s_.vertices.reference[c[0]];
    then.col(2) = then.col(0).cross(then.col(1)).stableNormalized();
    return ((now * then.inverse()).transpose() * normal).stableNormalized();
  }

  void insert(const Passed& p) {
    const std::vector<int> of = edges_.of(p.edge);
    if (of.empty()) return;  // it was split by one passed before
    const Vec3 normal = to_reference(of[0], p.normal);
    const auto [a, b] = p.edge;
    const double length = (s_.vertices.reference[a] - s_.vertices.reference[b]).norm();
    const Vec3 point =
        (1 - p.place) * s_.vertices.reference[a] + p.place * s_.vertices.reference[b];
    const double off = std::max(kLeastShare, kLeastLength * s_.mean_edge / length);
    std::int32_t v = p.place < 0.5 ? a : b;
    if (std::min(p.place, 1 - p.place) >= off) v = split(a, b, p.place, of);
    s_.stroke[v] = stroke_;
    s_.blade_normal[v] = normal;
    s_.blade_point[v] = point;
  }

  std::int32_t split(std::int32_t a, std::int32_t b, double place, const std::vector<int>& of) {
    Vertices& v = s_.vertices;
    const Vec3 at = (1 - place) * v.reference[a] + place * v.reference[b];
    const std::int32_t n = add_vertex(s_, at, v.body[a]);
    origin_.push_back(place < 0.5 ? a : b);
    const auto mix = static_cast<float>(place);
    for (Array<float>* x : {&v.x, &v.predicted, &v.v}) {
      for (int i = 0; i < 3; ++i)
        (*x)[4 * n + i] = (1 - mix) * (*x)[4 * a + i] + mix * (*x)[4 * b + i];
    }
    v.anchored[n] = v.anchored[a] != 0 && v.anchored[b] != 0 ? 1 : 0;
    v.surface[n] = 1;
    s_.half_depth[n] = (1 - place) * s_.half_depth[a] + place * s_.half_depth[b];
    for (const int t : of) {
      edges_.remove(t);
      Triangle second = s_.triangles[t];
      for (std::int32_t& c : s_.triangles[t]) c = c == b ? n : c;
      for (std::int32_t& c : second) c = c == a ? n : c;
      edges_.add(t);
      s_.triangles.push_back(second);
      edges_.add(static_cast<int>(s_.triangles.size()) - 1);
    }
    if (s_.cut_edges.erase(edge_of(a, b)) > 0) {
      s_.cut_edges.insert(edge_of(a, n));
      s_.cut_edges.insert(edge_of(b, n));
    }
    changed_ = true;
    return n;
  }

  /// Whether the two triangles lie on either side of where the stroke went through between a and b.
  bool is_between(const Edge& e, const std::vector<int>& of) const {
    const auto [a, b] = e;
    if (s_.stroke[a] != stroke_ || s_.stroke[b] != stroke_) return false;
    if (s_.blade_normal[a].dot(s_.blade_normal[b]) < 0.3) return false;
    const Vec3 n = s_.blade_normal[a] + s_.blade_normal[b];
    const Vec3 at = 0.5 * (s_.blade_point[a] + s_.blade_point[b]);
    double side[2];
    for (int k = 0; k < 2; ++k) {
      const Triangle& c = s_.triangles[of[k]];
      const auto& x = s_.vertices.reference;
      side[k] = n.dot((x[c[0]] + x[c[1]] + x[c[2]]) / 3 - at);
    }
    return side[0] * side[1] < 0;
  }

  /// Whether a triangle hangs on by this edge alone: it stays with the neighbour there.
  bool would_be_alone(int t, const Edge& last) const {
    const Triangle& c = s_.triangles[t];
    for (int i = 0; i < 3; ++i) {
      const Edge e = edge_of(c[i], c[(i + 1) % 3]);
      if (e != last && s_.cut_edges.count(e) == 0 && edges_.of(e).size() > 1) return false;
    }
    return true;
  }

  /// Edges whose triangles the blade parts: their centres hang together by a link as points do by
  /// bonds. What a stroke passed before triangles were split, its places on both ends tell.
  void mark_edges(const SweepPart& part) {
    for (const auto& [e, of] : edges_.all()) {
      if (of.size() != 2 || s_.cut_edges.count(e) != 0) continue;
      const MovingSegment link = {middle_before(of[0]), middle_before(of[1]), middle(of[0]),
                                  middle(of[1])};
      if (!is_between(e, of) && !passes(part, link, nullptr)) continue;
      if (would_be_alone(of[0], e) || would_be_alone(of[1], e)) continue;
      s_.cut_edges.insert(e);
      fresh_.push_back(e);
      for (const std::int32_t v : {e[0], e[1]}) {
        if (s_.stroke[v] < 0) {  // a step of the cut, where no vertex could be put on the blade
          s_.stroke[v] = stroke_;
          s_.blade_point[v] = s_.vertices.reference[v];
        }
        ++s_.vertices.cut_links[v];
        touched_.insert(v);
      }
    }
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
    changed_ = true;
    parted_.insert(v);
  }

  State& s_;
  const Array<float>& before_;
  const int stroke_;
  std::vector<std::int32_t>& origin_;
  EdgeMap edges_;
  std::vector<Edge> fresh_;
  std::set<std::int32_t> touched_, parted_;
  bool changed_ = false;
};

}  // namespace

int copy_vertex(State& s, int of, std::vector<std::int32_t>& origin) {
  Vertices& v = s.vertices;
  const int n = add_vertex(s, v.reference[of], v.body[of]);
  for (Array<float>* x : {&v.x, &v.predicted, &v.v}) {
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

bool cut_surface(State& s, const BladePath& path, const Array<float>& before, int stroke,
                 std::vector<std::int32_t>& origin, CutReport& report) {
  const std::vector<SweepPart> parts = sweep_parts(path);
  SurfaceCut cut(s, before, stroke, origin);
  const int internal = cut.remove_internal(parts);
  for (const SweepPart& part : parts) cut.pass(part);
  const int edges = cut.part_vertices();
  report.bonds_broken += internal + edges;
  report.points_separated += cut.touched();
  if (internal == 0 && !cut.changed()) return false;
  cut.remember(parts);
  return true;
}

}  // namespace pbd
}  // namespace tissue_sim
