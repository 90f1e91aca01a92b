// A run of points that came off their piece.
#pragma once

#include <cstdint>

namespace tissue_sim {

/// Points begin .. end - 1, all of one piece until bonds broke and of one component since.
struct PartedRun {
  std::int32_t begin, end;
  std::int32_t lowest;  ///< point of the component; never that of the piece
};

}  // namespace tissue_sim
