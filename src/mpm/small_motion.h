// What the linearised motions of CPU and GPU have in common.
#pragma once

#include <cstdint>

#include "compute/host_device.h"

namespace tissue_sim {

/// Largest displacement [cells]: between what curves and what is rounded. The largest is that of
/// the lightest node, at the rim of a cut, where the rest moves a hundredth of it: at a thousandth
/// of a cell that drowned in the rounding of displacements.
inline constexpr float kSmallMotion = 1.0f / 64;

/// A number in [-1, 1) for each i (the mixer of C. Wellons, "Prospecting for hash functions").
TISSUE_SIM_INLINE float scattered(std::uint32_t i) {
  i = (i ^ (i >> 16)) * 0x7feb352du;
  i = (i ^ (i >> 15)) * 0x846ca68bu;
  i ^= i >> 16;
  return static_cast<float>(static_cast<std::int32_t>(i)) / 2147483648.0f;
}

}  // namespace tissue_sim
