// How long substeps and parts of a frame are, within what is stable.
#pragma once

#include <cmath>

#include "frame/part_substeps.h"

namespace tissue_sim {

constexpr int kShortestPart = 6;  // substeps

/// Substeps change little by little, and parts of a frame become shorter where tissue stiffens.
class StepLength {
 public:
  /// A part took `passed` [s], in which stiffness grew by `trend` at most; a frame takes `frame`.
  void follow(double passed, double trend, double frame);
  /// The substep where `predicted` is stable [s]. `at_once`: it is this, however long the last one
  /// was. `undamped`: tissue that nothing damps swings for long, and each change of its substeps
  /// would add to its energy, so they are as short as the shortest of a swing.
  double choose(double time, double predicted, double trend, bool at_once, bool undamped);
  /// A part of `time` [s] at most, with substeps of `longest` after one of `before` [s] (0: none);
  /// no longer than `most` [s], but kShortestPart substeps.
  PartSubsteps part(double time, double longest, double before, double most) const;

 private:
  template <class Archive>
  friend void fields(Archive& archive, StepLength& x);  // frame/state_fields.h

  double held(double time, double predicted);

  double part_ = INFINITY;  ///< how long the next part may be [s], ...
  double most_ = 0;  ///< ... and its first substep, until they are as short as they should be
  double held_ = INFINITY;                                                 ///< see choose() [s]
  double of_swing_ = INFINITY, of_last_swing_ = INFINITY, swing_end_ = 0;  ///< the same
};

}  // namespace tissue_sim
