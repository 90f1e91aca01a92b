#include "pbd/surface_trace.h"

#include <cmath>

#include "pbd/cut.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace pbd {
namespace {

/// An edge reaches beyond its ends by this share: a blade through a vertex passes one at least.
constexpr double kMargin = 1e-6;
/// A blade that passed an edge may pass it again after this share of a part's time, ...
constexpr double kPause = 1e-6;
/// ... but so often in all.
constexpr int kRounds = 6;

MovingSegment stretched(const MovingSegment& m) {
  const Vec3 d0 = kMargin * (m.b0 - m.a0), d1 = kMargin * (m.b1 - m.a1);
  return {m.a0 - d0, m.b0 + d0, m.a1 - d1, m.b1 + d1};
}

bool is_aside(const MovingSegment& whole, const Box& box) {
  for (int k = 0; k < 3; ++k) {
    if (sweep::largest(whole, k) < box.min[k] || sweep::least(whole, k) > box.max[k]) return true;
  }
  return false;
}

/// First time in [begin, 1] of the part at which its blade meets the link, by halving.
bool first_meeting(const SweepPart& part, const MovingSegment& link, double begin, double& time,
                   Meeting& meeting) {
  bool any = false;
  for (const SweptEdge& edge : part.edges) {
    const double end = any ? time : 1;
    if (stays_aside(edge, link)) continue;
    Meeting found;
    double lo = begin, hi = end;
    if (!edge_passes<Vec3>(edge.during(lo, hi), link.during(lo, hi), &found)) continue;
    for (int k = 0; k < 24; ++k) {
      const double mid = 0.5 * (lo + hi);
      if (edge_passes<Vec3>(edge.during(lo, mid), link.during(lo, mid), &found)) {
        hi = mid;
      } else {
        lo = mid;
      }
    }
    any = true;
    time = hi;
    meeting = found;
  }
  return any;
}

/// Triangles that a sweep may meet, and their neighbours.
std::vector<int> near(State& s, const std::vector<Vec3>& before,
                      const std::vector<SweepPart>& parts, const std::vector<std::uint8_t>* whole) {
  Box box;
  for (const SweepPart& p : parts) {
    box.min = box.min.cwiseMin(p.box.min);
    box.max = box.max.cwiseMax(p.box.max);
  }
  constexpr int kTrianglesOfPart = 2048;
  const auto count = static_cast<int>(s.triangles.size());
  std::vector<std::uint8_t> is_met(count, 0);
  s.cpu.for_each((count + kTrianglesOfPart - 1) / kTrianglesOfPart, [&](int part) {
    for (int k = part * kTrianglesOfPart; k < std::min(count, (part + 1) * kTrianglesOfPart); ++k) {
      const Triangle& t = s.triangles[k];
      if (whole != nullptr && (*whole)[t[0]] != 0) continue;
      Box own;
      for (const std::int32_t v : t) {
        for (const Vec3& x : {place_before(s, before, v), s.vertices.position(v)}) {
          own.min = own.min.cwiseMin(x);
          own.max = own.max.cwiseMax(x);
        }
      }
      is_met[k] = (own.max - box.min).minCoeff() < 0 || (box.max - own.min).minCoeff() < 0 ? 0 : 1;
    }
  });
  std::vector<std::uint8_t> is_near(s.vertices.size(), 0);
  for (int k = 0; k < count; ++k) {
    if (is_met[k] == 0) continue;
    for (const std::int32_t v : s.triangles[k]) is_near[v] = 1;
  }
  std::vector<int> found;
  for (std::size_t t = 0; t < s.triangles.size(); ++t) {
    const Triangle& c = s.triangles[t];
    if (is_near[c[0]] + is_near[c[1]] + is_near[c[2]] > 0) found.push_back(static_cast<int>(t));
  }
  return found;
}

/// World axes to reference space, as a normal of a surface goes, by a triangle's motion.
Vec3 to_reference(const State& s, int t, const Vec3& normal) {
  const Triangle& c = s.triangles[t];
  Eigen::Matrix3d now, then;
  now.col(0) = s.vertices.position(c[1]) - s.vertices.position(c[0]);
  now.col(1) = s.vertices.position(c[2]) - s.vertices.position(c[0]);
  now.col(2) = now.col(0).cross(now.col(1)).stableNormalized();
  then.col(0) = s.vertices.reference[c[1]] - s.vertices.reference[c[0]];
  then.col(1) = s.vertices.reference[c[2]] - s.vertices.reference[c[0]];
  then.col(2) = then.col(0).cross(then.col(1)).stableNormalized();
  return ((now * then.inverse()).transpose() * normal).stableNormalized();
}

}  // namespace

