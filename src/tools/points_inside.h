// What to say of tissue that lies in a tool.
#pragma once

#include <string>

#include "tissue_sim/scene.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// Fills the result's points_inside and inside_depth from its loads.
void sum_inside(FrameResult& result);

/// For each tool that has points in it: "12 points of tissue lie in tool 'probe', ...", how deep,
/// and cells of which size would hold them off. So also for a tip that touches tissue and is so
/// thin that it may pass through without any point in it. "" where there is nothing to say.
std::string inside_warning(const Scene& scene, const FrameResult& result);

}  // namespace tissue_sim
