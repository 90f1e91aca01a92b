#include "mpm/blocks/kernel_set.h"

#if defined(__x86_64__)
namespace tissue_sim {
namespace {

TISSUE_SIM_KERNELS(avx2, 8, TISSUE_SIM_TARGET_AVX2)

}  // namespace

const BlockKernels& block_kernels_avx2() { return kKernels_avx2; }

}  // namespace tissue_sim
#endif
