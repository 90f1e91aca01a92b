#include "tools/pose_fault.h"

#include <cmath>
#include <stdexcept>

namespace tissue_sim {

PoseFault fault_of(const Pose& pose, double rounding) {
  if (!pose.position.allFinite() || !pose.orientation.coeffs().allFinite()) {
    return PoseFault::kNotFinite;
  }
  if (!(pose.position.cwiseAbs().maxCoeff() <= kFarthestPlace)) return PoseFault::kTooFar;
  const bool is_rotation = std::fabs(pose.orientation.norm() - 1) <= rounding;
  return is_rotation ? PoseFault::kNone : PoseFault::kNoRotation;
}

std::string problem_of(const Pose& pose, double rounding) {
  switch (fault_of(pose, rounding)) {
    case PoseFault::kNone:
      break;
    case PoseFault::kNotFinite:
      return "is not finite: a value is NaN or infinite";
    case PoseFault::kTooFar:
      return "is more than 1e6 m away: no instrument is";
    case PoseFault::kNoRotation:
      return "has a quaternion of norm " + std::to_string(pose.orientation.norm()) +
             ": it must be 1, or it is no rotation";
  }
  return "";
}

void check_pose(const Pose& pose, const std::string& what) {
  const std::string problem = problem_of(pose, 1e-3);
  if (!problem.empty()) throw std::invalid_argument(what + " " + problem);
}

void normalise(Pose& pose) {
  const bool is_unit = std::fabs(pose.orientation.squaredNorm() - 1) < 1e-15;
  if (!is_unit) pose.orientation.normalize();
}

}  // namespace tissue_sim
