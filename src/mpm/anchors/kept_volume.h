// What anchors keep of points in cells at their faces (mpm/blocks/fill_region.cpp).
#pragma once

#include "compute/host_device.h"
#include "mpm/blocks/stabilisation.h"

namespace tissue_sim {

/// It is a share kStabilisation, and no larger than this, as little else is [m^3]. Its nodes, which
/// nothing else holds, move by cells; how stiff it is for that is no matter.
TISSUE_SIM_INLINE float kept_volume(float cell_size) {
  const float half = 0.5f * cell_size;
  return 2 * kStabilisation * half * half * half;
}

}  // namespace tissue_sim
