// What a stereo camera costs the simulation beside it, by the public API.
#pragma once

#include "tissue_sim/scene.h"

namespace tissue_sim {

/// Registers cameras/<cpu or cuda>/POINTS, where this build can render.
void add_camera_benchmarks(Device device);

}  // namespace tissue_sim
