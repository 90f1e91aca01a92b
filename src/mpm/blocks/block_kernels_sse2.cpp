#include "mpm/blocks/kernel_set.h"

namespace tissue_sim {
namespace {

TISSUE_SIM_KERNELS(sse2, 4, )

}  // namespace

const BlockKernels& block_kernels_sse2() { return kKernels_sse2; }

const BlockKernels& block_kernels(InstructionSet set) {
#if defined(__x86_64__)
  if (set == InstructionSet::kAvx512) return block_kernels_avx512();
  if (set == InstructionSet::kAvx2) return block_kernels_avx2();
#endif
  (void)set;
  return block_kernels_sse2();
}

}  // namespace tissue_sim
