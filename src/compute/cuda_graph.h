// Kernels that are launched again and again, one after the other, as one thing.
#pragma once

#include "compute/cuda_check.h"

namespace tissue_sim {

class CudaGraph {
 public:
  CudaGraph() = default;
  ~CudaGraph() { clear(); }
  CudaGraph(const CudaGraph&) = delete;
  CudaGraph& operator=(const CudaGraph&) = delete;

  bool is_empty() const { return graph_ == nullptr; }
  void clear() {
    if (graph_ != nullptr) cudaGraphExecDestroy(graph_);
    graph_ = nullptr;
  }
  /// Keeps what `enqueue` tells the stream, which does not do it now.
  template <class F>
  void record(cudaStream_t stream, const F& enqueue) {
    clear();
    check_cuda(cudaStreamBeginCapture(stream, cudaStreamCaptureModeThreadLocal), "record kernels");
    cudaGraph_t graph = nullptr;
    try {
      enqueue();
    } catch (...) {
      cudaStreamEndCapture(stream, &graph);
      if (graph != nullptr) cudaGraphDestroy(graph);
      throw;
    }
    check_cuda(cudaStreamEndCapture(stream, &graph), "record kernels");
    const cudaError_t made = cudaGraphInstantiateWithFlags(&graph_, graph, 0);
    cudaGraphDestroy(graph);
    if (made != cudaSuccess) graph_ = nullptr;
    check_cuda(made, "make a graph of kernels");
  }
  void launch(cudaStream_t stream) const {
    check_cuda(cudaGraphLaunch(graph_, stream), "start a graph of kernels");
  }

 private:
  cudaGraphExec_t graph_ = nullptr;
};

}  // namespace tissue_sim
