// Frames: poses in any tf frame, wanted in the world frame.
#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>
#include <ros/time.h>
#include <tf2/buffer_core.h>
#include <tf2/exceptions.h>
#include <tf2_msgs/TFMessage.h>

#include <map>
#include <string>

#include "tissue_sim/types.h"

namespace tissue_sim {

/// What is wrong with a transform that somebody sent, "" for nothing: tf2 would refuse it, with an
/// error on the terminal each time.
std::string problem(const geometry_msgs::TransformStamped& transform);

/// Thread-safe. Listens to tf in a thread of its own.
class Frames {
 public:
  /// Where a frame moves, its newest transform may be older than the stamp by `tolerance` [s].
  Frames(std::string world, double tolerance);

  const std::string& world() const { return world_; }

  /// The frame's pose in the world at `stamp` (0: the newest). An empty name is the world.
  /// Throws tf2::TransformException, with a text that names the frame and what tf lacks.
  Pose in_world(const std::string& frame, const ros::Time& stamp) const;
  /// The newest pose of a frame in the world, and when it was there. Throws
  /// tf2::TransformException, as above.
  Pose newest(const std::string& frame, ros::Time& stamp) const;
  /// Takes the transforms that are right; of the others it warns once for each child. For one
  /// thread: the listener's, or a test's.
  void take(const tf2_msgs::TFMessage& message, const std::string& sender, bool is_static);

 private:
  geometry_msgs::TransformStamped look_up(const std::string& frame, const ros::Time& stamp) const;

  std::string world_;
  double tolerance_;
  tf2::BufferCore buffer_;
  std::map<std::string, std::string> warned_;  // by child: of what
  std::map<std::string, ros::Time> newest_;    // by child: stamp of what came last
  ros::Time now_;                              // when something came last
  ros::CallbackQueue queue_;
  ros::NodeHandle node_;
  ros::Subscriber moving_, static_;
  ros::AsyncSpinner spinner_;
};

}  // namespace tissue_sim
