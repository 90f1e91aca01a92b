// What is seen looks like: colours of tissue that stick to its material, and light from the lens.
#pragma once

#include <cstdint>

#include "compute/simd.h"
#include "tissue_sim/types.h"

namespace tissue_sim {

/// Linear red, green and blue, 0 to 1.
using Colour = Eigen::Vector3f;

/// Of 0x00RRGGBB.
Colour linear(std::uint32_t rgb);
/// For a byte a channel, as screens have it.
void to_bytes(const float* colour, std::uint8_t* rgb);
/// Of a stress, as a share of the scale's end: from dark red to white.
Colour stress_colour(double share);

/// What a surface is of.
enum class Look {
  kSkin,     ///< of tissue, with vessels beneath
  kCutFace,  ///< what a blade opened
  kDrape,    ///< the ground
  kSteel,
  kHandle,
  kTinted,  ///< of a colour that is given
  kFluid,   ///< likewise, and wet
};
inline constexpr int kLooks = 7;

/// Pixels of one look, side by side.
struct Pixels {
  static constexpr int kMost = 64;
  int count = 0;
  std::int64_t index[kMost];  ///< in the image
  float place[3][kMost];      ///< of tissue its material's, of the ground the world's [m]
  float normal[3][kMost];     ///< of any length, to either side
  float along[3][kMost];      ///< the ray from the lens
  float distance[kMost];      ///< in lengths of the ray, over that at which the light is full
  float colour[3]
              [kMost];  ///< what comes back to the lens; of kTinted and kFluid the surface's before
};

/// Sets their colours: the same bits with any instructions. With a light at the lens what is nearer
/// is brighter; without one it comes from everywhere.
void light_up(Look look, bool has_light, InstructionSet instructions, Pixels& pixels);

}  // namespace tissue_sim
