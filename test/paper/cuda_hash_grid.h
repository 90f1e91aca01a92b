// Fragments by hash grid on the GPU: what paper/hash_grid.h finds, of places that are there.
#pragma once

#include <cstdint>

#include "compute/device_array.h"
#include "paper/cell_box.h"

namespace tissue_sim {

/// Minimum labels (algorithm 1 of Sung, Kim and Shin, Electronics 13:1340, 2024) by union-find
/// (Jaiganesh and Burtscher, HPDC 2018) over the lowest points of the cells. Keeps its memory from
/// one search to the next.
class CudaHashGrid {
 public:
  /// Enqueues a search on `stream`. `places.x` are on the GPU and stay there until it is done.
  void find_groups(const PointPlaces& places, const CellBox& box, cudaStream_t stream);
  /// Waits for it. Returns how many groups there are. Throws std::invalid_argument for a point
  /// outside of the box.
  std::int32_t wait(cudaStream_t stream);

  /// Of each point its group, numbered from 0 on by their lowest point; on the GPU.
  const DeviceArray<std::int32_t>& of_point() const { return of_point_; }
  /// Points of each group, as many as wait() said; on the GPU.
  const DeviceArray<std::int32_t>& count() const { return count_; }

 private:
  DeviceArray<std::int32_t> lowest_;  ///< of each cell of the box, or of each place of the table
  DeviceArray<std::int64_t> key_;     ///< of each place of the table
  DeviceArray<std::int32_t> cell_;    ///< of each point
  DeviceArray<std::int32_t> parent_, number_, of_point_, count_, found_;
  DeviceArray<std::uint8_t> scan_;  ///< room that CUB asks for
  PinnedArray<std::int32_t> on_host_;
};

}  // namespace tissue_sim
