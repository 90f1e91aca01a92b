#include "mpm/blocks/block.h"

#include <algorithm>

namespace tissue_sim {
namespace {

int padded(int n) { return (n + kLanes - 1) / kLanes * kLanes; }

}  // namespace

void lay_out(Block& block) {
  block.pitch = block.nx + 2;
  block.plane = padded((block.ny + 2) * block.pitch + 1);
  block.stride = padded(block.runs.back().lane + block.runs.back().count);
  block.cell.assign(block.stride, 0);
  for (const Block::Run& run : block.runs) {
    for (int i = 0; i < run.count; ++i) block.cell[run.lane + i] = run.y * block.pitch + run.x + i;
  }
  block.volume.assign(block.lane_count(), 0.0f);
  block.point.assign(block.lane_count(), -1);
}

void find_filled(Block& block) {
  block.filled.assign(block.nz, {});
  block.filled_columns.assign(block.stride, 0);
  for (int z = 0; z < block.nz; ++z) {
    const float* volume = block.volume.data() + static_cast<std::size_t>(z) * 8 * block.stride;
    for (int j = 0; j < block.stride; ++j) {
      int s = 0;
      while (s < 8 && volume[s * block.stride + j] <= 0) ++s;
      if (s == 8) continue;
      block.filled_columns[j] = 1;
      std::vector<Block::Span>& spans = block.filled[z];
      if (spans.empty() || spans.back().end < j) spans.push_back({j, j});
      spans.back().end = j + 1;
    }
  }
}

}  // namespace tissue_sim
