// Does a moving edge pass through a moving bond? Both are segments whose ends move linearly over
// the same interval, so nothing slips through, however the tissue gives way. The same on the CPU,
// with V = Vec3, and on the GPU, with V = Vector3.
#pragma once

#include <cmath>

#include "compute/host_device.h"

namespace tissue_sim {

/// Three coordinates, with Eigen's names for what is done with them.
struct Vector3 {
  double of[3];

  Vector3() = default;
  TISSUE_SIM_INLINE Vector3(double x, double y, double z) : of{x, y, z} {}
  TISSUE_SIM_INLINE double operator[](int i) const { return of[i]; }
  TISSUE_SIM_INLINE Vector3 operator+(const Vector3& b) const {
    return {of[0] + b[0], of[1] + b[1], of[2] + b[2]};
  }
  TISSUE_SIM_INLINE Vector3 operator-(const Vector3& b) const {
    return {of[0] - b[0], of[1] - b[1], of[2] - b[2]};
  }
  TISSUE_SIM_INLINE friend Vector3 operator*(double s, const Vector3& a) {
    return {s * a[0], s * a[1], s * a[2]};
  }
  TISSUE_SIM_INLINE double dot(const Vector3& b) const {
    return of[0] * b[0] + of[1] * b[1] + of[2] * b[2];
  }
  TISSUE_SIM_INLINE Vector3 cross(const Vector3& b) const {
    return {of[1] * b[2] - of[2] * b[1], of[2] * b[0] - of[0] * b[2], of[0] * b[1] - of[1] * b[0]};
  }
  TISSUE_SIM_INLINE double squaredNorm() const { return dot(*this); }
};

/// A segment whose ends move linearly from (a0, b0) to (a1, b1) [m].
template <class V>
struct SegmentOf {
  V a0, b0, a1, b1;

