// Sums of real numbers by many threads whose order does not count: in fixed point. For .cu files.
#pragma once

namespace tissue_sim {

/// Impulses [N s]: up to 8 kN s.
inline constexpr double kImpulseUnit = 1.0 / (1ll << 50);

__device__ __forceinline__ void add_fixed(unsigned long long* to, double x, double unit) {
  const auto units = static_cast<unsigned long long>(__double2ll_rn(x * (1 / unit)));
  if (units != 0) atomicAdd(to, units);
}
__device__ __forceinline__ double from_fixed(unsigned long long x, double unit) {
  return static_cast<double>(static_cast<long long>(x)) * unit;
}

}  // namespace tissue_sim
