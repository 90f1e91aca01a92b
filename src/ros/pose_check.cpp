#include "ros/pose_check.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace tissue_sim {
namespace {

double turn(const Pose& a, const Pose& b) { return a.orientation.angularDistance(b.orientation); }

std::string format(const char* text, double a, double b, double c) {
  char line[160];
  std::snprintf(line, sizeof line, text, a, b, c);
  return line;
}

}  // namespace

const char* name_of(Refusal refusal) {
  switch (refusal) {
    case Refusal::kNotFinite:
      return "not finite";
    case Refusal::kNoRotation:
      return "no rotation";
    case Refusal::kOlder:
      return "older than the last";
    case Refusal::kUnknownFrame:
      return "unknown frame";
    case Refusal::kJump:
      return "jump";
  }
  return "";
}

bool PoseCheck::reachable(const Timed& from, const Timed& to) const {
  // Stamps may lie closer together than the poses were taken; nothing shorter than a frame is seen.
  const double gap = std::min(std::max(to.time - from.time, limits_.frame_time), 1.0);
  return (to.pose.position - from.pose.position).norm() <= limits_.speed * gap &&
         turn(from.pose, to.pose) <= limits_.turn_rate * gap;
}

PoseCheck::Verdict PoseCheck::check(Pose& pose, double time) {
  Verdict verdict;
  if (!pose.position.allFinite() || !pose.orientation.coeffs().allFinite()) {
    verdict.refusal = Refusal::kNotFinite;
    verdict.text = "a value is NaN or infinite";
    return verdict;
  }
  const double norm = pose.orientation.norm();
  if (std::fabs(norm - 1) > 0.01) {
    verdict.refusal = Refusal::kNoRotation;
    verdict.text = format("its quaternion has norm %.3g, must be 1 within 0.01", norm, 0, 0);
    return verdict;
  }
  pose.orientation.normalize();
  const Timed sample{pose, time};
  if (!last_) {
    last_ = sample;
    verdict.placed = true;
    return verdict;
  }

  const double gap = time - last_->time;
  const double distance = (pose.position - last_->pose.position).norm();
  if (gap < 0) {
    verdict.refusal = Refusal::kOlder;
    verdict.text = format("it is %.3f s older than the last one used", -gap, 0, 0);
  } else if (!reachable(*last_, sample)) {
    verdict.refusal = Refusal::kJump;
    verdict.text = format("%.3f m and %.2f rad from the last one used, in %.3f s", distance,
                          turn(last_->pose, pose), gap);
  } else {
    // Where it was in the meantime nobody knows, so it must not cut a straight line from there.
    const bool far = !reachable(*last_, {pose, last_->time});
    if (gap > kSilence && far) {
      verdict.placed = true;
      verdict.text = format("after %.1f s without a pose it is %.3f m away", gap, distance, 0);
    }
    last_ = sample;
    candidate_.reset();
    return verdict;
  }

  const bool stays = candidate_ && time > candidate_->time && reachable(*candidate_, sample);
  stayed_ = stays ? stayed_ + 1 : 1;
  candidate_ = sample;
  if (stayed_ == kStay) {
    verdict.text += ", and so were " + std::to_string(kStay - 1) + " before it";
    verdict.refusal.reset();
    verdict.placed = true;
    last_ = sample;
    candidate_.reset();
  }
  return verdict;
}

}  // namespace tissue_sim
