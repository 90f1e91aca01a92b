// Colours of pieces in clouds.
#pragma once

#include <cstdint>

#include "tissue_sim/fragments.h"

namespace tissue_sim {

/// Colours of loose pieces (Okabe and Ito's), and of tissue that is not: 0x00RRGGBB.
inline std::uint32_t piece_colour(const Fragment& f) {
  constexpr std::uint32_t kPiece[] = {0xe69f00, 0x56b4e9, 0x009e73, 0xf0e442,
                                      0x0072b2, 0xd55e00, 0xcc79a7};
  return f.loose ? kPiece[f.id % 7] : 0xa8433a;
}

}  // namespace tissue_sim
