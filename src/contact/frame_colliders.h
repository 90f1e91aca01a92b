// The colliders of a frame: the ground first, then a scene's tools.
#pragma once

#include <vector>

#include "contact/collider.h"
#include "tissue_sim/scene.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// Where they are at the share (0 to 1) of a frame of `duration` seconds.
std::vector<Collider> colliders_at(const Scene& scene, const FrameInput& input, double share,
                                   double duration);

/// What each of them sweeps during the frame; empty for a tool that is not there.
std::vector<Box> collider_reach(const Scene& scene, const FrameInput& input, double duration);

}  // namespace tissue_sim
