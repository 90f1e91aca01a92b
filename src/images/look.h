// What tissue looks like: colours that stick to its material, and light from the lens.
#pragma once

#include "tissue_sim/types.h"

namespace tissue_sim {

/// Linear red, green and blue, 0 to 1.
using Colour = Eigen::Vector3f;

/// Of 0x00RRGGBB.
Colour linear(std::uint32_t rgb);
/// For a byte a channel, as screens have it.
void to_bytes(const Colour& colour, std::uint8_t* rgb);

/// Of tissue at a place of its material [m]: its skin with vessels beneath, or what a blade opened.
Colour tissue_colour(const Vec3& rest, bool is_cut);
/// By how much its wet surface leans there, in world axes: added to the normal.
Vec3 tissue_bumps(const Vec3& rest);
/// Of a drape, by a place on the ground [m].
/// Of a stress, as a share of the scale's end: from dark red to white.
Colour stress_colour(double share);
Colour drape_colour(const Vec3& place);

/// What comes back to the lens from a surface.
struct Surface {
  Colour colour;
  float shine = 0;      ///< how much of the light it mirrors, 0 to 1
  float sharpness = 1;  ///< of that: the larger, the smaller the highlight
};
/// `to_lens` and `normal` are of length 1. `distance` is that to the lens over the one at which the
/// light is full: nearer is brighter. Without a light it is even from everywhere.
Colour lit(const Surface& surface, const Vec3& normal, const Vec3& to_lens, double distance,
           bool has_light);

}  // namespace tissue_sim
