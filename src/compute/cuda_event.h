// A point in what a stream was told to do, for which the host can wait.
#pragma once

#include "compute/cuda_check.h"

namespace tissue_sim {

class CudaEvent {
 public:
  CudaEvent() = default;
  ~CudaEvent() {
    if (event_ != nullptr) cudaEventDestroy(event_);
  }
  CudaEvent(const CudaEvent&) = delete;
  CudaEvent& operator=(const CudaEvent&) = delete;

  /// After all that the stream was told so far.
  void record(cudaStream_t stream) {
    if (event_ == nullptr) {
      check_cuda(cudaEventCreateWithFlags(&event_, cudaEventDisableTiming), "make an event");
    }
    check_cuda(cudaEventRecord(event_, stream), "go on");
  }
  /// Waits until the GPU has come there; not before it was recorded.
  void wait() const { check_cuda(cudaEventSynchronize(event_), "finish what it was told"); }

 private:
  cudaEvent_t event_ = nullptr;
};

}  // namespace tissue_sim
