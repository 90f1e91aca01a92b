// Which points a cloud holds.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "fragments/pieces.h"
#include "tissue_sim/point.h"

namespace tissue_sim {

/// The pieces by Fragment::id; null for ids that are gone.
inline std::vector<const Fragment*> pieces_by_id(const Pieces& pieces) {
  std::vector<const Fragment*> piece(pieces.next_id, nullptr);
  for (const Fragment& f : pieces.all) piece[f.id] = &f;
  return piece;
}

/// Place in the cloud of each point, -1 for those left out; `count` receives how many there are.
/// `at_surface(point)` tells whether a point is at the surface or at a cut.
template <class AtSurface>
std::vector<std::int32_t> select_points(const PointSelection& selection, const Pieces& pieces,
                                        const AtSurface& at_surface, int& count) {
  const std::vector<const Fragment*> piece = pieces_by_id(pieces);
  std::vector<std::int32_t> place(pieces.of_point.size(), -1);
  const int stride = std::max(1, selection.stride);
  count = 0;
  for (std::size_t p = 0; p < place.size(); p += stride) {
    if (selection.surface_only && !at_surface(static_cast<std::int32_t>(p))) continue;
    if (selection.loose_only && !piece[pieces.of_point[p]]->loose) continue;
    place[p] = count++;
  }
  return place;
}

}  // namespace tissue_sim
