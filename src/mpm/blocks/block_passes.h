// The transfers between the nodes and the points of a block, direction by direction: x and y within
// a node plane, then z between three planes, and the transpose for the forces. See docs/mpm.md.
#pragma once

#include <algorithm>
#include <array>
#include <type_traits>

#include "compute/simd.h"
#include "math/bspline.h"

namespace tissue_sim {

/// What the x-y pass leaves of a node plane for each cell: the first letter is applied along x, the
/// second along y (A average, d difference, B bend: math/bspline.h).
/// The stress needs all but BB, which only stabilisation uses.
enum XyQuantity {
  kAA,
  kAd,
  kAB,
  kdA,
  kdd,
  kdB,
  kBA,
  kBd,
  kStressXyCount,
  kBB = kStressXyCount,
  kXyCount
};

/// A, d, B of three values.
template <class T>
struct Line {
  T A, d, B;
  TISSUE_SIM_INLINE Line(T minus, T center, T plus) {
    const T s = plus + minus;
    A = kAverageSide * s + kAverageCenter * center;
    d = plus - minus;
    B = s - 2.0f * center;
  }
};

/// Calls f(width, j) for the steps that cover `count` lanes: W wide, but the last half as wide
/// where that is enough.
template <int W, class F>
TISSUE_SIM_INLINE void for_each_vector(int count, const F& f) {
  constexpr int half = W > 4 ? W / 2 : W;
  int j = 0;
  for (; count - j > (W > 4 ? half : 0); j += W) f(std::integral_constant<int, W>(), j);
  if (j < count) f(std::integral_constant<int, half>(), j);
}

/// Calls f(width, j, whole) for the steps that cover lanes in `spans`, in order, each lane once: W
/// wide or half of it, from multiples of the half on. Lanes in none are left out where a step has
/// no other: `whole` says that it has none of them.
template <int W, class Spans, class F>
TISSUE_SIM_INLINE void for_each_filled(const Spans& spans, const F& f) {
  constexpr int half = W > 4 ? W / 2 : W;
  int j = 0;
  for (auto span = spans.begin(); span != spans.end(); ++span) {
    for (j = std::max(j, span->begin / half * half); j < span->end;) {
      const auto next = span + 1;
      const bool wide = span->end > j + half ||
                        (next != spans.end() && next->begin < j + W && next->end > j + half);
      if (W > 4 && wide) {
        f(std::integral_constant<int, W>(), j, span->begin <= j && j + W <= span->end);
        j += W;
      } else {
        f(std::integral_constant<int, half>(), j, span->begin <= j && j + half <= span->end);
        j += half;
      }
    }
  }
}

/// Whether these steps cover the lanes 0 .. count - 1.
template <int W, class Spans>
TISSUE_SIM_INLINE bool covers_all(const Spans& spans, int count) {
  int end = 0;
  bool any_gap = false;
  for_each_filled<W>(spans, [&](auto width, int j, bool) TISSUE_SIM_INLINE_LAMBDA {
    any_gap = any_gap || j != end;
    end = j + width;
  });
  return !any_gap && end >= count;
}

/// x-y pass of one component for W cells: u, at the first one's lowest node of a node plane, ->
/// q[kStressXyCount][stride].
template <int W>
TISSUE_SIM_INLINE void xy_pass(const float* u, int pitch, int stride, float* q) {
  const Line<Vec<W>> r0(load<W>(u), load<W>(u + 1), load<W>(u + 2));
  u += pitch;
  const Line<Vec<W>> r1(load<W>(u), load<W>(u + 1), load<W>(u + 2));
  u += pitch;
  const Line<Vec<W>> r2(load<W>(u), load<W>(u + 1), load<W>(u + 2));
  const Line<Vec<W>> a(r0.A, r1.A, r2.A), d(r0.d, r1.d, r2.d), b(r0.B, r1.B, r2.B);
  store<W>(q + kAA * stride, a.A);
  store<W>(q + kAd * stride, a.d);
  store<W>(q + kAB * stride, a.B);
  store<W>(q + kdA * stride, d.A);
  store<W>(q + kdd * stride, d.d);
  store<W>(q + kdB * stride, d.B);
  store<W>(q + kBA * stride, b.A);
  store<W>(q + kBd * stride, b.d);
}

/// What values at the points need of the x-y pass.
enum ValueQuantity { kValueAA, kValueAd, kValuedA, kValuedd, kValueXyCount };

/// The same for these quantities alone.
template <int W>
TISSUE_SIM_INLINE void value_xy_pass(const float* u, int pitch, int stride, float* q) {
  const Line<Vec<W>> r0(load<W>(u), load<W>(u + 1), load<W>(u + 2));
  u += pitch;
  const Line<Vec<W>> r1(load<W>(u), load<W>(u + 1), load<W>(u + 2));
  u += pitch;
  const Line<Vec<W>> r2(load<W>(u), load<W>(u + 1), load<W>(u + 2));
  const Line<Vec<W>> a(r0.A, r1.A, r2.A), d(r0.d, r1.d, r2.d);
  store<W>(q + kValueAA * stride, a.A);
  store<W>(q + kValueAd * stride, a.d);
  store<W>(q + kValuedA * stride, d.A);
  store<W>(q + kValuedd * stride, d.d);
}

/// What a cell's mean gradient needs of the x-y pass.
enum MeanQuantity { kMeanAA, kMeanAd, kMeandA, kMeanXyCount };

/// The same for these quantities alone.
template <int W>
TISSUE_SIM_INLINE void mean_xy_pass(const float* u, int pitch, int stride, float* q) {
  const Line<Vec<W>> r0(load<W>(u), load<W>(u + 1), load<W>(u + 2));
  u += pitch;
  const Line<Vec<W>> r1(load<W>(u), load<W>(u + 1), load<W>(u + 2));
  u += pitch;
  const Line<Vec<W>> r2(load<W>(u), load<W>(u + 1), load<W>(u + 2));
  const Line<Vec<W>> a(r0.A, r1.A, r2.A);
  store<W>(q + kMeanAA * stride, a.A);
  store<W>(q + kMeanAd * stride, a.d);
  store<W>(q + kMeandA * stride, kAverageSide * (r0.d + r2.d) + kAverageCenter * r1.d);
}

/// Mean gradient of one component over the eight places of a cell's points, from its AA, Ad and dA
/// on three node planes; to the row `3 * component` of G[9].
template <int W>
TISSUE_SIM_INLINE void mean_gradient(const std::array<const float*, 3>& AA,
                                     const std::array<const float*, 3>& Ad,
                                     const std::array<const float*, 3>& dA, int component,
                                     Vec<W>* G) {
  const auto average = [](const std::array<const float*, 3>& q) TISSUE_SIM_INLINE_LAMBDA {
    return (0.5f * kAverageSide) * (load<W>(q[0]) + load<W>(q[2])) +
           (0.5f * kAverageCenter) * load<W>(q[1]);
  };
  G[3 * component] = average(dA);
  G[3 * component + 1] = average(Ad);
  G[3 * component + 2] = 0.5f * (load<W>(AA[2]) - load<W>(AA[0]));
}

/// z pass and points: gradient of one component at the 8 points of W cells. `q0`, `q1`, `q2` are
/// the x-y quantities of the node planes below, at and above, `stride` floats apart. The result
/// goes to G[point][9], rows `3 * component` on; point = sx + 2 sy + 4 sz. With `some` it is 0 in
/// lanes that do not hold points.
template <int W, bool some = false>
TISSUE_SIM_INLINE void gradient(const float* q0, const float* q1, const float* q2, int stride,
                                int component, Vec<W> (*G)[9], Mask<W> holds = Mask<W>{}) {
  using V = Vec<W>;
  V w[2][kStressXyCount], s[2][kStressXyCount];  // values and slopes along z at the two points
  for (int k = 0; k < kStressXyCount; ++k) {
    const V minus = load<W>(q0 + k * stride), center = load<W>(q1 + k * stride),
            plus = load<W>(q2 + k * stride);
    Line<V> l(minus, center, plus);
    if (some) l.A = keep<W>(holds, l.A), l.d = keep<W>(holds, l.d), l.B = keep<W>(holds, l.B);
    if (k != kAA) {
      w[0][k] = l.A - 0.125f * l.d;
      w[1][k] = l.A + 0.125f * l.d;
    }
    if (k == kAA || k == kAd || k == kdA || k == kdd) {
      s[0][k] = 0.5f * l.d - 0.25f * l.B;
      s[1][k] = 0.5f * l.d + 0.25f * l.B;
    }
  }
  for (int sz = 0; sz < 2; ++sz) {
    for (int t = 0; t < 2; ++t) {
      const float eighth = t == 0 ? -0.125f : 0.125f;
      {  // d/dx of the row of points sy = t
        const V d = w[sz][kdA] + eighth * w[sz][kdd], b = w[sz][kBA] + eighth * w[sz][kBd];
        G[4 * sz + 2 * t][3 * component] = 0.5f * d - 0.25f * b;
        G[4 * sz + 2 * t + 1][3 * component] = 0.5f * d + 0.25f * b;
      }
      {  // d/dy of the column of points sx = t
        const V d = w[sz][kAd] + eighth * w[sz][kdd], b = w[sz][kAB] + eighth * w[sz][kdB];
        G[4 * sz + t][3 * component + 1] = 0.5f * d - 0.25f * b;
        G[4 * sz + t + 2][3 * component + 1] = 0.5f * d + 0.25f * b;
      }
      {  // d/dz of the column of points sx = t
        const V a = s[sz][kAA] + eighth * s[sz][kdA], d = s[sz][kAd] + eighth * s[sz][kdd];
        G[4 * sz + t][3 * component + 2] = a - 0.125f * d;
        G[4 * sz + t + 2][3 * component + 2] = a + 0.125f * d;
      }
    }
  }
}

/// Transpose of gradient(): adds what P[point][3 * component ...] gives to the x-y quantities of
/// the three node planes. `q2` is written, not added to, for this is the first that reaches it.
template <int W>
TISSUE_SIM_INLINE void add_divergence(const Vec<W> (*P)[9], int component, int stride, float* q0,
                                      float* q1, float* q2) {
  using V = Vec<W>;
  V w[2][kStressXyCount], s[2][kStressXyCount];
  for (int sz = 0; sz < 2; ++sz) {
    V xd[2], xb[2], yd[2], yb[2], za[2], zd[2];
    for (int t = 0; t < 2; ++t) {
      const V x0 = P[4 * sz + 2 * t][3 * component], x1 = P[4 * sz + 2 * t + 1][3 * component];
      xd[t] = 0.5f * (x1 + x0);
      xb[t] = 0.25f * (x1 - x0);
      const V y0 = P[4 * sz + t][3 * component + 1], y1 = P[4 * sz + t + 2][3 * component + 1];
      yd[t] = 0.5f * (y1 + y0);
      yb[t] = 0.25f * (y1 - y0);
      const V z0 = P[4 * sz + t][3 * component + 2], z1 = P[4 * sz + t + 2][3 * component + 2];
      za[t] = z1 + z0;
      zd[t] = 0.125f * (z1 - z0);
    }
    w[sz][kdA] = xd[1] + xd[0];
    w[sz][kBA] = xb[1] + xb[0];
    w[sz][kBd] = 0.125f * (xb[1] - xb[0]);
    w[sz][kAd] = yd[1] + yd[0];
    w[sz][kAB] = yb[1] + yb[0];
    w[sz][kdB] = 0.125f * (yb[1] - yb[0]);
    w[sz][kdd] = 0.125f * ((xd[1] - xd[0]) + (yd[1] - yd[0]));
    s[sz][kAA] = za[1] + za[0];
    s[sz][kdA] = 0.125f * (za[1] - za[0]);
    s[sz][kAd] = zd[1] + zd[0];
    s[sz][kdd] = 0.125f * (zd[1] - zd[0]);
  }
  for (int k = 0; k < kStressXyCount; ++k) {
    const bool slope = k == kAA || k == kAd || k == kdA || k == kdd;
    V minus, center, plus;
    if (k == kAA) {
      const V d = 0.5f * (s[1][k] + s[0][k]), b = 0.25f * (s[1][k] - s[0][k]);
      minus = b - d;
      center = -2.0f * b;
      plus = b + d;
    } else {
      const V a = w[1][k] + w[0][k];
      V d = 0.125f * (w[1][k] - w[0][k]);
      minus = kAverageSide * a;
      center = kAverageCenter * a;
      plus = minus;
      if (slope) {
        d += 0.5f * (s[1][k] + s[0][k]);
        const V b = 0.25f * (s[1][k] - s[0][k]);
        minus += b;
        plus += b;
        center -= 2.0f * b;
      }
      minus -= d;
      plus += d;
    }
    store<W>(q0 + k * stride, load<W>(q0 + k * stride) + minus);
    store<W>(q1 + k * stride, load<W>(q1 + k * stride) + center);
    store<W>(q2 + k * stride, plus);
  }
}

/// Transpose of xy_pass(): adds what the q[kStressXyCount][stride] of a run of `count` cells gives
/// to the nodes m .. m + W - 1 of its three rows; `force` is at the run's lowest. What lies around
/// the run in `q` is read but does not count; nodes beyond the run get zeros added.
template <int W>
TISSUE_SIM_INLINE void xy_transpose(const float* q, int stride, int count, int m, int pitch,
                                    float* force) {
  const Mask<W> mask[3] = {lanes_between<W>(-m, count - m), lanes_between<W>(1 - m, count + 1 - m),
                           lanes_between<W>(2 - m, count + 2 - m)};
  const auto at = [q, stride, m](XyQuantity k, int back)
                      TISSUE_SIM_INLINE_LAMBDA { return load<W>(q + k * stride + m - back); };
  const auto sum = [&mask](Vec<W> first, Vec<W> middle, Vec<W> last) TISSUE_SIM_INLINE_LAMBDA {
    return keep<W>(mask[0], first) + keep<W>(mask[1], middle) + keep<W>(mask[2], last);
  };
  const Vec<W> A = sum(kAverageSide * at(kAA, 0) - at(kdA, 0) + at(kBA, 0),
                       kAverageCenter * at(kAA, 1) - 2.0f * at(kBA, 1),
                       kAverageSide * at(kAA, 2) + at(kdA, 2) + at(kBA, 2));
  const Vec<W> d = sum(kAverageSide * at(kAd, 0) - at(kdd, 0) + at(kBd, 0),
                       kAverageCenter * at(kAd, 1) - 2.0f * at(kBd, 1),
                       kAverageSide * at(kAd, 2) + at(kdd, 2) + at(kBd, 2));
  const Vec<W> B = sum(kAverageSide * at(kAB, 0) - at(kdB, 0), kAverageCenter * at(kAB, 1),
                       kAverageSide * at(kAB, 2) + at(kdB, 2));
  const Vec<W> sides = kAverageSide * A + B;
  float* row = force + m;
  store<W>(row, load<W>(row) + (sides - d));
  row += pitch;
  store<W>(row, load<W>(row) + (kAverageCenter * A - 2.0f * B));
  row += pitch;
  store<W>(row, load<W>(row) + (sides + d));
}

}  // namespace tissue_sim
