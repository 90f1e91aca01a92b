// The transfers between the nodes and the points of a block, direction by direction: x and y within
// a node plane, then z between three planes, and the transpose for the forces. See docs/design.md.
#pragma once

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

/// x-y pass of one component on one node plane: u[plane] -> q[kXyCount][stride].
template <int W, bool bend_bend>
TISSUE_SIM_INLINE void xy_pass(const float* u, int pitch, int stride, float* q) {
  for (int j = 0; j < stride; j += W) {
    const float* p = u + j;
    const Line<Vec<W>> r0(load<W>(p), load<W>(p + 1), load<W>(p + 2));
    p += pitch;
    const Line<Vec<W>> r1(load<W>(p), load<W>(p + 1), load<W>(p + 2));
    p += pitch;
    const Line<Vec<W>> r2(load<W>(p), load<W>(p + 1), load<W>(p + 2));
    const Line<Vec<W>> a(r0.A, r1.A, r2.A), d(r0.d, r1.d, r2.d), b(r0.B, r1.B, r2.B);
    float* out = q + j;
    store<W>(out + kAA * stride, a.A);
    store<W>(out + kAd * stride, a.d);
    store<W>(out + kAB * stride, a.B);
    store<W>(out + kdA * stride, d.A);
    store<W>(out + kdd * stride, d.d);
    store<W>(out + kdB * stride, d.B);
    store<W>(out + kBA * stride, b.A);
    store<W>(out + kBd * stride, b.d);
    if (bend_bend) store<W>(out + kBB * stride, b.B);
  }
}

/// z pass and points: gradient of one component at the 8 points of W cells. `q0`, `q1`, `q2` are
/// the x-y quantities of the node planes below, at and above, `stride` floats apart. The result
/// goes to G[point][9], rows `3 * component` on; point = sx + 2 sy + 4 sz.
template <int W>
TISSUE_SIM_INLINE void gradient(const float* q0, const float* q1, const float* q2, int stride,
                                int component, Vec<W> (*G)[9]) {
  using V = Vec<W>;
  V w[2][kStressXyCount], s[2][kStressXyCount];  // values and slopes along z at the two points
  for (int k = 0; k < kStressXyCount; ++k) {
    const V minus = load<W>(q0 + k * stride), center = load<W>(q1 + k * stride),
            plus = load<W>(q2 + k * stride);
    const Line<V> l(minus, center, plus);
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

/// Transpose of xy_pass(): q[kXyCount] (each preceded by at least 2 * pitch zeros and followed by
/// zeros) -> force of `count` nodes, times `scale`. `row` holds 3 lines of `row_stride`, of which
/// the first kLanes floats are zero.
template <int W, bool bend_bend>
TISSUE_SIM_INLINE void xy_transpose(const float* q, int q_stride, int pitch, int count, float scale,
                                    float* row, int row_stride, float* force) {
  float* ta = row + 16;
  float* td = ta + row_stride;
  float* tb = td + row_stride;
  for (int m = 0; m < count; m += W) {
    const auto at = [q, q_stride, m](XyQuantity k, int back) {
      return q + k * q_stride + m - back;
    };
    const int p = pitch, pp = 2 * pitch;
    const Vec<W> aa0 = load<W>(at(kAA, 0)), aa1 = load<W>(at(kAA, p)), aa2 = load<W>(at(kAA, pp));
    const Vec<W> ad0 = load<W>(at(kAd, 0)), ad2 = load<W>(at(kAd, pp));
    const Vec<W> ab0 = load<W>(at(kAB, 0)), ab1 = load<W>(at(kAB, p)), ab2 = load<W>(at(kAB, pp));
    store<W>(ta + m, kAverageSide * (aa0 + aa2) + kAverageCenter * aa1 + (ad2 - ad0) + (ab0 + ab2) -
                         2.0f * ab1);
    const Vec<W> da0 = load<W>(at(kdA, 0)), da1 = load<W>(at(kdA, p)), da2 = load<W>(at(kdA, pp));
    const Vec<W> dd0 = load<W>(at(kdd, 0)), dd2 = load<W>(at(kdd, pp));
    const Vec<W> db0 = load<W>(at(kdB, 0)), db1 = load<W>(at(kdB, p)), db2 = load<W>(at(kdB, pp));
    store<W>(td + m, kAverageSide * (da0 + da2) + kAverageCenter * da1 + (dd2 - dd0) + (db0 + db2) -
                         2.0f * db1);
    const Vec<W> ba0 = load<W>(at(kBA, 0)), ba1 = load<W>(at(kBA, p)), ba2 = load<W>(at(kBA, pp));
    const Vec<W> bd0 = load<W>(at(kBd, 0)), bd2 = load<W>(at(kBd, pp));
    Vec<W> b = kAverageSide * (ba0 + ba2) + kAverageCenter * ba1 + (bd2 - bd0);
    if (bend_bend) {
      b += load<W>(at(kBB, 0)) + load<W>(at(kBB, pp)) - 2.0f * load<W>(at(kBB, p));
    }
    store<W>(tb + m, b);
  }
  for (int n = 0; n < count; n += W) {
    const Vec<W> a0 = load<W>(ta + n), a1 = load<W>(ta + n - 1), a2 = load<W>(ta + n - 2);
    const Vec<W> d0 = load<W>(td + n), d2 = load<W>(td + n - 2);
    const Vec<W> b0 = load<W>(tb + n), b1 = load<W>(tb + n - 1), b2 = load<W>(tb + n - 2);
    store<W>(force + n, scale * (kAverageSide * (a0 + a2) + kAverageCenter * a1 + (d2 - d0) +
                                 (b0 + b2) - 2.0f * b1));
  }
}

}  // namespace tissue_sim
