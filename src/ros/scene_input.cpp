#include "ros/scene_input.h"

#include <utility>

#include "ros/conversions.h"
#include "ros/guarded.h"
#include "ros/pose_track.h"
#include "ros/warn_seldom.h"
#include "tools/pose_fault.h"

namespace tissue_sim {

SceneInput::SceneInput(ros::NodeHandle node, const Scene& scene, const Frames& frames,
                       double fastest)
    : frames_(frames), farthest_(fastest / scene.frame_rate) {
  for (const Body& body : scene.bodies) {
    for (const Anchor& anchor : body.anchors) {
      const int i = static_cast<int>(names_.size());
      names_.push_back(anchor.name);
      poses_.emplace_back();
      last_.push_back(anchor.origin());
      if (anchor.name.empty()) continue;
      subscribers_.push_back(listen<geometry_msgs::PoseStamped>(
          node, "anchors/" + anchor.name + "/measured_cp", 10,
          [this, i](const auto& event) { on_pose(i, *event.getConstMessage()); }));
    }
  }
  subscribers_.push_back(listen<geometry_msgs::Vector3>(
      node, "gravity", 10, [this](const auto& event) { on_gravity(*event.getConstMessage()); }));
  subscribers_.push_back(listen<std_msgs::Float64>(
      node, "damping", 10, [this](const auto& event) { on_damping(*event.getConstMessage()); }));
}

void SceneInput::on_pose(int anchor, const geometry_msgs::PoseStamped& message) {
  const char* name = names_[anchor].c_str();
  Pose pose = from_message(message.pose);
  if (const std::string wrong = problem_of(pose, kRounding); !wrong.empty()) {
    WARN_SELDOM(1, "anchor %s: a pose %s", name, wrong.c_str());
    return;
  }
  pose.orientation.normalize();
  try {
    pose = frames_.in_world(message.header.frame_id, message.header.stamp) * pose;
  } catch (const tf2::TransformException& e) {
    WARN_SELDOM(1, "anchor %s: %s", name, e.what());
    return;
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  const double step = (pose.position - last_[anchor]).norm();
  if (!(step <= farthest_)) {  // nor is it a number
    WARN_SELDOM(1,
                "anchor %s: a pose is %g m from where it is; in a frame it moves by %g m at "
                "most (max_tool_speed)",
                name, step, farthest_);
    return;
  }
  poses_[anchor] = pose;
}

void SceneInput::on_gravity(const geometry_msgs::Vector3& message) {
  const Vec3 gravity(message.x, message.y, message.z);
  if (!gravity.allFinite() || gravity.cwiseAbs().maxCoeff() > 1000) {
    WARN_SELDOM(1, "gravity: each component must lie between -1000 and 1000 m/s^2");
    return;
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  gravity_ = gravity;
}

void SceneInput::on_damping(const std_msgs::Float64& message) {
  if (!(message.data >= 0 && message.data <= 1000)) {
    WARN_SELDOM(1, "damping is %g: must lie between 0 and 1000", message.data);
    return;
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  damping_ = message.data;
}

void SceneInput::begin(const Simulation& simulation) {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (std::size_t i = 0; i < poses_.size(); ++i) {
    poses_[i].reset();
    last_[i] = simulation.anchor(static_cast<int>(i)).position;
  }
  gravity_.reset();
  damping_.reset();
}

void SceneInput::ask(bool moves_anchors, FrameRequest& request) {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (std::size_t i = 0; i < poses_.size(); ++i) {
    if (!poses_[i]) continue;
    if (moves_anchors) {
      request.anchors.resize(poses_.size());
      request.anchors[i] = poses_[i];
      last_[i] = poses_[i]->position;
    } else {
      WARN_SELDOM(10, "anchor %s: anchors do not move with this scene's method and its options",
                  names_[i].c_str());
    }
    poses_[i].reset();
  }
  request.gravity = std::exchange(gravity_, std::nullopt);
  request.damping = std::exchange(damping_, std::nullopt);
}

}  // namespace tissue_sim
