#include "ros/pose_track.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "tools/pose_fault.h"

namespace tissue_sim {
namespace {

double turn(const Pose& a, const Pose& b) { return a.orientation.angularDistance(b.orientation); }

std::string format(const char* text, double a, double b, double c) {
  char line[160];
  std::snprintf(line, sizeof line, text, a, b, c);
  return line;
}

}  // namespace

void PoseTrack::begin_anew() {
  begins_ = true;
  goes_on_from_.reset();
  candidate_.reset();
}

void PoseTrack::rewind(double now) {
  begin_anew();
  if (track_.has_come()) track_.place(track_.newest(), now);
}

void PoseTrack::forget() {
  begin_anew();
  track_.forget();
}

void PoseTrack::go_on(const Pose& from) {
  begin_anew();
  goes_on_from_ = from;
}

bool PoseTrack::reachable(const Pose& from, const Pose& to, double gap) const {
  // Stamps may lie closer together than the poses were taken; nothing shorter than a frame is seen.
  const double time = std::min(std::max(gap, limits_.frame_time), 1.0);
  return (to.position - from.position).norm() <= limits_.speed * time &&
         turn(from, to) <= limits_.turn_rate * time;
}

PoseTrack::Verdict PoseTrack::add(Pose pose, double stamp, double now) {
  switch (fault_of(pose, kRounding)) {
    case PoseFault::kNotFinite:
      return {Refusal::kNotFinite, false, "a value is NaN or infinite"};
    case PoseFault::kTooFar:
      return {Refusal::kFar, false,
              format("it is %.3g m from the world's origin", pose.position.norm(), 0, 0)};
    case PoseFault::kNoRotation:
      return {Refusal::kNoRotation, false,
              format("its quaternion has norm %.3g, must be 1 (0.9 to 1.1 is normalised)",
                     pose.orientation.norm(), 0, 0)};
    case PoseFault::kNone:
      break;
  }
  pose.orientation.normalize();
  Verdict verdict;
  if (begins_) {
    verdict.placed = !goes_on_from_ || !reachable(*goes_on_from_, pose, 0);
  } else {
    verdict = judge(pose, stamp, now);
    if (verdict.refusal) return verdict;
  }
  begins_ || verdict.placed ? track_.place(pose, now) : track_.add(pose, now);
  stamp_ = stamp;
  begins_ = false;
  goes_on_from_.reset();
  candidate_.reset();
  return verdict;
}

PoseTrack::Verdict PoseTrack::judge(const Pose& pose, double stamp, double now) {
  Verdict verdict;
  const Pose& last = track_.newest();
  const double elapsed = stamp == stamp_ ? now - track_.newest_came() : stamp - stamp_;
  const double distance = (pose.position - last.position).norm();
  if (elapsed < 0) {
    verdict.refusal = Refusal::kOlder;
    verdict.text = format("it is %.3f s older than the last one used", -elapsed, 0, 0);
  } else if (!reachable(last, pose, elapsed)) {
    verdict.refusal = Refusal::kJump;
    verdict.text = format("it is %.3f m and %.2f rad from the last one used, in %.3f s", distance,
                          turn(last, pose), elapsed);
  } else if (elapsed > kSilence && !reachable(last, pose, 0)) {
    // Where it was in the meantime nobody knows, so it must not cut a straight line from there.
    verdict.placed = true;
    verdict.text = format("it is %.3f m away, after %.1f s without a pose", distance, elapsed, 0);
  }
  if (verdict.refusal && believed({pose, stamp, now}, *verdict.refusal, verdict.text)) {
    verdict.refusal.reset();
    verdict.placed = true;
  }
  return verdict;
}

bool PoseTrack::believed(const Timed& sample, Refusal refusal, std::string& text) {
  const std::optional<Timed> before = std::exchange(candidate_, sample);
  const bool again = before && refusal_ == refusal && refusal == Refusal::kOlder;
  refusal_ = refusal;
  const double stamps = before ? sample.stamp - before->stamp : 0;
  const double came = before ? sample.came - before->came : 0;
  if (!before || stamps < 0 || !reachable(before->pose, sample.pose, stamps == 0 ? came : stamps)) {
    stayed_ = 1;
    since_ = sample.came;
    return false;
  }
  ++stayed_;
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
