// The kernels of whole tissue away from all tools, apart from the others to be compiled beside
// them.
#include "mpm/cuda/substep_kernels.h"

namespace tissue_sim {

CudaKernel plain_kernel(const CudaPlan& plan) { return kernel_of<Can::kPlain>(plan); }

}  // namespace tissue_sim
