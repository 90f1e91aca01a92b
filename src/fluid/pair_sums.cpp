#include "fluid/pair_sums.h"

#include <algorithm>

#include "compute/choose.h"
#include "compute/simd.h"

namespace tissue_sim {
namespace pair_sums {
namespace {

constexpr int kW = 8;
using V = Vec<kW>;

/// Neighbours side by side: where they are from here, and four numbers more of each. Those that are
/// not there have no volume.
struct Lanes {
  alignas(32) float d[3][kW], volume[kW];
};

TISSUE_SIM_INLINE int gather(const FluidState& s, std::int32_t begin, std::int32_t end,
                             const float* x, Lanes& lanes) {
  const int n = std::min(kW, static_cast<int>(end - begin));
  for (int l = 0; l < n; ++l) {
    const float* of = &s.place[4 * static_cast<std::size_t>(s.lists.other[begin + l])];
    for (int a = 0; a < 3; ++a) lanes.d[a][l] = x[a] - of[a];
    lanes.volume[l] = of[3];
  }
  for (int l = n; l < kW; ++l) {
    for (int a = 0; a < 3; ++a) lanes.d[a][l] = 0;
    lanes.volume[l] = 0;
  }
  return n;
}

TISSUE_SIM_INLINE float sum_of(V v) {
  float lane[kW], sum = 0;
  store<kW>(lane, v);
  for (const float x : lane) sum += x;
  return sum;
}

TISSUE_SIM_INLINE float neighbour_volume_by(const FluidState& s, int i) {
  const float* x = &s.place[4 * static_cast<std::size_t>(i)];
  const V one = all_lanes<V>(1), by_reach = all_lanes<V>(1 / s.kernel.reach);
  V sum = {};
  Lanes lanes;
  const std::int32_t end = s.lists.begin[i + 1];
  for (std::int32_t e = s.lists.begin[i]; e < end; e += kW) {
    gather(s, e, end, x, lanes);
    const V dx = load<kW>(lanes.d[0]), dy = load<kW>(lanes.d[1]), dz = load<kW>(lanes.d[2]);
    V t = square_root(dx * dx + dy * dy + dz * dz) * by_reach;
    t = choose(less(one, t), one, t);
    const V u2 = (one - t) * (one - t);
    sum += load<kW>(lanes.volume) * (u2 * u2 * (4 * t + one));
  }
  return s.kernel.value(0) * sum_of(sum);
}

TISSUE_SIM_INLINE void add_pair_forces_by(const FluidState& s, int i, float* force) {
  const float* x = &s.place[4 * static_cast<std::size_t>(i)];
  const float* v = &s.motion[4 * static_cast<std::size_t>(i)];
  const V one = all_lanes<V>(1), by_reach = all_lanes<V>(1 / s.kernel.reach);
  const V soft2 = all_lanes<V>(0.0025f * s.kernel.reach * s.kernel.reach);
  const float own = s.viscosity[s.particles.kind[i]];
  V f[3] = {};
  Lanes lanes;
  alignas(32) float u[3][kW] = {}, factor[kW] = {}, eta[kW] = {};
  const std::int32_t end = s.lists.begin[i + 1];
  for (std::int32_t e = s.lists.begin[i]; e < end; e += kW) {
    const int n = gather(s, e, end, x, lanes);
    for (int l = 0; l < n; ++l) {
      const std::int32_t j = s.lists.other[e + l];
      const float* of = &s.motion[4 * static_cast<std::size_t>(j)];
      for (int a = 0; a < 3; ++a) u[a][l] = v[a] - of[a];
      factor[l] = v[3] + of[3];
      eta[l] = 5 * (own + s.viscosity[s.particles.kind[j]]);
    }
    const V dx = load<kW>(lanes.d[0]), dy = load<kW>(lanes.d[1]), dz = load<kW>(lanes.d[2]);
    const V r2 = dx * dx + dy * dy + dz * dz;
    V t = square_root(r2) * by_reach;
    t = choose(less(one, t), one, t);
    const V w = one - t;
    const V nearing = load<kW>(u[0]) * dx + load<kW>(u[1]) * dy + load<kW>(u[2]) * dz;
    const V along = load<kW>(eta) * nearing / (r2 + soft2) - load<kW>(factor);
    const V scale = load<kW>(lanes.volume) * along * (w * w * w);
    f[0] += scale * dx;
    f[1] += scale * dy;
    f[2] += scale * dz;
  }
  const float all = x[3] * s.kernel.slope_by_r(0);
  for (int a = 0; a < 3; ++a) force[a] += all * sum_of(f[a]);
}

#if defined(__x86_64__)
// Not TISSUE_SIM_TARGET_AVX2, with which the compiler would fuse.
__attribute__((target("avx2"))) float neighbour_volume_avx2(const FluidState& s, int i) {
  return neighbour_volume_by(s, i);
}
__attribute__((target("avx2"))) void add_pair_forces_avx2(const FluidState& s, int i,
                                                          float* force) {
  add_pair_forces_by(s, i, force);
}
#endif

}  // namespace
}  // namespace pair_sums

float neighbour_volume(const FluidState& s, int i) {
#if defined(__x86_64__)
  if (s.instructions != InstructionSet::kSse2) return pair_sums::neighbour_volume_avx2(s, i);
#endif
  return pair_sums::neighbour_volume_by(s, i);
}

void add_pair_forces(const FluidState& s, int i, float* force) {
#if defined(__x86_64__)
  if (s.instructions != InstructionSet::kSse2) return pair_sums::add_pair_forces_avx2(s, i, force);
#endif
  pair_sums::add_pair_forces_by(s, i, force);
}

}  // namespace tissue_sim
