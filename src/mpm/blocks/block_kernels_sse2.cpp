#include "mpm/blocks/kernel_set.h"

namespace tissue_sim {
namespace {

TISSUE_SIM_KERNELS(sse2, 4, )

}  // namespace

const BlockKernels& block_kernels_sse2() { return kKernels_sse2; }

}  // namespace tissue_sim
