// The linearised motion of the tissue on the GPU: see mpm/linearised_motion.h.
#pragma once

#include <cstddef>
#include <functional>

#include "compute/device_array.h"
#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// What the linearised motion works in, kept from measure to measure.
struct CudaMotionRoom {
  static constexpr int kFields = 5;
  float4* fields[kFields];     ///< of all nodes, that nobody else needs meanwhile
  DeviceArray<float> largest;  ///< component of v
  DeviceArray<double2> part_sum;
  DeviceArray<float> part_largest;
  PinnedArray<double2> host_sum;
};

/// For largest_eigenvalue(). Waits for the GPU once a step; gives the same bits each time.
class CudaLinearisedMotion {
 public:
  /// Enqueues a substep of a second from rest, without contact, gravity and drag.
  using Substep = std::function<void(const CudaNodes& from, const CudaNodes& to)>;
  /// Enqueues what takes out of a field of the nodes what anchors' faces hold; empty for nothing.
  using Hold = std::function<void(float4* field)>;

  /// About `present`; `scratch` is of the same size, and overwritten where nodes have mass.
  /// `small`: largest displacement [m].
  CudaLinearisedMotion(const CudaNodes& present, const CudaNodes& scratch, std::size_t node_count,
                       float small, Substep substep, Hold hold, CudaMotionRoom& room,
                       cudaStream_t stream);

  void start();
  double apply();
  double orthogonalise(double along_v, double along_before);
  void next(double length);

 private:
  /// Moves the nodes by v, scaled to a small motion, and leaves accelerations in scratch_.v.
  void accelerate();
  /// What the partial sums of the last kernel come to.
  double2 sum();
  /// Brings largest_ up to date with the partial maxima of the last kernel.
  void find_largest();

  CudaNodes present_, scratch_;
  int count_, parts_;
  float small_;
  Substep substep_;
  Hold hold_;
  cudaStream_t stream_;
  CudaMotionRoom& room_;
  float4 *u_, *rates_, *at_rest_, *before_, *v_;
  double w_square_ = 0, along_v_ = 0, along_before_ = 0;
};

}  // namespace tissue_sim
