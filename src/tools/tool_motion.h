// Where tools are within a frame, and what they are to the tissue.
#pragma once

#include <vector>

#include "contact/collider.h"
#include "tissue_sim/cut.h"
#include "tissue_sim/scene.h"
#include "tissue_sim/tissue.h"
#include "tissue_sim/tool.h"

namespace tissue_sim {

/// Pose at the share `s` (0 to 1) of the frame.
Pose pose_at(const ToolMotion& motion, double s);

/// The tool's shape at the share `s` of a frame that lasts `duration` seconds.
Collider tool_collider(const Tool& tool, int index, const ToolMotion& motion, double s,
                       double duration);

/// The path of a scalpel's edge over the frame: down its front from the heel to the tip and along
/// its lower end to the spine, so that it cuts when it is drawn and when it is stabbed.
BladePath blade_path(const Tool& tool, const ToolMotion& motion);

/// The paths of all scalpels that are there, from the share `begin` of the frame to `end`.
std::vector<BladePath> blade_paths(const Scene& scene, const FrameInput& input, double begin,
                                   double end);

}  // namespace tissue_sim
