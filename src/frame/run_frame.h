// The order of a frame of tissue that moves by adaptive explicit substeps, on any device.
#pragma once

#include "frame/part_substeps.h"
#include "tissue_sim/limits.h"
#include "tissue_sim/tissue.h"
#include "tools/frame_colliders.h"

namespace tissue_sim {

/// Substeps that lead from one share (0 to 1) of a frame to another.
struct FramePart {
  PartSubsteps substeps;
  double from = 0, to = 0;
  int done = 0;  ///< of them: fewer where tissue came past its limit

  double reached() const { return done == substeps.count ? to : substeps.share(done, from, to); }
};

/// What a part of a frame came to.
enum class Verdict {
  kAccepted,
  kTooLong,        ///< its substeps were longer than what the tissue bore at its end
  kMissedContact,  ///< tissue came to an instrument that no list of contacts had predicted
};

/// Runs a frame in parts: bonds that snap, or what a fast tool squeezes, may stiffen tissue twofold
/// within a frame. What a method has, on any device:
///   scene()                       as the frame's gravity and damping leave it
///   begin_frame(duration, input, colliders)
///                                 cuts of the service; which tissue may meet the colliders
///   choose_substeps(input, time)  the substeps of the next part, of the time that is left [s]
///   save_checkpoint()             of all that a part changes until something is cut or tears
///   device().run_part(part)       the substeps, tools interpolated over them; ends early where
///                                 tissue is past its limit. Returns how many were done
///   judge_part(part)              measures what the part left
///   reject_part(verdict)          back to the checkpoint; the next substeps are shorter
///   accept_part()                 what was measured counts. False: the tissue blew up
///   break_bonds(share)            blades cut their way so far, then what is past its limit tears
///   end_frame()                   blades cut what is left of their way; pieces get their ids
template <class Method>
class SteppedTissue : public Tissue {
 public:
  void advance(double duration, const FrameInput& frame) final {
    Method& tissue = static_cast<Method&>(*this);
    FrameInput input = frame;
    tissue.begin_frame(duration, input, FrameColliders(tissue.scene(), input, duration));
    for (double from = 0; from < 1;) {
      stop_if_asked();
      const double time = duration * (1 - from);
      FramePart part;
      part.substeps = tissue.choose_substeps(input, time);
      part.from = from;
      const double taken = part.substeps.until(part.substeps.count) / time;
      part.to = taken > 1 - 1e-9 ? 1 : from + (1 - from) * taken;
      tissue.save_checkpoint();
      part.done = tissue.device().run_part(part);
      const Verdict verdict = tissue.judge_part(part);
      if (verdict != Verdict::kAccepted) {
        tissue.reject_part(verdict);
        continue;
      }
      if (!tissue.accept_part()) return;
      from = part.reached();
      tissue.break_bonds(from);
      input.cuts = {};
    }
    tissue.end_frame();
  }
};

}  // namespace tissue_sim
