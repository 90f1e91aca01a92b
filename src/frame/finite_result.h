// Whether all numbers that are published of a frame are finite.
#pragma once

#include <algorithm>
#include <cmath>

#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// A load may be none where all places still are: tissue that blows up does so at its ends first.
inline bool is_finite(const FrameResult& r) {
  return std::isfinite(r.kinetic_energy) && std::isfinite(r.elastic_energy) &&
         std::isfinite(r.max_speed) && std::isfinite(r.inside_depth) &&
         std::all_of(r.loads.begin(), r.loads.end(),
                     [](const ToolLoad& l) {
                       return l.mean.force.allFinite() && l.mean.torque.allFinite() &&
                              std::isfinite(l.peak_force) && std::isfinite(l.grip) &&
                              std::isfinite(l.grip_area);
                     }) &&
         std::all_of(r.anchor_loads.begin(), r.anchor_loads.end(),
                     [](const Wrench& w) { return w.force.allFinite() && w.torque.allFinite(); });
}

}  // namespace tissue_sim