  /// From `begin` to `end` of the interval.
  TISSUE_SIM_INLINE SegmentOf during(double begin, double end) const {
    const V a = a1 - a0, b = b1 - b0;
    return {a0 + begin * a, b0 + begin * b, a0 + end * a, b0 + end * b};
  }
};

/// Between two planes across an axis.
template <class V>
struct SlabOf {
  V axis = V(0, 0, 0);              ///< unit; 0 where there is none
  double low = 1e30, high = -1e30;  ///< of axis . x [m]
};

/// What an edge sweeps lies within three slabs: across its surface (of an edge that is held still,
/// any along it), along the edge, along its motion.
template <class V>
struct SweptEdgeOf : SegmentOf<V> {
  SlabOf<V> slabs[3];
};

/// Whether all of the bond stays outside of what the edge sweeps, by more than `by` [m] along one
/// of its axes: cheap, and true for most.
template <class V>
TISSUE_SIM_INLINE bool stays_aside(const SweptEdgeOf<V>& e, const SegmentOf<V>& b, double by = 0) {
  for (const SlabOf<V>& slab : e.slabs) {
    const double a0 = slab.axis.dot(b.a0), b0 = slab.axis.dot(b.b0);
    const double a1 = slab.axis.dot(b.a1), b1 = slab.axis.dot(b.b1);
    const double high = slab.high + by, low = slab.low - by;
    if ((a0 > high && b0 > high && a1 > high && b1 > high) ||
        (a0 < low && b0 < low && a1 < low && b1 < low)) {
      return true;
    }
  }
  return false;
}

/// Where an edge meets a bond.
template <class V>
struct MeetingOf {
  double place = 0;       ///< along the bond, 0 to 1
  V normal = V(0, 0, 0);  ///< to what the edge sweeps past the bond, of any length; 0 if none
};

namespace sweep {

/// c[0] + c[1] s + c[2] s^2 + c[3] s^3.
TISSUE_SIM_INLINE double cubic(const double (&c)[4], double s) {
  return c[0] + s * (c[1] + s * (c[2] + s * c[3]));
}

/// The root between lo, where the cubic is flo, and hi, where it has the other sign: Newton's
/// method, halving where that would leave the interval.
TISSUE_SIM_HOST_DEVICE inline double root_between(const double (&c)[4], double lo, double flo,
                                                  double hi, double fhi) {
  double s = lo - flo * (hi - lo) / (fhi - flo);
  for (int k = 0; k < 100; ++k) {
    const double f = cubic(c, s), slope = c[1] + s * (2 * c[2] + s * 3 * c[3]);
    ((f < 0) == (flo < 0) ? lo : hi) = s;
    double next = s - f / slope;
    if (fabs(next - s) < 1e-12) return next;  // as near as rounding allows: steps fall by squares
    if (!(next > lo && next < hi)) next = 0.5 * (lo + hi);
    s = next;
  }
  return s;
}

/// Roots in [0, 1] of a cubic, each between two turning points.
TISSUE_SIM_HOST_DEVICE inline int cubic_roots(const double (&c)[4], double (&roots)[3]) {
  double cuts[4] = {0, 1, 1, 1};
  int n = 1;
  const double a = 3 * c[3], b = 2 * c[2], d = b * b - 4 * a * c[1];
  double turns[2];
  int turn_count = 0;
  if (fabs(a) < 1e-14 * (fabs(b) + fabs(c[1]))) {
    if (b != 0) turns[turn_count++] = -c[1] / b;
  } else if (d > 0) {
    const double q = -0.5 * (b + copysign(sqrt(d), b));
    const double one = q / a, other = q != 0 ? c[1] / q : one;
    turns[turn_count++] = fmin(one, other);
    if (q != 0) turns[turn_count++] = fmax(one, other);
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
template <class V>
TISSUE_SIM_INLINE bool segments_cross(const V& a, const V& b, const V& p, const V& q, double& u,
                                      double& t) {
  const V e = b - a, f = q - p, n = e.cross(f);
  const double n2 = n.squaredNorm();
  if (n2 <= 1e-24 * e.squaredNorm() * f.squaredNorm()) return false;  // parallel: the edge grazes
  const V w = p - a;
  u = w.cross(f).dot(n) / n2;
  t = w.cross(e).dot(n) / n2;
  return u >= -1e-9 && u <= 1 + 1e-9 && t >= 0 && t <= 1;
}

TISSUE_SIM_INLINE double lesser(double a, double b) { return a < b ? a : b; }
TISSUE_SIM_INLINE double larger(double a, double b) { return a > b ? a : b; }
/// Least and largest coordinate of a segment over the interval.
template <class V>
TISSUE_SIM_INLINE double least(const SegmentOf<V>& s, int i) {
  return lesser(lesser(s.a0[i], s.b0[i]), lesser(s.a1[i], s.b1[i]));
}
template <class V>
TISSUE_SIM_INLINE double largest(const SegmentOf<V>& s, int i) {
  return larger(larger(s.a0[i], s.b0[i]), larger(s.a1[i], s.b1[i]));
}

}  // namespace sweep

/// Whether the two segments meet at some moment of the interval, and where. The edge includes its
/// ends (with a margin of 1e-9 of its length, so that the pieces of a polyline leave no gap), the
/// bond its own.
template <class V>
TISSUE_SIM_HOST_DEVICE inline bool edge_passes(const SegmentOf<V>& e, const SegmentOf<V>& b,
                                               MeetingOf<V>* meeting = nullptr) {
  for (int i = 0; i < 3; ++i) {
    if (sweep::largest(e, i) < sweep::least(b, i) || sweep::largest(b, i) < sweep::least(e, i)) {
      return false;
    }
  }
  // They can only meet while coplanar: (B - A) . ((P - A) x (Q - A)) = 0, a cubic in time.
  const V x0 = e.b0 - e.a0, y0 = b.a0 - e.a0, z0 = b.b0 - e.a0;
  const V x1 = e.b1 - e.a1 - x0, y1 = b.a1 - e.a1 - y0, z1 = b.b1 - e.a1 - z0;
  const V yz0 = y0.cross(z0), yz1 = y1.cross(z0) + y0.cross(z1), yz2 = y1.cross(z1);
  const double c[4] = {x0.dot(yz0), x1.dot(yz0) + x0.dot(yz1), x1.dot(yz1) + x0.dot(yz2),
                       x1.dot(yz2)};
  double roots[3];
  const int count = sweep::cubic_roots(c, roots);
  for (int i = 0; i < count; ++i) {
    const double s = roots[i];
    const V edge = e.b0 + s * (e.b1 - e.b0) - e.a0 - s * (e.a1 - e.a0);
    const V a = e.a0 + s * (e.a1 - e.a0), end = a + edge;
    const V p = b.a0 + s * (b.a1 - b.a0), q = b.b0 + s * (b.b1 - b.b0);
    double u, t;
    if (!sweep::segments_cross(a, end, p, q, u, t)) continue;
    if (meeting != nullptr) {
      const V moved = e.a1 - e.a0 + u * (e.b1 - e.b0 - (e.a1 - e.a0)) - (b.a1 - b.a0) -
                      t * (b.b1 - b.b0 - (b.a1 - b.a0));
      meeting->place = t;
      meeting->normal = edge.cross(moved);
    }
    return true;
  }
  return false;
}

}  // namespace tissue_sim
