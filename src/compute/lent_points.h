// Clouds on the GPU that outlive the call that wrote them.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "compute/device_array.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// Memory that is lent to who reads a cloud; once nobody holds it any more it is used again.
class LentPoints {
 public:
  DeviceArray<std::uint8_t>& take(std::size_t bytes) {
    if (!memory_ || memory_.use_count() > 1) {
      memory_ = std::make_shared<DeviceArray<std::uint8_t>>();
    }
    memory_->resize(bytes);
    return *memory_;
  }
  /// What was taken last, once `stream` has written it.
  GpuPoints lend(int count, cudaStream_t stream) const {
    check_cuda(cudaStreamSynchronize(stream), "write a cloud");
    GpuPoints points;
    check_cuda(cudaGetDevice(&points.gpu), "be asked");
    points.bytes = std::shared_ptr<const void>(memory_, memory_->data());
    points.count = count;
    return points;
  }
  /// A cloud that was made on the host.
  GpuPoints lend(const std::vector<std::uint8_t>& cloud, int count, cudaStream_t stream) {
    take(cloud.size()).upload(cloud, stream);
    return lend(count, stream);
  }

 private:
  std::shared_ptr<DeviceArray<std::uint8_t>> memory_;
};

}  // namespace tissue_sim
