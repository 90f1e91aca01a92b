// Substeps of a length that a test chooses: the steps of a frame without SubstepChoice.
#pragma once

#include "mpm/mpm_tissue.h"

namespace tissue_sim {

struct FixedSubsteps {
  static void advance(MpmTissue& tissue, int substeps, float dt, const FrameInput& input) {
    const double duration = static_cast<double>(substeps) * dt;
    tissue.begin_frame(duration, input, {tissue.scene(), input, duration});
    if (substeps == 0) tissue.measured(tissue.device_->measure(kMeasureMotion));
    for (int done = 0; done < substeps;) {
      tissue.measured_ = tissue.followed_ = false;
      const int ran = tissue.device_->run_part(
          {even_substeps(substeps - done, dt), static_cast<double>(done) / substeps, 1});
      tissue.run_->result.substep = dt;
      tissue.run_->result.substeps += ran;
      done += ran;
      tissue.measured(tissue.device_->measure_part(kMeasureMotion));
      tissue.tear(static_cast<double>(done) / substeps);
    }
    if (!tissue.run_->result.blew_up) tissue.end_frame();
  }
  static void keep(MpmTissue& tissue) { tissue.save_checkpoint(); }
  static void go_back(MpmTissue& tissue) { tissue.reject_part(Verdict::kTooLong); }
};

/// Advances by `substeps` of `dt` seconds each; 0 only cuts.
inline void advance_by(MpmTissue& tissue, int substeps, float dt, const FrameInput& input) {
  FixedSubsteps::advance(tissue, substeps, dt, input);
}

}  // namespace tissue_sim
