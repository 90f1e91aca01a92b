// What the machine can do, measured in the run that it is compared with.
#pragma once

#include <chrono>
#include <vector>

#include "compute/for_each.h"
#include "compute/simd.h"

namespace tissue_sim {

/// Runs f, some times over; the shortest [s].
template <class F>
double shortest_of(int times, const F& f) {
  double best = 1e30;
  for (int i = 0; i < times; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    f();
    best = std::min(
        best, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  }
  return best;
}

/// Memory bandwidth of a = b + s c on all threads, three arrays far larger than the caches
/// [bytes/s].
inline double triad_rate(Cpu& cpu) {
  constexpr int kParts = 256, kPart = 1 << 17;
  std::vector<float> a(kParts * kPart), b(a.size(), 1.0f), c(a.size(), 2.0f);
  const double time = shortest_of(5, [&] {
    cpu.for_each(kParts, [&](int part) {
      const std::size_t first = static_cast<std::size_t>(part) * kPart;
      for (std::size_t i = first; i < first + kPart; ++i) a[i] = b[i] + 3.0f * c[i];
    });
  });
  return 3.0 * sizeof(float) * a.size() / time;
}

template <int W>
TISSUE_SIM_INLINE float fused_chains(float x) {
  constexpr int kChains = 12;
  Vec<W> sum[kChains], factor = Vec<W>{} + x;
  for (int k = 0; k < kChains; ++k) sum[k] = factor * static_cast<float>(k);
  for (int i = 0; i < 100000; ++i) {
    for (int k = 0; k < kChains; ++k) sum[k] = sum[k] * factor + factor;
  }
  for (int k = 1; k < kChains; ++k) sum[0] += sum[k];
  return sum[0][0];
}
inline float fused_chains_sse2(float x) { return fused_chains<4>(x); }
TISSUE_SIM_TARGET_AVX2 inline float fused_chains_avx2(float x) { return fused_chains<8>(x); }
TISSUE_SIM_TARGET_AVX512 inline float fused_chains_avx512(float x) { return fused_chains<16>(x); }

/// Fused multiply-adds (of SSE2, pairs of one each) of single floats on all threads [1/s].
inline double fused_rate(Cpu& cpu, InstructionSet set) {
  const int width = set == InstructionSet::kAvx512 ? 16 : set == InstructionSet::kAvx2 ? 8 : 4;
  auto* const chains = set == InstructionSet::kAvx512 ? fused_chains_avx512
                       : set == InstructionSet::kAvx2 ? fused_chains_avx2
                                                      : fused_chains_sse2;
  const int parts = 4 * cpu.threads();
  std::vector<float> kept(parts);
  const double time = shortest_of(
      5, [&] { cpu.for_each(parts, [&](int i) { kept[i] = chains(0.5f + 0.01f * i); }); });
  return 12.0 * 100000 * width * parts / time;
}

}  // namespace tissue_sim
