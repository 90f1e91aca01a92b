#include "pbd/surface_mesh.h"

#include <cmath>

namespace tissue_sim {
namespace pbd {
namespace {

/// A new vertex keeps this share of the mesh's mean edge, and of its own edge, off the ends and off
/// the corners opposite.
constexpr double kLeastLength = 0.12, kLeastShare = 0.15;
/// Triangles that a new vertex makes have no smaller angle [rad]: 5 degrees.
constexpr double kLeastAngle = 0.0873;

}  // namespace

double smallest_angle(const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 n = (b - a).cross(c - a);
  const double area2 = n.norm();
  double least = 4;
  const Vec3* p[3] = {&a, &b, &c};
  for (int i = 0; i < 3; ++i) {
    const double cosine = (*p[(i + 1) % 3] - *p[i]).dot(*p[(i + 2) % 3] - *p[i]);
    least = std::min(least, std::atan2(area2, cosine));
  }
  return least;
}

bool may_split(const State& s, const Edge& e, double place, const std::vector<int>& of) {
  const auto& x = s.vertices.reference;
  const Vec3 &a = x[e[0]], &b = x[e[1]];
  const double shortest = kLeastLength * s.mean_edge;
  if (std::min(place, 1 - place) < std::max(kLeastShare, shortest / (a - b).norm())) return false;
  const Vec3 at = a + place * (b - a);
  for (const int t : of) {
    for (const std::int32_t v : s.triangles[t]) {
      if (v == e[0] || v == e[1]) continue;
      if ((x[v] - at).norm() < shortest) return false;
      if (std::min(smallest_angle(a, at, x[v]), smallest_angle(at, b, x[v])) < kLeastAngle) {
        return false;
      }
    }
  }
  return true;
}

std::int32_t split_edge(State& s, EdgeMap& edges, const Edge& e, double place,
                        std::vector<std::int32_t>& origin) {
  const auto [a, b] = e;
  Vertices& v = s.vertices;
  const Vec3 at = (1 - place) * v.reference[a] + place * v.reference[b];
  const std::int32_t n = add_vertex(s, at, v.body[a]);
  origin.push_back(place < 0.5 ? a : b);
  const auto mix = static_cast<float>(place);
  for (Array<float>* x : {&v.x, &v.moved, &v.v}) {
    for (int i = 0; i < 3; ++i)
      (*x)[4 * n + i] = (1 - mix) * (*x)[4 * a + i] + mix * (*x)[4 * b + i];
  }
  v.anchored[n] = v.anchored[a] != 0 && v.anchored[b] != 0 ? 1 : 0;
  v.surface[n] = 1;
  s.half_depth[n] = (1 - place) * s.half_depth[a] + place * s.half_depth[b];
  for (const int t : edges.of(e)) {
    edges.remove(t);
    Triangle second = s.triangles[t];
    for (std::int32_t& c : s.triangles[t]) c = c == b ? n : c;
    for (std::int32_t& c : second) c = c == a ? n : c;
    edges.add(t);
    s.triangles.push_back(second);
    s.cut.push_back(std::uint8_t{s.cut[t]});
    edges.add(static_cast<int>(s.triangles.size()) - 1);
  }
  if (s.cut_edges.erase(e) > 0) {
    s.cut_edges.insert(edge_of(a, n));
    s.cut_edges.insert(edge_of(b, n));
  }
  return n;
}

}  // namespace pbd
}  // namespace tissue_sim
