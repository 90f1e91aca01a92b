// Colours of pieces: in clouds, in RViz's boxes and labels, in pictures.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "tissue_sim/fragments.h"

namespace tissue_sim {

/// Tissue that has not come loose: 0x00RRGGBB.
inline constexpr std::uint32_t kTissueColour = 0xa8433a;

/// The share `white` of white in the colour, or of black where it is negative: -1 to 1.
inline std::uint32_t tinted(std::uint32_t colour, double white) {
  std::uint32_t result = 0;
  for (int shift = 0; shift < 24; shift += 8) {
    const double c = (colour >> shift) & 0xff;
    const double t = white < 0 ? c * (1 + white) : c + (255 - c) * white;
    result |= static_cast<std::uint32_t>(t + 0.5) << shift;
  }
  return result;
}

/// 0x00RRGGBB of a hue in turns (0 red, 1/3 green), saturation and value, each 0 to 1.
inline std::uint32_t colour_of_hue(double hue, double saturation, double value) {
  std::uint32_t result = 0;
  for (int k : {5, 3, 1}) {
    const double at = std::fmod(k + 6 * hue, 6);
    const double off = std::max(0.0, std::min({at, 4 - at, 1.0}));
    const double c = value * (1 - saturation * off);
    result = result << 8 | static_cast<std::uint32_t>(255 * c + 0.5);
  }
  return result;
}

/// A piece's colour for ever, 0x00RRGGBB. Loose ones have Okabe and Ito's seven, which colour-blind
/// people tell apart, from the eighth on hues by golden section, plain, pale and dark in turn: of
/// fourteen ids in a row each two differ, whatever the ids.
inline std::uint32_t piece_colour(const Fragment& f) {
  constexpr std::uint32_t kPiece[] = {0xe69f00, 0x56b4e9, 0x009e73, 0xf0e442,
                                      0x0072b2, 0xd55e00, 0xcc79a7};
  if (!f.loose) return kTissueColour;
  if (f.id >= 0 && f.id < 7) return kPiece[f.id];
  const double hue = std::fmod(0.35 + std::abs(f.id) * 0.6180339887498949, 1);
  constexpr double kSaturation[] = {0.85, 0.45, 0.9}, kValue[] = {0.95, 1, 0.6};
  const int kind = std::abs(f.id) % 3;
  return colour_of_hue(hue, kSaturation[kind], kValue[kind]);
}

}  // namespace tissue_sim
