#include "mpm/cuda/stacks.h"

#include <algorithm>
#include <tuple>

namespace tissue_sim {
namespace {

bool on_one_another(const Block& a, const Block& b) { return a.x == b.x && a.y == b.y; }

int parts_of(int n, int size) { return (n + size - 1) / size; }

/// Of the blocks in the order of blocks_by_column(): in a column, and in a stack.
struct Heights {
  int column = 1, stack = 1;
  Heights(const HostTables& t, const std::vector<Block*>& blocks, int at_once) {
    const int all = static_cast<int>(t.blocks.size());
    const Block& first = *blocks[t.of_host[0]];
    while (column < all && on_one_another(*blocks[t.of_host[column]], first)) ++column;
    stack = stack_height(all / column, column, at_once);
  }
};

}  // namespace

int stack_height(int columns, int high, int at_once) {
  int best = 1;
  double least = 1e30;
  for (int stacks = high; stacks > 0; --stacks) {
    const int height = parts_of(high, stacks);
    // What a stack costs beside its blocks is a part of what one of them does.
    const double time = parts_of(columns * stacks, at_once) * (height + 0.15);
    if (time >= least) continue;
    least = time;
    best = height;
  }
  return best;
}

std::vector<std::vector<int>> blocks_by_column(const std::vector<Block*>& blocks) {
  std::vector<std::vector<int>> result(blocks.size());
  for (std::size_t i = 0; i < blocks.size(); ++i) result[i] = {static_cast<int>(i)};
  std::sort(result.begin(), result.end(), [&](const auto& a, const auto& b) {
    const Block &p = *blocks[a[0]], &q = *blocks[b[0]];
    return std::tie(p.y, p.x, p.z) < std::tie(q.y, q.x, q.z);
  });
  return result;
}

void Stacks::make(const HostTables& t, const std::vector<Block*>& blocks, int at_once,
                  const std::int32_t* slot_node, std::size_t node_count, ConnectRoom& room,
                  int* most_sharing, cudaStream_t stream) {
  const Heights heights(t, blocks, at_once);
  count_ = 0;
  if (heights.stack == 1) return;

  std::vector<CudaBlock> stacks;
  std::vector<CudaBundle> bundles;
  slot_node_.resize(t.slots);
  int slots = 0;
  for (int i = 0; i < static_cast<int>(t.blocks.size()); ++i) {
    const CudaBlock& b = t.blocks[i];
    const bool lowest = i % heights.column % heights.stack == 0;
    if (lowest) {
      stacks.push_back(b);
      stacks.back().first_slot = slots;
      stacks.back().nz = 0;
      CudaBundle bundle = {};
      bundle.body = b.body;
      bundle.first_block = static_cast<int>(bundles.size());
      bundle.blocks = 1;
      bundle.first_slot = slots;
      bundles.push_back(bundle);
    } else {
      slots -= 2 * (b.nx + 2) * (b.ny + 2);  // the planes that it shares with the block below
    }
    check_cuda(cudaMemcpyAsync(slot_node_.data() + slots, slot_node + b.first_slot,
                               b.slots() * sizeof(std::int32_t), cudaMemcpyDeviceToDevice, stream),
               "copy");
    slots += b.slots();
    stacks.back().nz += b.nz;
    stacks.back().whole = stacks.back().whole & b.whole;
  }
  slot_node_.resize(slots);
  slot_parts_.resize(slots);
  first_parts_.resize(slots);
  parts_.resize(slots);
  blocks_.upload(stacks, stream);
  bundles_.upload(bundles, stream);
  connect_slots({slot_node_.data(), slot_parts_.data(), first_parts_.data(), parts_.data(),
                 static_cast<std::size_t>(slots)},
                node_count, room, most_sharing, stream);
  check_cuda(cudaStreamSynchronize(stream), "receive data");  // before the vectors go
  count_ = static_cast<int>(stacks.size());
}

CudaTables Stacks::of(CudaTables t) const {
  if (count_ == 0) return t;
  t.blocks = blocks_.data();
  t.bundles = bundles_.data();
  t.block_count = t.bundle_count = count_;
  t.slot_node = slot_node_.data();
  t.slot_parts = slot_parts_.data();
  t.first_parts = first_parts_.data();
  t.parts = parts_.data();
  return t;
}

std::size_t Stacks::bytes_for(const HostTables& t, const std::vector<Block*>& blocks, int at_once) {
  constexpr std::size_t of_slot = 3 * sizeof(std::int32_t) + sizeof(uint4);
  return Heights(t, blocks, at_once).stack == 1 ? 0 : of_slot * t.slots;
}

std::size_t Stacks::bytes() const {
  return blocks_.bytes() + bundles_.bytes() + slot_node_.bytes() + slot_parts_.bytes() +
         first_parts_.bytes() + parts_.bytes();
}

}  // namespace tissue_sim
