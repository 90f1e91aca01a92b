// How a tissue is spread over a GPU: the shape of its blocks and the threads for them.
#pragma once

#include <vector>

#include "mpm/blocks.h"
#include "mpm/cuda/substeps.h"

namespace tissue_sim {

struct CudaShape {
  BlockShape blocks;
  int parts = 1;  ///< see CudaPlan
  int threads = 64;
};

/// The shape for these bodies that a model of the substep's time finds fastest, on a GPU with so
/// many multiprocessors and so much shared memory for a thread block. The environment variable
/// TISSUE_SIM_CUDA_SHAPE="x y z parts threads" overrules it, for measurements.
CudaShape choose_shape(const std::vector<LatticeBody>& bodies, int processors,
                       std::size_t shared_bytes);

}  // namespace tissue_sim
