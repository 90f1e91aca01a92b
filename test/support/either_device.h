// Tests that run on the CPU and, where there is one, on the GPU.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <type_traits>

#include "mpm/mpm_tissue.h"
#include "support/fixed_substeps.h"
#if defined(TISSUE_SIM_CUDA)
#include "compute/cuda_check.h"
#include "support/cuda_mpm_tissue.h"
#endif

namespace tissue_sim {

/// Nodes and contacts from, and nodes to, where the tissue lives.
inline void pull(MpmTissue&) {}
inline void push(MpmTissue& tissue) { measure_motion(tissue.state()); }
inline std::string why_not(const MpmTissue*) { return ""; }
#if defined(TISSUE_SIM_CUDA)
inline void pull(CudaMpmTissue& tissue) { tissue.pull(); }
inline void push(CudaMpmTissue& tissue) {
  tissue.push();
  advance_by(tissue, 0, 1e-4f, {});
  tissue.finish();
}
inline std::string why_not(const CudaMpmTissue*) { return why_no_gpu(); }
using Tissues = testing::Types<MpmTissue, CudaMpmTissue>;
#else
using Tissues = testing::Types<MpmTissue>;
#endif

template <class T>
class OnEitherDevice : public testing::Test {
 protected:
  void SetUp() override {
    const std::string why = why_not(static_cast<const T*>(nullptr));
    if (!why.empty()) GTEST_SKIP() << why;
  }
};
struct DeviceName {
  template <class T>
  static std::string GetName(int) {
    return std::is_same<T, MpmTissue>::value ? "OnCpu" : "OnGpu";
  }
};
constexpr double kFrame = 1.0 / 60;

template <class T>
FrameResult advance_frame(T& tissue) {
  const int n = static_cast<int>(std::ceil(kFrame / tissue.stable_substep()));
  advance_by(tissue, n, static_cast<float>(kFrame / n), {});
  return tissue.finish();
}

template <class T>
FrameResult advance(T& tissue, double seconds) {
  FrameResult result;
  for (int f = 0; f < std::lround(seconds / kFrame); ++f) result = advance_frame(tissue);
  return result;
}

/// Contacts of tissue with tissue that touch.
inline int touching(const MpmState& s) {
  int count = 0;
  for (const std::int32_t i : s.faces.active) count += s.faces.all[i].touching ? 1 : 0;
  return count;
}

}  // namespace tissue_sim
