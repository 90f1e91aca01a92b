// Which points hold together, found on the GPU from their bonds.
#pragma once

#include <vector>

#include "compute/device_array.h"
#include "fragments/parted_run.h"

namespace tissue_sim {

/// The lattice of sites that points sit on.
struct SiteRows {
  const std::int32_t* point_at;  ///< [count], -1 for none
  int count;
  int row, plane;  ///< sites from one to the next along y and z
};

/// The lowest point of the piece of each point, kept from cut to cut.
class PieceLabels {
 public:
  bool empty() const { return lowest_.size() == 0; }
  void upload(const std::vector<std::int32_t>& lowest, cudaStream_t stream) {
    lowest_.upload(lowest, stream);
  }

  /// Labels the points of all bodies anew from their bonds, which only ever break, by union-find
  /// (Jaiganesh and Burtscher, A high-performance connected components implementation for GPUs,
  /// HPDC 2018). Returns the runs of points whose label changed, in order. Waits for the GPU.
  std::vector<PartedRun> update(const std::vector<SiteRows>& bodies, const std::uint8_t* bonds,
                                cudaStream_t stream);

 private:
  DeviceArray<std::int32_t> lowest_, next_;
  DeviceArray<PartedRun> begins_;
  DeviceArray<std::int32_t> ends_;
  DeviceArray<int> counts_;  ///< of both
  PinnedArray<int> host_counts_;
};

}  // namespace tissue_sim
