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
    case Refusal::kFar:
      return "too far";
    case Refusal::kStamp:
      return "stamp far ahead";
    case Refusal::kOwnFrame:
      return "its own frame";
  }
  return "";
}

bool is_rotation(const Quat& q) {
  const double norm = q.norm();
  return norm >= 0.9 && norm <= 1.1;
}

bool is_rounded(const Quat& q) { return std::fabs(q.norm() - 1) > 0.01; }

void PoseCheck::forget() {
  last_.reset();
  candidate_.reset();
}

double PoseCheck::gap(const Timed& from, const Timed& to) const {
  const double gap = to.stamp - from.stamp;
  return gap == 0 ? to.came - from.came : gap;
}

bool PoseCheck::reachable(const Pose& from, const Pose& to, double gap) const {
  // Stamps may lie closer together than the poses were taken; nothing shorter than a frame is seen.
  const double time = std::min(std::max(gap, limits_.frame_time), 1.0);
  return (to.position - from.position).norm() <= limits_.speed * time &&
         turn(from, to) <= limits_.turn_rate * time;
}

PoseCheck::Verdict PoseCheck::check(Pose& pose, double stamp, double now) {
  Verdict verdict;
  if (!pose.position.allFinite() || !pose.orientation.coeffs().allFinite()) {
    verdict.refusal = Refusal::kNotFinite;
    verdict.text = "a value is NaN or infinite";
    return verdict;
  }
  if (!(pose.position.cwiseAbs().maxCoeff() <= kFarthestPose)) {
    verdict.refusal = Refusal::kFar;
    verdict.text = format("it is %.3g m from the world's origin", pose.position.norm(), 0, 0);
    return verdict;
  }
  if (!is_rotation(pose.orientation)) {
    verdict.refusal = Refusal::kNoRotation;
    verdict.text = format("its quaternion has norm %.3g, must be 1 (0.9 to 1.1 is normalised)",
                          pose.orientation.norm(), 0, 0);
    return verdict;
  }
  pose.orientation.normalize();
  const Timed sample{pose, stamp, now};
  if (!last_) {
    last_ = sample;
    verdict.placed = true;
    return verdict;
  }

  const double elapsed = gap(*last_, sample);
  const double distance = (pose.position - last_->pose.position).norm();
  if (elapsed < 0) {
    verdict.refusal = Refusal::kOlder;
    verdict.text = format("it is %.3f s older than the last one used", -elapsed, 0, 0);
  } else if (!reachable(last_->pose, pose, elapsed)) {
    verdict.refusal = Refusal::kJump;
    verdict.text = format("it is %.3f m and %.2f rad from the last one used, in %.3f s", distance,
                          turn(last_->pose, pose), elapsed);
  } else {
    // Where it was in the meantime nobody knows, so it must not cut a straight line from there.
    if (elapsed > kSilence && !reachable(last_->pose, pose, 0)) {
      verdict.placed = true;
      verdict.text = format("it is %.3f m away, after %.1f s without a pose", distance, elapsed, 0);
    }
    last_ = sample;
    candidate_.reset();
    return verdict;
  }
  if (believed(sample, *verdict.refusal, verdict.text)) {
    verdict.refusal.reset();
    verdict.placed = true;
    last_ = sample;
    candidate_.reset();
  }
  return verdict;
}

bool PoseCheck::believed(const Timed& sample, Refusal refusal, std::string& text) {
  const std::optional<Timed> before = candidate_;
  const bool again = before && refusal_ == refusal && refusal == Refusal::kOlder;
  candidate_ = sample;
  refusal_ = refusal;
  const bool agrees = before && sample.stamp >= before->stamp &&
                      reachable(before->pose, sample.pose, gap(*before, sample));
  if (!agrees) {
    stayed_ = 1;
    since_ = sample.came;
    return false;
  }
  ++stayed_;
  const double stamps = sample.stamp - before->stamp, came = sample.came - before->came;
  if (again && stamps > 0 && came >= 0.1 * stamps) {  // not all at once, as what was held up comes
    text += ", and its clock goes on from there";
    return true;
  }
  // Each of them stands for its share of the time.
  const double stayed = (sample.came - since_) * stayed_ / (stayed_ - 1);
  if (stayed_ < kStay || stayed < kStayTime - 1e-6) return false;
  text += ", and so were " + std::to_string(stayed_ - 1) + " before it";
  return true;
}

}  // namespace tissue_sim
