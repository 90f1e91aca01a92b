// SceneInput: what changes in a scene while it runs, from topics: anchors' poses, gravity, damping.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/Vector3.h>
#include <ros/node_handle.h>
#include <std_msgs/Float64.h>

#include <mutex>
#include <optional>
#include <vector>

#include "ros/frames.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {

/// Thread-safe. Callbacks come on the node handle's queue.
class SceneInput {
 public:
  /// Listens to `anchors/<name>/measured_cp` of each anchor that has a name, to `gravity` and to
  /// `damping`. An anchor that would be faster than `fastest` [m/s] is not moved.
  SceneInput(ros::NodeHandle node, const Scene& scene, const Frames& frames, double fastest);
  /// Of a simulation that begins, or goes on from another state: forgets what came before.
  void begin(const Simulation& simulation);
  /// What came since the last call, for the next frame of tissue that `moves_anchors` or does not.
  void ask(bool moves_anchors, FrameRequest& request);

 private:
  void on_pose(int anchor, const geometry_msgs::PoseStamped& message);
  void on_gravity(const geometry_msgs::Vector3& message);
  void on_damping(const std_msgs::Float64& message);

  const Frames& frames_;
  const double farthest_;  // in a frame [m]
  std::vector<std::string> names_;
  std::mutex mutex_;  // of what follows
  std::vector<std::optional<Pose>> poses_;
  std::vector<Vec3> last_;  // where they are, or at rest
  std::optional<Vec3> gravity_;
  std::optional<double> damping_;
  std::vector<ros::Subscriber> subscribers_;  // last: end before the rest
};

}  // namespace tissue_sim
