// Frames: poses in any tf frame, wanted in the world frame.
#pragma once

#include <ros/time.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <string>

#include "tissue_sim/types.h"

namespace tissue_sim {

/// Thread-safe. Listens to tf in a thread of its own.
class Frames {
 public:
  /// Where a frame moves, its newest transform may be older than the stamp by `tolerance` [s].
  Frames(std::string world, double tolerance);

  const std::string& world() const { return world_; }

  /// The frame's pose in the world at `stamp` (0: the newest). An empty name is the world.
  /// Throws tf2::TransformException.
  Pose in_world(const std::string& frame, const ros::Time& stamp) const;
  /// The newest pose of a frame in the world, and when it was there. Throws
  /// tf2::TransformException.
  Pose newest(const std::string& frame, ros::Time& stamp) const;

 private:
  std::string world_;
  double tolerance_;
  tf2_ros::Buffer buffer_;
  tf2_ros::TransformListener listener_;
};

}  // namespace tissue_sim
