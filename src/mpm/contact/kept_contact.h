// What is remembered of contacts while blocks, and the numbers of facets, are made anew.
#pragma once

#include <cstdint>

#include "compute/host_device.h"
#include "mpm/surface/facets.h"

namespace tissue_sim {

/// What a contact is known by while blocks are made anew.
struct KeptContact {
  std::int32_t point;      ///< of the facet
  std::int32_t direction;  ///< of the facet
  std::int32_t other_body;
  double hold[3];  ///< reference place [m]
  float depth, begun, stiffness, apart[3];
  double looked_at;  ///< on the CPU, when last [s]

  TISSUE_SIM_INLINE bool is_before(std::int32_t p, int d) const {
    return point != p ? point < p : direction < d;
  }
};

/// The one of these, sorted, that a facet had; null if none.
TISSUE_SIM_INLINE const KeptContact* find_kept(const KeptContact* kept, int count,
                                               const Facet& facet) {
  int begin = 0, end = count;
  while (begin < end) {
    const int middle = (begin + end) / 2;
    if (kept[middle].is_before(facet.point, facet.direction)) {
      begin = middle + 1;
    } else {
      end = middle;
    }
  }
  const bool found =
      begin < count && kept[begin].point == facet.point && kept[begin].direction == facet.direction;
  return found ? kept + begin : nullptr;
}

}  // namespace tissue_sim
