// Where the arrow of a force on a tool stands, so that it can be read.
#pragma once

#include "tissue_sim/fragments.h"
#include "tissue_sim/tool.h"

namespace tissue_sim {

struct ForceArrow {
  Vec3 start = Vec3::Zero(), end = Vec3::Zero();  ///< [m], along the force
  Vec3 label = Vec3::Zero();                      ///< middle of its text [m]
  double unit = 0;         ///< what sizes go by: half as thick as the tool is, 0.5 to 5 mm [m]
  double text_height = 0;  ///< [m]
};

/// The arrow stands beside the shaft, where this has come out of the boxes of all pieces: at the
/// tip it would lie in tool and tissue. It is four units and, for each newton, `scale` [m/N] long,
/// so that a small force shows, and a larger one is longer. False for less than 0.005 N, which
/// would read 0.00.
bool place_force_arrow(const Tool& tool, const Pose& pose, const Vec3& force, double scale,
                       Span<const Fragment> pieces, ForceArrow& arrow);

}  // namespace tissue_sim
