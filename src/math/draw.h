// Numbers that hang on a seed and a place alone.
#pragma once

#include <cstdint>

namespace tissue_sim {

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
