#include "cutting/blade_sweep.h"

#include <algorithm>
#include <cmath>

namespace tissue_sim {
namespace {

Box box_of(const std::vector<SweptEdge>& segments) {
  Box box;
  for (const SweptEdge& s : segments) {
    for (const Vec3* v : {&s.a0, &s.b0, &s.a1, &s.b1}) {
      box.min = box.min.cwiseMin(*v);
      box.max = box.max.cwiseMax(*v);
    }
  }
  return box;
}

/// How many parts the way from p to q is swept in, each so short that the edge hardly turns.
int parts_between(const Pose& p, const Pose& q) {
  constexpr double kMaxTurn = 0.07;  // [rad]
  return 1 + static_cast<int>(p.orientation.angularDistance(q.orientation) / kMaxTurn);
}

}  // namespace

SweptEdge swept(const MovingSegment& edge) {
  SweptEdge result;
  static_cast<MovingSegment&>(result) = edge;
  const Vec3 along = (edge.b0 - edge.a0 + edge.b1 - edge.a1).stableNormalized();
  Vec3 normal = (edge.b1 - edge.a0).cross(edge.a1 - edge.b0).stableNormalized();
  if (normal.isZero()) normal = along.unitOrthogonal();  // a blade that is held still
  const Vec3 axes[3] = {normal, along, normal.cross(along)};
  for (int i = 0; i < 3; ++i) {
    Slab& slab = result.slabs[i];
    slab.axis = axes[i];
    for (const Vec3* corner : {&edge.a0, &edge.b0, &edge.a1, &edge.b1}) {
      slab.low = std::min(slab.low, slab.axis.dot(*corner));
      slab.high = std::max(slab.high, slab.axis.dot(*corner));
    }
    slab.low -= 1e-9;  // rounding
    slab.high += 1e-9;
  }
  return result;
}

double swept_edges(const BladePath& path) {
  double parts = 0;
  for (std::size_t i = 0; i + 1 < path.poses.size(); ++i) {
    parts += parts_between(path.poses[i], path.poses[i + 1]);
  }
  return parts * (static_cast<double>(path.edge.size()) - 1);
}

std::vector<SweepPart> sweep_parts(const BladePath& path) {
  const Vec3 aside(1.31e-9, 1.73e-9, 0.97e-9);
  std::vector<SweepPart> parts;
  const double spans = static_cast<double>(path.poses.size()) - 1;
  for (std::size_t i = 0; i + 1 < path.poses.size(); ++i) {
    const Pose &p = path.poses[i], &q = path.poses[i + 1];
    const int n = parts_between(p, q);
    const auto edge_at = [&](double share, std::size_t j) -> Vec3 {
      if (path.edge_at_end.empty()) return path.edge[j];
      return (1 - share) * path.edge[j] + share * path.edge_at_end[j];
    };
    const auto at = [&](int k) {
      if (k == 0) return p;
      if (k == n) return q;
      const double s = static_cast<double>(k) / n;
      return Pose{(1 - s) * p.position + s * q.position, p.orientation.slerp(s, q.orientation)};
    };
    for (int k = 0; k < n; ++k) {
      const Pose from = at(k), to = at(k + 1);
      SweepPart part;
      part.begin = (i + static_cast<double>(k) / n) / spans;
      part.end = (i + static_cast<double>(k + 1) / n) / spans;
      for (std::size_t j = 0; j + 1 < path.edge.size(); ++j) {
        const double b = part.begin, e = part.end;
        part.edges.push_back(swept({from * edge_at(b, j) + aside, from * edge_at(b, j + 1) + aside,
                                    to * edge_at(e, j) + aside, to * edge_at(e, j + 1) + aside}));
      }
      part.box = box_of(part.edges);
      parts.push_back(std::move(part));
    }
  }
  return parts;
}

}  // namespace tissue_sim
