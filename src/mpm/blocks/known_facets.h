// The facets of a block, and those that stay what they are when bonds break elsewhere.
#pragma once

#include <cstdint>
#include <vector>

#include "mpm/blocks/blocks.h"
#include "mpm/split/lattice_tissue.h"
#include "mpm/surface/facet_in_world.h"

namespace tissue_sim {

/// Facets that a region's blocks had, by lattice cell.
class KnownFacets {
 public:
  KnownFacets() = default;  ///< none
  /// Those of the region's blocks but of the cells that are `stale` (per lattice node).
  KnownFacets(const LatticeBody& body, const BlockRegion& region,
              const std::vector<std::uint8_t>& stale);

  /// Whether facets of cell (x, y, z) may have changed since; if there are none, all have.
  bool is_stale(int x, int y, int z) const { return none() || stale_[index(x, y, z)] != 0; }
  bool none() const { return stale_.empty(); }
  /// Whether the cell still has none.
  bool is_bare(int x, int y, int z) const {
    const int i = index(x, y, z);
    return !none() && stale_[i] == 0 && first_[i] == first_[i + 1];
  }
  /// Appends the facets of the points `around` of cell (x, y, z), as those of `cell` in their
  /// block.
  void take(int x, int y, int z, const std::int32_t (&around)[8], int cell,
            std::vector<Facet>& facets) const;

 private:
  int index(int x, int y, int z) const { return ((z - z_) * ny_ + y - y_) * nx_ + x - x_; }

  int x_ = 0, y_ = 0, z_ = 0, nx_ = 0, ny_ = 0;  // the region
  std::vector<std::uint8_t> stale_;              // per cell; empty: all are
  std::vector<std::int32_t> first_;              // per cell and one more
  std::vector<Facet> facets_;
};

/// Marks the cells (per lattice node) whose facets may change where the points `changed` lost
/// bonds.
void mark_stale_facets(const LatticeTissue& tissue, const std::vector<std::int32_t>& changed,
                       std::vector<std::uint8_t>& stale);

/// The facets of a block; `known` are those of its region that need not be made anew. Where a blade
/// broke the bonds, place and normal are those of its sweep; else those of the plane that fits the
/// missing bonds of the columns around best, so that an oblique face is a plane, not stairs. Points
/// that an anchor holds have none beside its face, where nodes move that tell nothing of them.
std::vector<Facet> facets_of(const LatticeBody& body, const Points& points, const Nodes& nodes,
                             const Block& block, const KnownFacets& known);

}  // namespace tissue_sim
