// Stacks of blocks: the march goes through all blocks of a stack as if they were one.
#pragma once

#include <vector>

#include "compute/device_array.h"
#include "mpm/cuda/connect_slots.h"
#include "mpm/cuda/make_tables.h"

namespace tissue_sim {

/// Of `high` blocks that lie on one another, in each of `columns`, how many make a stack, for as
/// many thread blocks as run at once to be done soonest.
int stack_height(int columns, int high, int at_once);

/// Each block alone, those that lie on one another in a row from the lowest up: indices into
/// Blocks::all. All blocks must be of one body that fills a box.
std::vector<std::vector<int>> blocks_by_column(const std::vector<Block*>& blocks);

/// What the march has for CudaTables' blocks, bundles and slots where stacks are several blocks
/// high: planes of nodes that two blocks of a stack share are there once. Other kernels, the
/// pushing ones too, keep a whole block in shared memory, so they keep the blocks.
class Stacks {
 public:
  /// Stacks of the blocks of `t`, which are in the order of blocks_by_column(), for so many thread
  /// blocks at once; none where each block would be one. Needs the slots' nodes as `t` has them
  /// on the device, in `slot_node`.
  void make(const HostTables& t, const std::vector<Block*>& blocks, int at_once,
            const std::int32_t* slot_node, std::size_t node_count, ConnectRoom& room,
            int* most_sharing, cudaStream_t stream);
  void clear() { count_ = 0; }
  /// `t` with stacks for blocks, if there are any.
  CudaTables of(CudaTables t) const;
  int count() const { return count_; }
  std::size_t bytes() const;
  /// What they would take, at most.
  static std::size_t bytes_for(const HostTables& t, const std::vector<Block*>& blocks, int at_once);

 private:
  int count_ = 0;
  DeviceArray<CudaBlock> blocks_;
  DeviceArray<CudaBundle> bundles_;
  DeviceArray<std::int32_t> slot_node_;
  DeviceArray<std::uint32_t> slot_parts_, parts_;
  DeviceArray<uint4> first_parts_;
};

}  // namespace tissue_sim
