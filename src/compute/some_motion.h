// Motion of some nodes of a GPU on its way to the host and back.
#pragma once

#include <cstdint>
#include <vector>

#include "compute/device_array.h"

namespace tissue_sim {

/// Displacements and velocities of all nodes on the GPU; what else their fourth number has.
struct MotionOnGpu {
  float4 *u, *v;
};

/// Through memory that both see: a kernel each way and no copy, for a few thousand nodes are there
/// and back within a substep (DistantNodes).
class SomeMotion {
 public:
  /// First u of all these, then v: they stay until the next call. Waits.
  const float4* bring(const MotionOnGpu& from, const std::vector<std::int32_t>& nodes,
                      cudaStream_t stream);
  /// Room for both of so many, to be filled for send(); what was brought is there still.
  float4* room(std::size_t nodes, cudaStream_t stream);
  /// Enqueues: puts them into two states, for what no block moves must be the same in both. The
  /// room must not be touched until the stream was waited for.
  void send(const std::vector<std::int32_t>& nodes, const MotionOnGpu& to,
            const MotionOnGpu& and_to, cudaStream_t stream);

 private:
  void list(const std::vector<std::int32_t>& nodes, cudaStream_t stream);

  std::vector<std::int32_t> listed_;
  DeviceArray<std::int32_t> list_;
  PinnedArray<float4> motion_;
};

}  // namespace tissue_sim
