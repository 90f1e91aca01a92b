// Whether what is published of a frame can be: all numbers are finite, and no speed is beyond
// reason.
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
                              std::isfinite(l.grip_area) && std::isfinite(l.jaw_moment);
                     }) &&
         std::all_of(r.anchor_loads.begin(), r.anchor_loads.end(),
                     [](const Wrench& w) { return w.force.allFinite() && w.torque.allFinite(); });
}

/// Nothing that instruments do moves tissue at the speed of a bullet [m/s]: what does, or is no
/// number, is out of control.
inline bool is_out_of_control(double speed) { return !(speed < 300); }

inline bool is_out_of_control(const FrameResult& r) {
  return is_out_of_control(r.max_speed) || !is_finite(r);
}

}  // namespace tissue_sim
