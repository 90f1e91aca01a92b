#include "mpm/blocks/known_facets.h"

#include <algorithm>

#include "mpm/split/node_fields.h"

namespace tissue_sim {

KnownFacets::KnownFacets(const LatticeBody& body, const BlockRegion& region,
                         const std::vector<std::uint8_t>& stale)
    : x_(region.x), y_(region.y), z_(region.z), nx_(region.nx), ny_(region.ny) {
  const int count = region.nx * region.ny * region.nz;
  stale_.assign(count, 0);
  for (int z = z_; z < z_ + region.nz; ++z) {
    for (int y = y_; y < y_ + ny_; ++y) {
      body.for_each_node_in_row(x_, x_ + nx_, y, z, [&](int x, int node, int of_row) {
        std::copy_n(stale.begin() + node, of_row, stale_.begin() + index(x, y, z));
      });
    }
  }
  const auto cell_of = [this](const Block& b, const Facet& f) {
    return index(b.cell_x(f.cell % b.plane % b.pitch), b.y + f.cell % b.plane / b.pitch,
                 b.z + f.cell / b.plane);
  };
  first_.assign(count + 1, 0);
  for (const Block& b : region.blocks) {
    for (const Facet& f : b.facets) ++first_[cell_of(b, f) + 1];
  }
  for (int i = 0; i < count; ++i) first_[i + 1] += first_[i];
  facets_.resize(first_[count]);
  std::vector<std::int32_t> next(first_.begin(), first_.end() - 1);
  for (const Block& b : region.blocks) {
    for (const Facet& f : b.facets) facets_[next[cell_of(b, f)]++] = f;
  }
}

void KnownFacets::take(int x, int y, int z, const std::int32_t (&around)[8], int cell,
                       std::vector<Facet>& facets) const {
  const int i = index(x, y, z);
  for (int f = first_[i]; f < first_[i + 1]; ++f) {
    const auto end = std::end(around);
    if (std::find(std::begin(around), end, facets_[f].point) == end) continue;  // of another share
    facets.push_back(facets_[f]);
    facets.back().cell = cell;
  }
}

void mark_stale_facets(const LatticeTissue& tissue, const std::vector<std::int32_t>& changed,
                       std::vector<std::uint8_t>& stale) {
  // A facet is fitted to bonds up to two cells away, and what is bound within two cells decides
  // which of a cell's points are in one block.
  constexpr int kReach = 2;
  for (const LatticeBody& body : tissue.bodies) {
    const CellsAround cells(body, kReach, tissue.points, changed);
    cells.for_each_row([&](int, int, int, int node, const std::uint8_t* near, int count) {
      for (int i = 0; i < count; ++i) stale[node + i] |= near[i];
    });
  }
}

}  // namespace tissue_sim
