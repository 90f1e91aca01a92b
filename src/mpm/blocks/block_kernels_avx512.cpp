#include "mpm/blocks/kernel_set.h"

#if defined(__x86_64__)
namespace tissue_sim {
namespace {

TISSUE_SIM_KERNELS(avx512, 16, TISSUE_SIM_TARGET_AVX512)

}  // namespace

const BlockKernels& block_kernels_avx512() { return kKernels_avx512; }

}  // namespace tissue_sim
#endif
