// The linearised motion of the tissue on the GPU: see mpm/linearised_motion.h.
#pragma once

#include <cstddef>
#include <functional>

#include "compute/device_array.h"
#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// For largest_eigenvalue(). Waits for the GPU at each step; gives the same bits each time.
class CudaLinearisedMotion {
 public:
  /// Enqueues a substep of a second from rest, without contact, gravity and drag.
  using Substep = std::function<void(const CudaNodes& from, const CudaNodes& to)>;

  /// About `present`; `scratch` is of the same size, and overwritten where nodes have mass.
  CudaLinearisedMotion(const CudaNodes& present, const CudaNodes& scratch, std::size_t node_count,
                       double cell_size, Substep substep, cudaStream_t stream);

  void start();
  double apply();
  double orthogonalise(double along_v, double along_before);
  void next(double length);

 private:
  /// Moves the nodes by `scale` v and leaves accelerations in scratch_.v.
  void accelerate(float scale);
  /// What the partial sums, and maxima, of the last kernel come to.
  double sum();
  float largest();

  CudaNodes present_, scratch_;
  int count_, parts_;
  double cell_size_;
  Substep substep_;
  cudaStream_t stream_;
  DeviceArray<float4> u_, rates_, at_rest_, before_, v_;
  float4 *before_at_, *v_at_;  ///< which of the two is which
  float largest_ = 0;          ///< component of v
  DeviceArray<double> part_sum_;
  DeviceArray<float> part_largest_;
  PinnedArray<double> host_sum_;
  PinnedArray<float> host_largest_;
};

}  // namespace tissue_sim
