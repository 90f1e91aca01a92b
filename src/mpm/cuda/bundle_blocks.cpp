#include <algorithm>
#include <numeric>

#include "mpm/cuda/choose_plan.h"

namespace tissue_sim {

std::size_t fewest_bundles(const std::vector<BlockToBundle>& blocks, const BundleSize& limits) {
  std::size_t columns = 0;
  for (const BlockToBundle& b : blocks) columns += b.size.columns;
  return (columns + limits.columns - 1) / limits.columns;
}

std::vector<std::vector<int>> bundle_blocks(const std::vector<BlockToBundle>& blocks,
                                            std::size_t wanted, const BundleSize& limits) {
  std::vector<int> order(blocks.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&blocks](int a, int b) {
    return blocks[a].size.columns > blocks[b].size.columns;
  });
  std::vector<BlockToBundle> bundles;
  std::vector<std::vector<int>> result;
  for (const int i : order) {
    const BlockToBundle& one = blocks[i];
    std::size_t room = bundles.size();
    for (std::size_t k = 0; bundles.size() >= wanted && k < bundles.size(); ++k) {
      const BundleSize& has = bundles[k].size;
      const bool fits = bundles[k].kind == one.kind &&
                        has.columns + one.size.columns <= limits.columns &&
                        has.plane_slots + one.size.plane_slots <= limits.plane_slots &&
                        has.slots + one.size.slots <= limits.slots;
      if (fits && (room == bundles.size() || has.columns < bundles[room].size.columns)) room = k;
    }
    if (room == bundles.size()) {
      bundles.push_back(one);
      result.push_back({i});
      continue;
    }
    BundleSize& size = bundles[room].size;
    size.columns += one.size.columns;
    size.plane_slots += one.size.plane_slots;
    size.slots += one.size.slots;
    result[room].push_back(i);
  }
  return result;
}

std::vector<std::vector<int>> bundle_in_rounds(const std::vector<BlockToBundle>& blocks,
                                               std::size_t at_once, std::size_t most,
                                               const BundleSize& limits) {
  std::size_t wanted = (fewest_bundles(blocks, limits) + at_once - 1) / at_once * at_once;
  for (; wanted <= most && wanted < blocks.size(); wanted += at_once) {
    std::vector<std::vector<int>> bundles = bundle_blocks(blocks, wanted, limits);
    if (bundles.size() <= wanted) return bundles;
  }
  return {};
}

namespace {

int parts_of(int n, int size) { return (n + size - 1) / size; }

}  // namespace

BlockCounts::BlockCounts(const LatticeBody& body, int max_y, int max_z)
    : nx_(body.nx),
      ny_(body.ny),
      nz_(body.nz),
      fills_box_(body.point_count == 8 * body.nx * body.ny * body.nz),
      max_y_(std::min(max_y, body.ny)),
      max_z_(std::min(max_z, body.nz)) {
  if (fills_box_) return;
  rows_.resize(static_cast<std::size_t>(ny_) * nz_);
  for (int z = 0; z < 2 * nz_; ++z) {
    for (int y = 0; y < 2 * ny_; ++y) {
      body.for_each_point_in_row(0, 2 * nx_, y, z, [&](int x, int, int count) {
        rows_[z / 2 * ny_ + y / 2].add({x / 2, (x + count + 1) / 2});
      });
    }
  }
  rods_.resize(static_cast<std::size_t>(max_y_) * max_z_);
  std::vector<Extent> layer;  // as high as the blocks
  for (int z = 1; z <= max_z_; ++z) {
    for (int z0 = 0; z0 < nz_; z0 += z) {
      find_layer(z0, z, layer);
      double columns = 0;
      for (const Extent& row : layer) columns += row.length();
      for (int y = 1; y <= max_y_; ++y) {
        Rods& rods = rods_[(y - 1) * max_z_ + z - 1];
        rods.columns += columns;
        for (int y0 = 0; y0 < ny_; y0 += y) {
          Extent of_rod;
          for (int j = y0; j < std::min(y0 + y, ny_); ++j) of_rod.add(layer[j]);
          if (of_rod.length() > 0) rods.length.push_back(of_rod.length());
        }
      }
    }
  }
}

void BlockCounts::find_layer(int z0, int z, std::vector<Extent>& layer) const {
  layer.assign(ny_, fills_box_ ? Extent{0, nx_} : Extent());
  if (fills_box_) return;  // there are no rows_
  for (int k = z0; k < std::min(z0 + z, nz_); ++k) {
    for (int j = 0; j < ny_; ++j) layer[j].add(rows_[k * ny_ + j]);
  }
}

void BlockCounts::list(int x, int y, int z, int kind, std::vector<BlockToBundle>& blocks) const {
  std::vector<Extent> layer;
  for (int z0 = 0; z0 < nz_; z0 += z) {
    find_layer(z0, z, layer);
    for (int y0 = 0; y0 < ny_; y0 += y) {
      Extent rod;
      for (int j = y0; j < std::min(y0 + y, ny_); ++j) rod.add(layer[j]);
      const int parts = parts_of(rod.length(), x);
      for (int i = 0; i < parts; ++i) {
        const int begin = rod.begin + rod.length() * i / parts,
                  end = rod.begin + rod.length() * (i + 1) / parts;
        int columns = 0, rows = 0;
        for (int j = y0; j < std::min(y0 + y, ny_); ++j) {
          const int filled = std::min(end, layer[j].end) - std::max(begin, layer[j].begin);
          columns += std::max(0, filled);
          rows += filled > 0 ? 1 : 0;
        }
        if (columns == 0) continue;
        const int plane_slots = (end - begin + 2) * (rows + 2);
        blocks.push_back({kind, {columns, plane_slots, plane_slots * (std::min(z, nz_ - z0) + 2)}});
      }
    }
  }
}

BlockCount BlockCounts::count(int x, int y, int z) const {
  if (fills_box_) {
    const double columns = static_cast<double>(nx_) * ny_ * parts_of(nz_, z);
    return {static_cast<double>(parts_of(nx_, x)) * parts_of(ny_, y) * parts_of(nz_, z), columns};
  }
  const Rods& rods = rods_[(std::min(y, max_y_) - 1) * max_z_ + std::min(z, max_z_) - 1];
  BlockCount count{0, rods.columns};
  for (const int length : rods.length) count.blocks += parts_of(length, x);
  return count;
}

}  // namespace tissue_sim
