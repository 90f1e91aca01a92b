#include "cutting/blade_sweep.h"

#include <algorithm>
#include <cmath>

namespace tissue_sim {
namespace {

/// c[0] + c[1] s + c[2] s^2 + c[3] s^3.
double cubic(const double (&c)[4], double s) { return c[0] + s * (c[1] + s * (c[2] + s * c[3])); }

/// The root between lo, where the cubic is flo, and hi, where it has the other sign: Newton's
/// method, halving where that would leave the interval.
double root_between(const double (&c)[4], double lo, double flo, double hi, double fhi) {
  double s = lo - flo * (hi - lo) / (fhi - flo);
  for (int k = 0; k < 100; ++k) {
    const double f = cubic(c, s), slope = c[1] + s * (2 * c[2] + s * 3 * c[3]);
    ((f < 0) == (flo < 0) ? lo : hi) = s;
    double next = s - f / slope;
    if (std::fabs(next - s) < 1e-16) return next;
    if (!(next > lo && next < hi)) next = 0.5 * (lo + hi);
    s = next;
  }
  return s;
}

/// Roots in [0, 1] of a cubic, each between two turning points.
int cubic_roots(const double (&c)[4], double (&roots)[3]) {
  double cuts[4] = {0, 1, 1, 1};
  int n = 1;
  const double a = 3 * c[3], b = 2 * c[2], d = b * b - 4 * a * c[1];
  double turns[2];
  int turn_count = 0;
  if (std::fabs(a) < 1e-14 * (std::fabs(b) + std::fabs(c[1]))) {
    if (b != 0) turns[turn_count++] = -c[1] / b;
  } else if (d > 0) {
    const double q = -0.5 * (b + std::copysign(std::sqrt(d), b));
    turns[turn_count++] = q / a;
    if (q != 0) turns[turn_count++] = c[1] / q;
    if (turn_count == 2 && turns[0] > turns[1]) std::swap(turns[0], turns[1]);
  }
  for (int i = 0; i < turn_count; ++i) {
    if (turns[i] > 0 && turns[i] < 1) cuts[n++] = turns[i];
  }
  cuts[n] = 1;
  int count = 0;
  double flo = cubic(c, 0);
  for (int i = 0; i < n; ++i) {
    const double lo = cuts[i], hi = cuts[i + 1], fhi = cubic(c, hi);
    if (flo == 0) {
      roots[count++] = lo;
    } else if ((flo < 0) != (fhi < 0) || (fhi == 0 && i == n - 1)) {
      roots[count++] = root_between(c, lo, flo, hi, fhi);
    }
    flo = fhi;
  }
  return count;
}

/// Whether two coplanar segments cross, at u of the edge, with its margin, and t of the bond,
/// without.
bool segments_cross(const Vec3& a, const Vec3& b, const Vec3& p, const Vec3& q, double& u,
                    double& t) {
  const Vec3 e = b - a, f = q - p, n = e.cross(f);
  const double n2 = n.squaredNorm();
  if (n2 <= 1e-24 * e.squaredNorm() * f.squaredNorm()) return false;  // parallel: the edge grazes
  const Vec3 w = p - a;
  u = w.cross(f).dot(n) / n2;
  t = w.cross(e).dot(n) / n2;
  return u >= -1e-9 && u <= 1 + 1e-9 && t >= 0 && t <= 1;
}

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

bool edge_passes(const MovingSegment& e, const MovingSegment& b, Meeting* meeting) {
  for (int i = 0; i < 3; ++i) {
    if (std::max({e.a0[i], e.b0[i], e.a1[i], e.b1[i]}) <
            std::min({b.a0[i], b.b0[i], b.a1[i], b.b1[i]}) ||
        std::max({b.a0[i], b.b0[i], b.a1[i], b.b1[i]}) <
            std::min({e.a0[i], e.b0[i], e.a1[i], e.b1[i]})) {
      return false;
    }
  }
  // They can only meet while coplanar: (B - A) . ((P - A) x (Q - A)) = 0, a cubic in time.
  const Vec3 x0 = e.b0 - e.a0, y0 = b.a0 - e.a0, z0 = b.b0 - e.a0;
  const Vec3 x1 = e.b1 - e.a1 - x0, y1 = b.a1 - e.a1 - y0, z1 = b.b1 - e.a1 - z0;
  const Vec3 yz0 = y0.cross(z0), yz1 = y1.cross(z0) + y0.cross(z1), yz2 = y1.cross(z1);
  const double c[4] = {x0.dot(yz0), x1.dot(yz0) + x0.dot(yz1), x1.dot(yz1) + x0.dot(yz2),
                       x1.dot(yz2)};
  double roots[3];
  const int count = cubic_roots(c, roots);
  for (int i = 0; i < count; ++i) {
    const double s = roots[i];
    const Vec3 edge = e.b0 + s * (e.b1 - e.b0) - e.a0 - s * (e.a1 - e.a0);
    const Vec3 a = e.a0 + s * (e.a1 - e.a0);
    double u, t;
    if (!segments_cross(a, a + edge, b.a0 + s * (b.a1 - b.a0), b.b0 + s * (b.b1 - b.b0), u, t)) {
      continue;
    }
    if (meeting != nullptr) {
      const Vec3 moved = e.a1 - e.a0 + u * (e.b1 - e.b0 - (e.a1 - e.a0)) - (b.a1 - b.a0) -
                         t * (b.b1 - b.b0 - (b.a1 - b.a0));
      *meeting = {t, edge.cross(moved)};
    }
    return true;
  }
  return false;
}

std::vector<SweepPart> sweep_parts(const BladePath& path) {
  constexpr double kMaxTurn = 0.07;  // [rad]
  const Vec3 aside(1.31e-9, 1.73e-9, 0.97e-9);
  std::vector<SweepPart> parts;
  const double spans = static_cast<double>(path.poses.size()) - 1;
  for (std::size_t i = 0; i + 1 < path.poses.size(); ++i) {
    const Pose &p = path.poses[i], &q = path.poses[i + 1];
    const int n = 1 + static_cast<int>(p.orientation.angularDistance(q.orientation) / kMaxTurn);
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
        part.edges.push_back(swept({from * path.edge[j] + aside, from * path.edge[j + 1] + aside,
                                    to * path.edge[j] + aside, to * path.edge[j + 1] + aside}));
      }
      part.box = box_of(part.edges);
      parts.push_back(std::move(part));
    }
  }
  return parts;
}

}  // namespace tissue_sim
