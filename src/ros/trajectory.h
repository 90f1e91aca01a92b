// A file of timed poses and jaw angles.
#pragma once

#include <string>
#include <vector>

#include "tissue_sim/types.h"

namespace tissue_sim {

struct TimedSample {
  double time = 0;  ///< [s]
  Pose pose;
  double jaw = 0;  ///< [rad]
};

/// Reads CSV (columns t, x, y, z, qx, qy, qz, qw and, if there is one, jaw; a first line of names
/// and lines that start with # are skipped) or, by the ending .yaml, a list of maps {t, position:
/// [x, y, z], orientation: [x, y, z, w], jaw}. Throws std::invalid_argument, with the line, for
/// what is missing, not finite or no rotation, and for times that do not increase.
std::vector<TimedSample> load_trajectory(const std::string& path);

/// Position and jaw linear, orientation slerp; before the first and after the last it rests there.
TimedSample sample_at(const std::vector<TimedSample>& trajectory, double time);

}  // namespace tissue_sim
