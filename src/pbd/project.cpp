#include "pbd/project.h"

namespace tissue_sim {
namespace pbd {
namespace {

template <int W, class Kind, bool kKeep>
TISSUE_SIM_INLINE void project_lanes(const ConstraintBlock<Kind>& block, int lane, Vec<W> h,
                                     const float* x, float* moved, float* multipliers) {
  constexpr int kMultipliers = ConstraintSet<Kind>::kMultipliers;
  Vertex<Vec<W>> v[Kind::kVertices];
  for (int i = 0; i < Kind::kVertices; ++i) v[i] = gather<W>(x, moved, block.vertex[i] + lane);
  Vec<W> number[Kind::kNumbers], lambda[kMultipliers];
  for (int i = 0; i < Kind::kNumbers; ++i) {
    number[i] = *reinterpret_cast<const Vec<W>*>(block.number[i] + lane);
  }
  for (int i = 0; i < kMultipliers; ++i) {
    lambda[i] = kKeep ? load<W>(multipliers + i * kLanes + lane) : Vec<W>{};
  }
  project_kind<Kind, kKeep>(v, number, h, lambda);
  for (int i = 0; kKeep && i < kMultipliers; ++i) {
    store<W>(multipliers + i * kLanes + lane, lambda[i]);
  }
  for (int i = 0; i < Kind::kVertices; ++i) scatter<W>(moved, block.vertex[i] + lane, v[i]);
}

template <int W, class Kind>
TISSUE_SIM_INLINE void project_blocks(const ConstraintBlock<Kind>* blocks, int count,
                                      float inverse_h2, const float* x, float* moved,
                                      float* multipliers) {
  const Vec<W> h = inverse_h2 - Vec<W>{};
  if (multipliers == nullptr) {
    for (int b = 0; b < count; ++b) {
      for (int lane = 0; lane < kLanes; lane += W) {
        project_lanes<W, Kind, false>(blocks[b], lane, h, x, moved, nullptr);
      }
    }
    return;
  }
  for (int b = 0; b < count; ++b) {
    float* of = multipliers + b * ConstraintSet<Kind>::kMultipliers * kLanes;
    for (int lane = 0; lane < kLanes; lane += W) {
      project_lanes<W, Kind, true>(blocks[b], lane, h, x, moved, of);
    }
  }
}

#define TISSUE_SIM_PROJECTION(name, Kind, W, target)                                         \
  target void name(const ConstraintBlock<Kind>* b, int n, float h, const float* x, float* d, \
                   float* m) {                                                               \
    project_blocks<W, Kind>(b, n, h, x, d, m);                                               \
  }
#define TISSUE_SIM_PROJECTIONS(suffix, W, target)               \
  TISSUE_SIM_PROJECTION(distance_##suffix, Distance, W, target) \
  TISSUE_SIM_PROJECTION(bending_##suffix, Bending, W, target)   \
  TISSUE_SIM_PROJECTION(strain_##suffix, Strain, W, target)     \
  TISSUE_SIM_PROJECTION(elastic_##suffix, Elastic, W, target)   \
  TISSUE_SIM_PROJECTION(touch_##suffix, Touch, W, target)       \
  TISSUE_SIM_PROJECTION(damper_##suffix, Damper, W, target)

TISSUE_SIM_PROJECTIONS(sse2, 4, )
#if defined(__x86_64__)
TISSUE_SIM_PROJECTIONS(avx2, 8, TISSUE_SIM_TARGET_AVX2)
TISSUE_SIM_PROJECTIONS(avx512, 16, TISSUE_SIM_TARGET_AVX512)
#endif

}  // namespace

const Projections& projections(InstructionSet set) {
  static constexpr Projections sse2 = {distance_sse2, bending_sse2, strain_sse2,
                                       elastic_sse2,  touch_sse2,   damper_sse2};
#if defined(__x86_64__)
  static constexpr Projections avx2 = {distance_avx2, bending_avx2, strain_avx2,
                                       elastic_avx2,  touch_avx2,   damper_avx2};
  static constexpr Projections avx512 = {distance_avx512, bending_avx512, strain_avx512,
                                         elastic_avx512,  touch_avx512,   damper_avx512};
  if (set == InstructionSet::kAvx512) return avx512;
  if (set == InstructionSet::kAvx2) return avx2;
#endif
  (void)set;
  return sse2;
}

}  // namespace pbd
}  // namespace tissue_sim
