// The kernels with fronts of cuts, apart from the others to be compiled beside them.
#include "mpm/cuda/substep_kernels.h"

namespace tissue_sim {

CudaKernel front_kernel(const CudaPlan& plan) { return kernel_of<Can::kFronts>(plan); }

}  // namespace tissue_sim