SurfaceTrace::SurfaceTrace(State& s, const std::vector<Vec3>& before, int stroke,
                           const std::vector<SweepPart>& parts, std::vector<std::int32_t>& origin,
                           const std::vector<std::uint8_t>* whole)
    : s_(s),
      before_(before),
      stroke_(stroke),
      old_count_(s.vertices.size()),
      parts_(parts),
      origin_(origin),
      edges_(s, near(s, before, parts, whole)) {}

Vec3 SurfaceTrace::at_before(std::int32_t v) const {
  return v < old_count_ ? place_before(s_, before_, v) : before_of_new_[v - old_count_];
}

/// Puts the next time at which the blade passes the edge into the queue.
void SurfaceTrace::await(const Edge& e, std::size_t part, double time, int round) {
  if (round >= kRounds) return;
  const MovingSegment whole = stretched(segment(e[0], e[1]));
  for (std::size_t k = part; k < parts_.size(); ++k) {
    const SweepPart& p = parts_[k];
    const double begin = k == part ? time : 0;
    if (begin >= 1 || is_aside(whole, p.box)) continue;
    Passing next;
    Meeting meeting;
    if (!first_meeting(p, whole.during(p.begin, p.end), begin, next.time, meeting)) continue;
    next.part = k;
    next.edge = e;
    next.place = std::max(0.0, std::min(1.0, meeting.place * (1 + 2 * kMargin) - kMargin));
    next.normal = meeting.normal;
    next.round = round;
    queue_.push(next);
    return;
  }
}

void SurfaceTrace::run() {
  std::vector<Edge> all;
  for (const auto& [e, of] : edges_.all()) all.push_back(e);
  for (const Edge& e : all) await(e, 0, 0, 0);
  while (!queue_.empty()) {
    stop_if_asked();
    const Passing next = queue_.top();
    queue_.pop();
    pass(next);
  }
  join_strokes();
}

void SurfaceTrace::pass(const Passing& p) {
  const std::vector<int> of = edges_.of(p.edge);
  if (of.empty()) return;  // it was split
  std::set<std::int32_t> corners;
  for (const int t : of) corners.insert(s_.triangles[t].begin(), s_.triangles[t].end());
  const std::int32_t v = vertex_at(p, of);
  if (v == p.edge[0] || v == p.edge[1]) {
    await(p.edge, p.part, p.time + kPause, p.round + 1);
  } else {
    await(edge_of(p.edge[0], v), p.part, p.time + kPause, p.round + 1);
    await(edge_of(p.edge[1], v), p.part, p.time + kPause, p.round + 1);
    for (const std::int32_t c : corners) {
      if (c != p.edge[0] && c != p.edge[1]) {
        await(edge_of(c, v), p.part, p.time + kPause, p.round + 1);
      }
    }
  }
  const std::size_t line = std::min<std::size_t>(stroke_, s_.fronts.size() - 1);
  std::set<std::int32_t>&fronts = s_.fronts[line], &starts = s_.starts[line];
  bool goes_on = false;
  for (const std::int32_t c : corners) {
    if (c == v || fronts.count(c) == 0) continue;
    cut(edge_of(c, v));
    goes_on = true;
    if (starts.count(c) == 0) fronts.erase(c);
  }
  if (!goes_on && fronts.count(v) == 0) starts.insert(v);
  fronts.insert(v);
}

