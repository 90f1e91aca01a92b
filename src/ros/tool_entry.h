// ToolEntry: a tool that is placed in tissue comes into it along its shaft.
#pragma once

#include <string>

#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// Of one tool, in the simulation's thread. What it makes of a pose goes into the inputs, so a
/// replay does alike.
class ToolEntry {
 public:
  /// The tool is placed at this pose. Returns what there is to say of it, "" if it is free there.
  std::string place(const Tool& tool, const Pose& pose, double jaw, double cell_size,
                    Tissue& tissue);
  /// Where the tool is that shall be at `pose`: drawn back by what is left of the way in, which
  /// grows shorter by each call, one a frame of `frame_time` [s].
  Pose next(const Pose& pose, double frame_time);

 private:
  double left_ = 0;  // [m]
};

}  // namespace tissue_sim
