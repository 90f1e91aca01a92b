// Which poses make sense, for all that take any.
#pragma once

#include <string>

#include "tissue_sim/types.h"

namespace tissue_sim {

constexpr double kFarthestPlace = 1e6;  ///< that anything is from the world's origin [m]

enum class PoseFault { kNone, kNotFinite, kTooFar, kNoRotation };

/// The quaternion's norm may be off 1 by `rounding`.
PoseFault fault_of(const Pose& pose, double rounding);

/// What is wrong with it, as it follows its name: "is not finite..."; "" for nothing.
std::string problem_of(const Pose& pose, double rounding);
/// Throws std::invalid_argument for a pose, called `what`, that is not finite, no rotation or more
/// than 1e6 m from the origin.
void check_pose(const Pose& pose, const std::string& what);

/// Gives it a unit quaternion; one that is a unit already keeps its bits.
void normalise(Pose& pose);

}  // namespace tissue_sim
