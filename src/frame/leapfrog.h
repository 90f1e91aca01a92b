// Leapfrog whose substeps change.
#pragma once

#include <cmath>

namespace tissue_sim {

/// How long forces act on velocities in a substep of `dt` after one of `before` (0: none) [s].
/// Velocities belong to the middles of substeps, so half of the one and half of the other. If each
/// were kicked by its own substep alone, tissue would gain energy whenever it stiffens and softens
/// again, for substeps shorten while it is slowed down and lengthen while it is sped up.
inline float kick_of(float before, float dt) {
  const bool changes = before > 0 && std::fabs(before - dt) > 1e-4f * dt;
  return changes ? 0.5f * (before + dt) : dt;
}

}  // namespace tissue_sim
