// The tables of CudaHeldFaces, made on the host from AnchorFaces and the blocks.
#pragma once

#include <vector>

#include "mpm/cuda/face_rows.h"
#include "mpm/cuda/make_tables.h"

namespace tissue_sim {

/// Nodes that rows have or an anchor carries, numbered as they follow one another.
struct HeldNodes {
  std::vector<std::int32_t> number;   ///< per node, -1 for others
  std::vector<std::int32_t> group;    ///< of each, whose rows move it; -1
  std::vector<std::int32_t> carried;  ///< of each, its place in AnchorFaces::held; -1
};

/// Kept from one time to the next: its memory is.
struct HostFaceRows {
  bool is_new = false;  ///< made with the tables of blocks, to go up after them
  HeldNodes nodes;
  std::vector<CudaFaceChunk> chunks;
  std::vector<int> first_carried;
  std::vector<CudaHeldNode> held;  ///< in their `parts.x` a slot or kNoSlot, for launch_connect()
  std::vector<int> first_held;
  int most_held = 0;                   ///< of a bundle
  std::vector<CudaFaceEntry> entries;  ///< the same
  std::vector<CudaFaceShare> shares;
  std::vector<CudaFaceRow> rows;
  std::vector<CudaCarriedNode> carried;
  bool carries_always = false;  ///< see CudaHeldFaces
  std::size_t room_each = 0;    ///< of a bundle, for chunks that are large [floats]

  void clear();
};

/// Makes `to` for the bundles of `tables`. A chunk comes to where columns give to a plane of so
/// many slots.
void make_face_rows(const MpmState& state, const HostTables& tables, int plane_slots,
                    HostFaceRows& to);

}  // namespace tissue_sim
