#include "mpm/block.h"

namespace tissue_sim {
namespace {

int padded(int n) { return (n + kLanes - 1) / kLanes * kLanes; }

}  // namespace

void lay_out(Block& block) {
  block.pitch = block.nx + 2;
  block.stride = padded((block.ny - 1) * block.pitch + block.nx);
  block.plane = padded((block.ny + 2) * block.pitch);
  block.volume.assign(block.lane_count(), 0.0f);
  block.point.assign(block.lane_count(), -1);
}

}  // namespace tissue_sim