std::int32_t SurfaceTrace::vertex_at(const Passing& p, const std::vector<int>& of) {
  const Vec3 normal = to_reference(s_, of[0], p.normal);
  const auto [a, b] = p.edge;
  std::int32_t v = p.place < 0.5 ? a : b;
  const auto& x = s_.vertices.reference;
  const Vec3 point = (1 - p.place) * x[a] + p.place * x[b];
  if (may_split(s_, p.edge, p.place, of)) {
    const Vec3 before = (1 - p.place) * at_before(a) + p.place * at_before(b);
    v = split_edge(s_, edges_, p.edge, p.place, origin_);
    before_of_new_.push_back(before);
    split_any_ = true;
  }
  s_.stroke[v] = stroke_;
  s_.blade_normal[v] = normal;
  s_.blade_point[v] = point;
  touched_.insert(v);
  return v;
}

void SurfaceTrace::cut(const Edge& e) {
  const std::vector<int> of = edges_.of(e);
  if (of.size() != 2 || s_.cut_edges.count(e) != 0) return;
  if (would_be_alone(of[0], e) || would_be_alone(of[1], e)) return;
  s_.cut_edges.insert(e);
  fresh_.push_back(e);
}

/// Whether a triangle hangs on by this edge alone: it stays with the neighbour there.
bool SurfaceTrace::would_be_alone(int t, const Edge& last) const {
  const Triangle& c = s_.triangles[t];
  for (int i = 0; i < 3; ++i) {
    const Edge e = edge_of(c[i], c[(i + 1) % 3]);
    if (e != last && s_.cut_edges.count(e) == 0 && edges_.of(e).size() > 1) return false;
  }
  return true;
}

bool SurfaceTrace::is_parted_by_blades(const Edge& e, const std::vector<int>& of) const {
  Vec3 then[2], now[2], reference[2];
  for (int k = 0; k < 2; ++k) {
    then[k] = now[k] = reference[k] = Vec3::Zero();
    for (const std::int32_t v : s_.triangles[of[k]]) {
      then[k] += at_before(v) / 3;
      now[k] += s_.vertices.position(v) / 3;
      reference[k] += s_.vertices.reference[v] / 3;
    }
  }
  const MovingSegment whole = {then[0], then[1], now[0], now[1]};
  for (const SweepPart& part : parts_) {
    if (is_aside(whole, part.box)) continue;
    const MovingSegment link = whole.during(part.begin, part.end);
    for (const SweptEdge& edge : part.edges) {
      if (!stays_aside(edge, link) && edge_passes<Vec3>(edge, link)) return true;
    }
  }
  if (s_.stroke[e[0]] == stroke_ && s_.stroke[e[1]] == stroke_) return false;
  const MovingSegment still = {reference[0], reference[1], reference[0], reference[1]};
  for (const auto& w : s_.wounds) {
    if (edge_passes<Vec3>(MovingSegment{w[0], w[1], w[2], w[3]}, still)) return true;
  }
  return false;
}

void SurfaceTrace::join_strokes() {
  std::vector<Edge> asked;
  for (const auto& [e, of] : edges_.all()) {
    if (of.size() != 2 || s_.cut_edges.count(e) != 0) continue;
    if (touched_.count(e[0]) + touched_.count(e[1]) == 0) continue;
    if (s_.stroke[e[0]] >= 0 && s_.stroke[e[1]] >= 0) asked.push_back(e);
  }
  for (const Edge& e : asked) {
    if (is_parted_by_blades(e, edges_.of(e))) cut(e);
  }
}

}  // namespace pbd
}  // namespace tissue_sim
