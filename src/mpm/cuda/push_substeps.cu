// The kernels with tools, apart from the others to be compiled beside them.
#include "mpm/cuda/substep_kernels.h"

namespace tissue_sim {

CudaKernel pushing_kernel(const CudaPlan& plan) { return kernel_of<Can::kPushes>(plan); }

}  // namespace tissue_sim
