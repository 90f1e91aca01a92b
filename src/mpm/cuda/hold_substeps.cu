// The kernels of whole tissue that anchors hold at flat faces, apart from the others to be compiled
// beside them.
#include "mpm/cuda/substep_kernels.h"

namespace tissue_sim {

CudaKernel holding_kernel(const CudaPlan& plan) { return kernel_of<Can::kHolds>(plan); }

}  // namespace tissue_sim
