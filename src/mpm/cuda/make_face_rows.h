// The tables of CudaHeldFaces, made on the host from AnchorFaces and the blocks.
#pragma once

#include <vector>

#include "mpm/cuda/face_rows.h"
#include "mpm/cuda/make_tables.h"

namespace tissue_sim {

struct HostFaceRows {
  std::vector<CudaFaceChunk> chunks;
  std::vector<int> first_carried;
  std::vector<CudaFaceEntry> entries;
  std::vector<CudaFaceShare> shares;
  std::vector<CudaFaceRow> rows;
  std::vector<CudaCarriedNode> carried;
  std::size_t room_each = 0;  ///< of a bundle, for chunks that are large [floats]
};

/// For the bundles of `tables`, whose thread blocks have `room` floats for a chunk.
HostFaceRows make_face_rows(const MpmState& state, const HostTables& tables, int room);

}  // namespace tissue_sim
