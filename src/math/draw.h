// Numbers that hang on a seed and a place alone.
#pragma once

#include <cstdint>

#include "compute/host_device.h"

namespace tissue_sim {

/// A number in [-1, 1) for each i (the mixer of C. Wellons, "Prospecting for hash functions").
TISSUE_SIM_INLINE float scattered(std::uint32_t i) {
  i = (i ^ (i >> 16)) * 0x7feb352du;
  i = (i ^ (i >> 15)) * 0x846ca68bu;
  i ^= i >> 16;
  return static_cast<float>(static_cast<std::int32_t>(i)) / 2147483648.0f;
}

/// A step of SplitMix64.
inline std::uint64_t split_mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15u;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

/// In [-1, 1), of seed and index.
inline float draw(std::uint64_t seed, std::int32_t index) {
  const std::uint64_t at = seed + 0x9e3779b97f4a7c15u * static_cast<std::uint64_t>(index);
  return static_cast<float>(split_mix(at) >> 40) * 0x1p-23f - 1;
}

}  // namespace tissue_sim
