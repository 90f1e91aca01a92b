#include "ros/frames.h"

#include <ros/console.h>

#include <cmath>

#include "ros/conversions.h"
#include "ros/guarded.h"
#include "ros/pose_track.h"
#include "ros/stamps.h"
#include "tools/pose_fault.h"

namespace tissue_sim {
namespace {

constexpr std::size_t kMostFrames = 10000;  // of tf; they are kept for ever

// tf2 knows no leading slash, tf did.
std::string stripped(const std::string& frame) {
  return !frame.empty() && frame.front() == '/' ? frame.substr(1) : frame;
}

// A chain of transforms that are right each may not be.
Pose checked(const geometry_msgs::Transform& transform, const std::string& frame) {
  Pose pose = from_message(transform);
  const std::string wrong = problem_of(pose, kRounding);
  if (!wrong.empty()) throw tf2::TransformException("the transform of '" + frame + "' " + wrong);
  pose.orientation.normalize();
  return pose;
}

}  // namespace

std::string problem(const geometry_msgs::TransformStamped& transform) {
  const Pose pose = from_message(transform.transform);
  if (stripped(transform.child_frame_id).empty()) return "its child_frame_id is empty";
  if (stripped(transform.header.frame_id).empty()) return "its frame_id (the parent) is empty";
  if (stripped(transform.child_frame_id) == stripped(transform.header.frame_id)) {
    return "it is its own parent";
  }
  if (transform.child_frame_id.size() > 1000 || transform.header.frame_id.size() > 1000) {
    return "the name of a frame is longer than 1000 characters";
  }
  const std::string wrong = problem_of(pose, kRounding);
  return wrong.empty() ? "" : "it " + wrong;
}

Frames::Frames(std::string world, double tolerance)
    : world_(std::move(world)), tolerance_(tolerance), spinner_(1, &queue_) {
  node_.setCallbackQueue(&queue_);
  using Event = ros::MessageEvent<const tf2_msgs::TFMessage>;
  const auto listen_to = [this](const std::string& topic, bool is_static) {
    return listen<tf2_msgs::TFMessage>(node_, topic, 100, [this, is_static](const Event& event) {
      take(*event.getConstMessage(), event.getPublisherName(), is_static);
    });
  };
  moving_ = listen_to("/tf", false);
  static_ = listen_to("/tf_static", true);
  spinner_.start();
}

void Frames::take(const tf2_msgs::TFMessage& message, const std::string& sender, bool is_static) {
  // A bag that loops with its /clock: what tf knew is of the future now.
  const ros::Time now = ros::Time::now();
  if (seconds_between(now, now_) > 0.1) {
    ROS_WARN("time jumped back by %.1f s: tf begins anew", seconds_between(now, now_));
    buffer_.clear();
    newest_.clear();
  }
  now_ = now;
  for (geometry_msgs::TransformStamped t : message.transforms) {
    std::string wrong = problem(t);
    if (wrong.empty() && is_far_ahead(t.header.stamp)) {
      wrong = "its stamp, " + std::to_string(t.header.stamp.sec) + " s, is more than a day ahead";
    }
    const auto known = newest_.find(t.child_frame_id);
    if (known == newest_.end() && newest_.size() >= kMostFrames)
      wrong = "there are too many frames";
    if (!wrong.empty()) {
      if (warned_.size() > kMostFrames) warned_.clear();
      std::string& warned = warned_[t.child_frame_id];
      if (warned != wrong) {
        ROS_WARN("tf: the transform of '%s' from %s is ignored: %s", t.child_frame_id.c_str(),
                 sender.c_str(), wrong.c_str());
      }
      warned = wrong;
      continue;
    }
    // The same stamp again says nothing new, and tf2 would write a line each time.
    if (is_static) {
      newest_.emplace(t.child_frame_id, ros::Time());
    } else {
      if (known != newest_.end() && known->second == t.header.stamp) continue;
      newest_[t.child_frame_id] = t.header.stamp;
    }
    t.transform.rotation = to_quaternion(from_message(t.transform).orientation.normalized());
    buffer_.setTransform(t, sender, is_static);
  }
}

geometry_msgs::TransformStamped Frames::look_up(const std::string& frame,
                                                const ros::Time& stamp) const {
  const std::string name = stripped(frame);
  const std::string from = "'" + name + "' to '" + world_ + "'";
  const bool knows_frame = buffer_._frameExists(name), knows_world = buffer_._frameExists(world_);
  if (!knows_frame || !knows_world) {
    const std::string lacks = knows_world   ? "frame '" + name + "'"
                              : knows_frame ? "frame '" + world_ + "' (world_frame)"
                                            : "any of the two";
    throw tf2::LookupException("no transform from " + from + ": tf does not know " + lacks);
  }
  try {
    return buffer_.lookupTransform(world_, name, stamp);
  } catch (const tf2::ExtrapolationException& e) {
    throw tf2::ExtrapolationException("no transform from " + from + ": " + e.what());
  } catch (const tf2::TransformException& e) {
    throw tf2::ConnectivityException("no transform from " + from + ": " + e.what());
  } catch (const std::runtime_error& e) {  // its arithmetic of stamps throws, too
    throw tf2::ConnectivityException("no transform from " + from + ": " + e.what());
  }
}

Pose Frames::in_world(const std::string& frame, const ros::Time& stamp) const {
  const std::string name = stripped(frame);
  if (name.empty() || name == world_) return Pose();
  try {
    return checked(look_up(name, stamp).transform, name);
  } catch (const tf2::ExtrapolationException&) {
    // Transforms come after the poses that need them: the newest will do, if it is new enough.
    const geometry_msgs::TransformStamped newest = look_up(name, ros::Time(0));
    if (std::fabs(seconds_between(newest.header.stamp, stamp)) > tolerance_) throw;
    return checked(newest.transform, name);
  }
}

Pose Frames::newest(const std::string& frame, ros::Time& stamp) const {
  const geometry_msgs::TransformStamped t = look_up(frame, ros::Time(0));
  stamp = t.header.stamp;
  return checked(t.transform, frame);
}

}  // namespace tissue_sim
