// Numbers that hang on a seed and a place alone.
#pragma once

#include <cstdint>

namespace tissue_sim {

/// In [-1, 1), of seed and index (splitmix64).
inline float draw(std::uint64_t seed, std::int32_t index) {
  std::uint64_t z = seed + 0x9e3779b97f4a7c15u * (static_cast<std::uint64_t>(index) + 1);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return static_cast<float>((z ^ (z >> 31)) >> 40) * 0x1p-23f - 1;
}

}  // namespace tissue_sim
