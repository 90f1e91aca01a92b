#include "mls/kernels.h"

#include "mls/passes.h"

namespace tissue_sim {
namespace {

#define TISSUE_SIM_MLS_KERNELS(suffix, W, target)                                             \
  target void spread_##suffix(const MlsField& f, int chunk) { mls_passes::spread(f, chunk); } \
  target void stresses_##suffix(const MlsField& f, int chunk) {                               \
    mls_passes::stresses<W>(f, chunk);                                                        \
  }                                                                                           \
  target void forces_##suffix(const MlsField& f, int chunk, float* out) {                     \
    mls_passes::forces<W>(f, chunk, out);                                                     \
  }                                                                                           \
  target MlsMeasure measure_##suffix(const MlsField& f, int chunk, float* von_mises,          \
                                     float* stiffening) {                                     \
    return mls_passes::measure<W>(f, chunk, von_mises, stiffening);                           \
  }

TISSUE_SIM_MLS_KERNELS(sse2, 4, )
#if defined(__x86_64__)
TISSUE_SIM_MLS_KERNELS(avx2, 8, TISSUE_SIM_TARGET_AVX2)
TISSUE_SIM_MLS_KERNELS(avx512, 16, TISSUE_SIM_TARGET_AVX512)
#endif

}  // namespace

const MlsKernels& mls_kernels(InstructionSet set) {
  static constexpr MlsKernels sse2 = {spread_sse2, stresses_sse2, forces_sse2, measure_sse2};
#if defined(__x86_64__)
  static constexpr MlsKernels avx2 = {spread_avx2, stresses_avx2, forces_avx2, measure_avx2};
  static constexpr MlsKernels avx512 = {spread_avx512, stresses_avx512, forces_avx512,
                                        measure_avx512};
  if (set == InstructionSet::kAvx512) return avx512;
  if (set == InstructionSet::kAvx2) return avx2;
#endif
  (void)set;
  return sse2;
}

}  // namespace tissue_sim
