// The kernels with contact of tissue with tissue, apart from the others to be compiled beside them.
#include "mpm/cuda/substep_kernels.h"

namespace tissue_sim {

CudaKernel touching_kernel(const CudaPlan& plan) { return kernel_of<Can::kTouches>(plan); }

}  // namespace tissue_sim
