#include "contact/known_facets.h"

#include <algorithm>

namespace tissue_sim {

KnownFacets::KnownFacets(const LatticeBody& body, const BlockRegion& region,
                         const std::vector<std::uint8_t>& stale)
    : x_(region.x), y_(region.y), z_(region.z), nx_(region.nx), ny_(region.ny) {
  const int count = region.nx * region.ny * region.nz;
  stale_.assign(count, 0);
  for (int z = z_; z < z_ + region.nz; ++z) {
    for (int y = y_; y < y_ + ny_; ++y) {
      body.for_each_node_in_row(x_, x_ + nx_, y, z, [&](int x, int node, int of_row, int) {
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

void mark_stale_facets(const std::vector<LatticeBody>& bodies, const Points& points,
                       const std::vector<std::int32_t>& changed, std::vector<std::uint8_t>& stale) {
  // A facet is fitted to bonds up to two cells away, and what is bound within two cells decides
  // which of a cell's points are in one block.
  constexpr int kReach = 2;
  std::vector<bool> done(stale.size(), false);  // of cells: all around
  for (const std::int32_t p : changed) {
    const Points::Site& s = points.site[p];
    const LatticeBody& b = bodies[s.body];
    const int node = b.node(s.x / 2, s.y / 2, s.z / 2);
    if (done[node]) continue;
    done[node] = true;
    const int x = std::max(s.x / 2 - kReach, 0), x_end = std::min(s.x / 2 + kReach + 1, b.nx);
    const int y_end = std::min(s.y / 2 + kReach + 1, b.ny);
    const int z_end = std::min(s.z / 2 + kReach + 1, b.nz);
    for (int z = std::max(s.z / 2 - kReach, 0); z < z_end; ++z) {
      for (int y = std::max(s.y / 2 - kReach, 0); y < y_end; ++y) {
        b.for_each_node_in_row(x, x_end, y, z, [&](int, int first, int count, int) {
          std::fill_n(stale.begin() + first, count, std::uint8_t{1});
        });
      }
    }
  }
}

}  // namespace tissue_sim
