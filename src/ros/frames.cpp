#include "ros/frames.h"

#include <cmath>

#include "ros/conversions.h"

namespace tissue_sim {
namespace {

// tf2 knows no leading slash, tf did.
std::string stripped(const std::string& frame) {
  return !frame.empty() && frame.front() == '/' ? frame.substr(1) : frame;
}

}  // namespace

Frames::Frames(std::string world, double tolerance)
    : world_(std::move(world)), tolerance_(tolerance), listener_(buffer_) {}

Pose Frames::in_world(const std::string& frame, const ros::Time& stamp) const {
  const std::string name = stripped(frame);
  if (name.empty() || name == world_) return Pose();
  try {
    return from_message(buffer_.lookupTransform(world_, name, stamp).transform);
  } catch (const tf2::ExtrapolationException&) {
    // Transforms come after the poses that need them: the newest will do, if it is new enough.
    const geometry_msgs::TransformStamped newest =
        buffer_.lookupTransform(world_, name, ros::Time(0));
    if (std::fabs((stamp - newest.header.stamp).toSec()) > tolerance_) throw;
    return from_message(newest.transform);
  }
}

Pose Frames::newest(const std::string& frame, ros::Time& stamp) const {
  const geometry_msgs::TransformStamped t =
      buffer_.lookupTransform(world_, stripped(frame), ros::Time(0));
  stamp = t.header.stamp;
  return from_message(t.transform);
}

}  // namespace tissue_sim
