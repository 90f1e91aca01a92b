// Stabilisation of cells that are not full.
//
// At the rim of a body and along a cut a cell may hold fewer than eight points, and nodes that one
// or two points see can then move without any strain at them: a point would hang loose from its
// neighbours. Of the 27 numbers (A, d, B along each axis) that a component of the displacement has
// in a cell, four belong to motions that vary linearly, and strain there is what the points resist.
// The other 23 get a small stiffness, kStabilisation mu V with the volume V of the cell's points,
// each weighed to count like a strain (A 1, d 1/2, B 1/4 along each axis). Linear fields, rotation
// and translation among them, stay free; smooth ones feel it at second order in the cell size.
#pragma once

#include "mpm/block_passes.h"

namespace tissue_sim {

inline constexpr float kStabilisation = 0.01f;

namespace stabilisation {

/// Squared weight of A, d, B along one axis.
inline constexpr float kWeight2[3] = {1.0f, 0.25f, 0.0625f};
/// Kinds (0 A, 1 d, 2 B) along x and y of an XyQuantity.
inline constexpr int kKinds[kXyCount][2] = {{0, 0}, {0, 1}, {0, 2}, {1, 0}, {1, 1},
                                            {1, 2}, {2, 0}, {2, 1}, {2, 2}};

/// Squared weight of the number with XyQuantity k and kind z along z; 0 for those of linear fields.
inline constexpr float weight2(int k, int z) {
  return kKinds[k][0] + kKinds[k][1] + z <= 1
             ? 0.0f
             : kWeight2[kKinds[k][0]] * kWeight2[kKinds[k][1]] * kWeight2[z];
}

}  // namespace stabilisation

/// Adds the stabilising force of one component to the outgoing x-y quantities; `stiffness` is
/// kStabilisation mu V per lane. Returns twice the energy.
template <int W>
TISSUE_SIM_INLINE Vec<W> stabilise(const float* q0, const float* q1, const float* q2, int stride,
                                   Vec<W> stiffness, int out_stride, float* out0, float* out1,
                                   float* out2) {
  Vec<W> energy = stiffness * 0.0f;
  for (int k = 0; k < kXyCount; ++k) {
    const Line<Vec<W>> l(load<W>(q0 + k * stride), load<W>(q1 + k * stride),
                         load<W>(q2 + k * stride));
    const Vec<W> a = stabilisation::weight2(k, 0) * stiffness * l.A;
    const Vec<W> d = stabilisation::weight2(k, 1) * stiffness * l.d;
    const Vec<W> b = stabilisation::weight2(k, 2) * stiffness * l.B;
    energy += a * l.A + d * l.d + b * l.B;
    if (out0 == nullptr) continue;
    float* o = out0 + k * out_stride;
    store<W>(o, load<W>(o) + kAverageSide * a - d + b);
    o = out1 + k * out_stride;
    store<W>(o, load<W>(o) + kAverageCenter * a - 2.0f * b);
    o = out2 + k * out_stride;
    store<W>(o, load<W>(o) + kAverageSide * a + d + b);
  }
  return energy;
}

}  // namespace tissue_sim
