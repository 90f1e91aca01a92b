// Shares of their stiffness that cells and points keep where there are few of them.
#pragma once

#include "compute/host_device.h"

namespace tissue_sim {

/// Of a cell that holds few points: mpm/blocks/stabilisation.h.
inline constexpr float kStabilisation = 0.01f;
/// A cell with this many points needs none: seven leave no motion loose, while pieces of cells with
/// five or six may have motions thirty times as soft as with stabilisation.
inline constexpr int kSteadyCount = 7;
/// The share of its stiffness that a soft point keeps (mpm/tear/debris.h): its substep is then
/// about that of whole tissue.
inline constexpr float kSoftness = 1.0f / 3;

/// A piece that was cut off with at most this many points, a cell's worth, is a bit of debris.
inline constexpr int kDebrisPoints = 8;

/// What anchors keep of points in cells at their faces (mpm/blocks/fill_region.cpp) is a share
/// kStabilisation, and no larger than this, as little else is [m^3]. Its nodes, which
/// nothing else holds, move by cells; how stiff it is for that is no matter.
TISSUE_SIM_INLINE float kept_volume(float cell_size) {
  const float half = 0.5f * cell_size;
  return 2 * kStabilisation * half * half * half;
}

}  // namespace tissue_sim
