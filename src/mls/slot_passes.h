// The passes over pairs that stand in slots (mls/lanes.h), W nodes at a time. For kernels.cpp
// alone.
#pragma once

#include "mls/kernels.h"

namespace tissue_sim {
namespace mls_passes {

TISSUE_SIM_INLINE bool goes_by_slots(const MlsField& f, int chunk) {
  return f.slots[chunk].first < f.slots[chunk].end || !f.any_entries;
}

/// Displacements of a chunk into the rows, and velocities.
TISSUE_SIM_INLINE void spread(const MlsField& f, int chunk) {
  const auto rows_of = [&](const float* a, int row) {
    float* to = f.rows + row * f.stride + chunk * kMlsChunk;
    const float* from = a + 4 * kMlsChunk * static_cast<std::size_t>(chunk);
    for (int l = 0; l < kMlsChunk; ++l) {
      to[l] = from[4 * l];
      to[f.stride + l] = from[4 * l + 1];
      to[2 * f.stride + l] = from[4 * l + 2];
    }
  };
  if (!f.any_slots) return;
  rows_of(f.u, kMlsURow);
  if (f.viscous) rows_of(f.v, kMlsVRow);
}

/// Slots of W lanes from `lane` on.
template <int W>
TISSUE_SIM_INLINE void slots_of(const MlsField& f, int chunk, int lane, std::int32_t& begin,
                                std::int32_t& end) {
  const MlsSlots& s = f.slots[chunk];
  begin = W == kMlsChunk || lane < kMlsChunk / 2 ? s.first : s.both;
  end = W == kMlsChunk || lane >= kMlsChunk / 2 ? s.end : s.both_end;
}

/// sum_j w_ij (a_j - a_i) (x) r_ij of a chunk's nodes, a in three rows from `row` on: out[3 a + k].
template <int W>
TISSUE_SIM_INLINE void moments_of_slots(const MlsField& f, int row, int chunk,
                                        float (&out)[9][kMlsChunk]) {
  const std::size_t stride = f.stride;
  for (int lane = 0; lane < kMlsChunk; lane += W) {
    const float* own = f.rows + chunk * kMlsChunk + lane;
    const float* own_a = own + row * stride;
    Vec<W> m[9] = {};
    std::int32_t begin, end;
    slots_of<W>(f, chunk, lane, begin, end);
    for (std::int32_t s = begin; s < end; ++s) {
      const float* x = f.rows + f.slot_first[s] + lane;
      const float* a = x + row * stride;
      const Vec<W> w = load<W>(f.slot_weight + s * kMlsChunk + lane);
      Vec<W> r[3];
      for (int k = 0; k < 3; ++k) {
        r[k] = (load<W>(x + k * stride) - load<W>(own + k * stride)) * w;
      }
      for (int i = 0; i < 3; ++i) {
        const Vec<W> d = load<W>(a + i * stride) - load<W>(own_a + i * stride);
        for (int k = 0; k < 3; ++k) m[3 * i + k] += d * r[k];
      }
    }
    for (int k = 0; k < 9; ++k) store<W>(&out[k][lane], m[k]);
  }
}

/// sum_j w_ij |u_j - u_i - H_i r_ij|^2 of a chunk's nodes: what the penalty is about.
template <int W>
TISSUE_SIM_INLINE void residuals_of_slots(const MlsField& f, int chunk,
                                          const float (&H)[9][kMlsChunk], float (&out)[kMlsChunk]) {
  for (int lane = 0; lane < kMlsChunk; lane += W) {
    const float* own = f.rows + chunk * kMlsChunk + lane;
    Vec<W> sum{};
    std::int32_t begin, end;
    slots_of<W>(f, chunk, lane, begin, end);
    for (std::int32_t s = begin; s < end; ++s) {
      const float* other = f.rows + f.slot_first[s] + lane;
      Vec<W> r[3];
      for (int k = 0; k < 3; ++k) {
        r[k] = load<W>(other + k * f.stride) - load<W>(own + k * f.stride);
      }
      Vec<W> square{};
      for (int i = 0; i < 3; ++i) {
        const std::size_t row = (kMlsURow + i) * f.stride;
        Vec<W> d = load<W>(other + row) - load<W>(own + row);
        for (int k = 0; k < 3; ++k) d -= load<W>(&H[3 * i + k][lane]) * r[k];
        square += d * d;
      }
      sum += square * load<W>(f.slot_weight + s * kMlsChunk + lane);
    }
    store<W>(out + lane, sum);
  }
}

/// Forces on a chunk's nodes, into out[4 kMlsChunk].
template <int W>
TISSUE_SIM_INLINE void forces_of_slots(const MlsField& f, int chunk, float* out) {
  const std::size_t stride = f.stride;
  for (int lane = 0; lane < kMlsChunk; lane += W) {
    const float* own = f.rows + chunk * kMlsChunk + lane;
    Vec<W> Q[9], sum[3] = {};
    for (int k = 0; k < 9; ++k) Q[k] = load<W>(own + (kMlsStressRow + k) * stride);
    std::int32_t begin, end;
    slots_of<W>(f, chunk, lane, begin, end);
    for (std::int32_t s = begin; s < end; ++s) {
      const float* other = f.rows + f.slot_first[s] + lane;
      const Vec<W> w = load<W>(f.slot_weight + s * kMlsChunk + lane);
      const float* q = other + kMlsStressRow * stride;
      for (int k = 0; k < 3; ++k) {
        const Vec<W> r = (load<W>(other + k * stride) - load<W>(own + k * stride)) * w;
        for (int i = 0; i < 3; ++i) {
          sum[i] += (Q[3 * i + k] + load<W>(q + (3 * i + k) * stride)) * r;
        }
      }
      const Vec<W> kappa =
          (load<W>(other + kMlsKappaRow * stride) + load<W>(own + kMlsKappaRow * stride)) * w;
      for (int i = 0; i < 3; ++i) {
        const int row = kMlsURow + i;
        sum[i] += (load<W>(other + row * stride) - load<W>(own + row * stride)) * kappa;
      }
    }
    alignas(64) float lanes[3][W];
    for (int i = 0; i < 3; ++i) store<W>(lanes[i], sum[i]);
    for (int l = 0; l < W; ++l) {
      const Vec<4> force = {lanes[0][l], lanes[1][l], lanes[2][l], 0};
      store<4>(out + 4 * (lane + l), force);
    }
  }
}

}  // namespace mls_passes
}  // namespace tissue_sim
