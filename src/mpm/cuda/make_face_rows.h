// The tables of CudaHeldFaces, made on the host from AnchorFaces and the blocks.
#pragma once

#include <vector>

#include "mpm/cuda/face_rows.h"
#include "mpm/cuda/make_tables.h"

namespace tissue_sim {

struct HostFaceRows {
  std::vector<CudaFaceChunk> chunks;
  std::vector<int> first_carried;
  std::vector<CudaHeldNode> held;  ///< in their `parts.x` a slot or kNoSlot, for launch_connect()
  std::vector<int> first_held;
  int most_held = 0;                   ///< of a bundle
  int most_items = 0;                  ///< the same and slots of nodes that are in no row
  bool grouped = false;                ///< there are rows with nodes in common
  std::vector<CudaFaceEntry> entries;  ///< the same
  std::vector<CudaFaceShare> shares;
  std::vector<CudaFaceRow> rows;
  std::vector<CudaCarriedNode> carried;
  bool carries_always = false;  ///< see CudaHeldFaces
  std::size_t room_each = 0;    ///< of a bundle, for chunks that are large [floats]
};

/// For the bundles of `tables`. A chunk comes to where columns give to a plane of so many slots.
HostFaceRows make_face_rows(const MpmState& state, const HostTables& tables, int plane_slots);

}  // namespace tissue_sim
