// What faces of tissue push one another with in a substep, on the CPU.
#pragma once

#include <atomic>

#include "mls/state.h"

namespace tissue_sim {

/// Four works, each a block or a node at a time on any thread, each done before the next begins:
/// weights of pairs; how nodes turned, after the stresses; what pairs push; and what that comes to
/// for a node, of which the part that turns goes into its stress.
class MlsFaceSubstep {
 public:
  MlsFaceSubstep(MlsState& state, float dt);

  int nodes() const { return nodes_; }
  int node_blocks() const { return (nodes_ + kMlsFaceBlock - 1) / kMlsFaceBlock; }
  int pair_blocks() const { return pair_blocks_; }
  void weigh(int pair_block);
  void turn(int node_block);
  void push(int pair_block);
  void take(int node);

 private:
  /// One past the last block of which something is true.
  struct Last {
    std::atomic<int> end{0};
    void note(int block);
  };

  MlsState& s_;
  int nodes_ = 0, pair_blocks_ = 0;
  const MlsFaceKernels* kernels_ = nullptr;
  MlsFaceField field_{};
  Last felt_, touched_;
};

/// Brings what pairs remember back to MlsNodeContacts::slip, where they were made.
void return_slips(MlsNodeContacts& contacts);

}  // namespace tissue_sim
