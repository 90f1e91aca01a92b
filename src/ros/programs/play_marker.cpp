// play_marker: interactive markers by which a hand moves the tools of the simulator's scene in
// RViz.
//
// One marker for each tool: drag it along and about its axes, or in the plane of the screen by its
// ball; the right button shows what else there is: jaws, a cut, reset, pause, recording.
// Parameters: simulator, tools, start, rate, speed, turn_rate, marker_size, cut_length, cut_depth,
// world_frame.
#include <geometry_msgs/PoseStamped.h>
#include <interactive_markers/interactive_marker_server.h>
#include <interactive_markers/menu_handler.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/String.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <tissue_sim/Cut.h>
#include <tissue_sim/StartRecording.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <functional>
#include <iterator>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "ros/conversions.h"
#include "ros/guarded.h"
#include "ros/messages.h"
#include "ros/pose_track.h"
#include "tissue_sim/scene.h"
#include "tools/pose_fault.h"

namespace tissue_sim {
namespace {

using interactive_markers::MenuHandler;
using visualization_msgs::InteractiveMarker;
using visualization_msgs::InteractiveMarkerControl;
using visualization_msgs::InteractiveMarkerFeedback;
using visualization_msgs::Marker;

// A tool in the hand: it follows its marker at a speed that an arm has.
struct Held {
  Pose goal, pose;
  double jaw_goal = 0, jaw = 0;  // [rad]
  bool has_jaws = false;
  ros::Publisher poses, jaws;
  MenuHandler menu;
};

class PlayMarker {
 public:
  explicit PlayMarker(const ros::NodeHandle& own) : own_(own) {
    own.getParam("simulator", simulator_);
    own.getParam("tools", tools_);
    own.getParam("world_frame", world_frame_);
    number("rate", rate_, 10, 1000);
    number("speed", speed_, 0.001, 5);
    number("turn_rate", turn_rate_, 0.01, 60);
    number("marker_size", size_, 0.001, 10);
    number("cut_length", cut_length_, 0.001, 10);
    number("cut_depth", cut_depth_, 0.001, 10);
    server_ = std::make_unique<interactive_markers::InteractiveMarkerServer>("play_marker");
    scene_ = listen<std_msgs::String>(node_, simulator_ + "/scene", 1, [this](const auto& event) {
      on_scene(scene_from_yaml(event.getConstMessage()->data));
    });
  }

  void run() {
    ros::AsyncSpinner spinner(1);  // services of the menu may take their time
    spinner.start();
    ros::WallRate rate(rate_);
    while (ros::ok()) {
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        for (auto& [name, tool] : held_) follow(*tool, 1 / rate_);
      }
      rate.sleep();
    }
  }

 private:
  void number(const char* name, double& value, double min, double max) {
    own_.getParam(name, value);
    if (!(value >= min && value <= max)) {
      throw std::invalid_argument("~" + std::string(name) + " is " + std::to_string(value) +
                                  ": must be a number from " + std::to_string(min) + " to " +
                                  std::to_string(max));
    }
  }

  // The scene says which tools there are; a reset sends it again, and changes nothing here.
  void on_scene(const Scene& scene) {
    const std::lock_guard<std::mutex> lock(mutex_);
    int index = 0;
    std::set<std::string> there;
    for (const Tool& tool : scene.tools) {
      const std::string& name = tool.name;
      if (!tools_.empty() && std::find(tools_.begin(), tools_.end(), name) == tools_.end())
        continue;
      if (held_.count(name) == 0) hold(name, has_jaws(tool.type), index);
      there.insert(name);
      ++index;
    }
    for (auto tool = held_.begin(); tool != held_.end();) {  // of another scene
      if (there.count(tool->first) == 0) server_->erase(tool->first);
      tool = there.count(tool->first) ? std::next(tool) : held_.erase(tool);
    }
    if (index == 0) ROS_WARN("none of the scene's tools is asked for: see ~tools");
    server_->applyChanges();
  }

  void hold(const std::string& name, bool has_jaws, int index) {
    auto tool = std::make_unique<Held>();
    tool->has_jaws = has_jaws;
    tool->jaw = tool->jaw_goal = tool->has_jaws ? 0.6 : 0;
    std::vector<double> start = {0.06 * index, 0, 0.1};
    if (own_.getParam("start/" + name, start) && start.size() != 3) {
      ROS_WARN("~start/%s is not used: must be a list x, y, z", name.c_str());
      start = {0.06 * index, 0, 0.1};
    }
    // It points down, and a blade cuts towards +y.
    Eigen::Matrix3d axes;
    axes << 0, 1, 0, 1, 0, 0, 0, 0, -1;
    tool->pose = tool->goal = {Vec3(start[0], start[1], start[2]), Quat(axes)};
    const std::string prefix = simulator_ + "/" + name;
    tool->poses = node_.advertise<geometry_msgs::PoseStamped>(prefix + "/measured_cp", 10);
    tool->jaws = node_.advertise<sensor_msgs::JointState>(prefix + "/jaw/measured_js", 10);
    show(name, *tool);
    held_[name] = std::move(tool);
    ROS_INFO("%s is in your hand: drag its marker, its menu is at the right button", name.c_str());
  }

  void show(const std::string& name, Held& tool) {
    InteractiveMarker marker;
    marker.header.frame_id = world_frame_;
    marker.name = name;
    marker.description = name;
    marker.scale = static_cast<float>(size_);
    marker.pose = to_pose(tool.pose);
    for (int axis = 0; axis < 3; ++axis) {
      InteractiveMarkerControl control;
      control.orientation.w = std::sqrt(0.5);
      (axis == 0   ? control.orientation.x
       : axis == 1 ? control.orientation.z
                   : control.orientation.y) = std::sqrt(0.5);  // its x onto that axis
      for (const bool turn : {false, true}) {
        control.name = std::string(turn ? "turn_" : "move_") + "xyz"[axis];
        control.interaction_mode =
            turn ? InteractiveMarkerControl::ROTATE_AXIS : InteractiveMarkerControl::MOVE_AXIS;
        marker.controls.push_back(control);
      }
    }
    Marker ball;
    ball.type = Marker::SPHERE;
    ball.scale.x = ball.scale.y = ball.scale.z = 0.16 * size_;
    ball.color.r = 0.95F, ball.color.g = 0.75F, ball.color.b = 0.1F, ball.color.a = 0.8F;
    ball.pose.position.z = -0.5 * size_;  // on the shaft, beside the tip
    ball.pose.orientation.w = 1;
    InteractiveMarkerControl grip;
    grip.name = "grip";
    grip.always_visible = true;
    grip.orientation_mode = InteractiveMarkerControl::VIEW_FACING;
    grip.independent_marker_orientation = true;
    grip.interaction_mode = InteractiveMarkerControl::MOVE_PLANE;
    grip.markers.push_back(ball);
    marker.controls.push_back(grip);

    server_->insert(marker, [this, name](const auto& feedback) { on_feedback(name, *feedback); });
    if (tool.has_jaws) {
      entry(tool, "Open the jaws", [this, name] { set_jaw(name, 0.6); });
      entry(tool, "Close the jaws", [this, name] { set_jaw(name, 0); });
      entry(tool, "Squeeze", [this, name] { set_jaw(name, -0.35); });
    }
    entry(tool, "Cut here, in the blade's plane", [this, name] { cut(name); });
    entry(tool, "Start recording", [this] { call<StartRecording>("start_recording"); });
    entry(tool, "Stop recording", [this] { call<std_srvs::Trigger>("stop_recording"); });
    entry(tool, "Pause", [this] { pause(true); });
    entry(tool, "Go on", [this] { pause(false); });
    entry(tool, "Reset the tissue", [this] { call<std_srvs::Trigger>("reset"); });
    tool.menu.apply(*server_, name);
  }

  static void entry(Held& tool, const std::string& title, const std::function<void()>& action) {
    tool.menu.insert(title, [action](const auto&) { action(); });
  }

  void on_feedback(const std::string& name, const InteractiveMarkerFeedback& feedback) {
    if (feedback.event_type != InteractiveMarkerFeedback::POSE_UPDATE) return;
    Pose goal = from_message(feedback.pose);
    if (fault_of(goal, kRounding) != PoseFault::kNone) return;
    goal.orientation.normalize();
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto tool = held_.find(name);
    if (tool != held_.end()) tool->second->goal = goal;
  }

  void set_jaw(const std::string& name, double angle) {
    const std::lock_guard<std::mutex> lock(mutex_);
    held_.at(name)->jaw_goal = angle;
  }

  void follow(Held& tool, double seconds) const {
    const Vec3 way = tool.goal.position - tool.pose.position;
    const double step = speed_ * seconds;
    tool.pose.position += way.norm() > step ? Vec3(way.normalized() * step) : way;
    const double angle = tool.pose.orientation.angularDistance(tool.goal.orientation);
    const double share = angle > 1e-9 ? std::min(1.0, turn_rate_ * seconds / angle) : 1.0;
    tool.pose.orientation = tool.pose.orientation.slerp(share, tool.goal.orientation).normalized();
    tool.jaw += std::clamp(tool.jaw_goal - tool.jaw, -2 * seconds, 2 * seconds);
    geometry_msgs::PoseStamped pose;
    pose.header.stamp = ros::Time::now();
    pose.header.frame_id = world_frame_;
    pose.pose = to_pose(tool.pose);
    if (tool.has_jaws) {
      sensor_msgs::JointState jaw;
      jaw.header = pose.header;
      jaw.name = {"jaw"};
      jaw.position = {tool.jaw};
      tool.jaws.publish(jaw);
    }
    tool.poses.publish(pose);
  }

  // A blade that stands along the tool's z and goes along its x, over the tip.
  void cut(const std::string& name) {
    Cut service;
    Pose pose;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      pose = held_.at(name)->pose;
    }
    for (const double z : {-0.2 * cut_depth_, cut_depth_}) {
      service.request.edge.push_back(to_point(Vec3(0, 0, z)));
    }
    for (const double x : {-0.5, 0.5}) {
      service.request.path.push_back(
          to_pose({pose * Vec3(x * cut_length_, 0, 0), pose.orientation}));
    }
    service.request.header.frame_id = world_frame_;
    call("cut", service);
  }

  void pause(bool paused) {
    std_srvs::SetBool service;
    service.request.data = paused;
    call("pause", service);
  }

  template <class Service>
  void call(const std::string& name, Service service = {}) {
    if (!ros::service::call(simulator_ + "/" + name, service)) {
      ROS_WARN("%s/%s does not answer", simulator_.c_str(), name.c_str());
    } else if (!service.response.success) {
      ROS_WARN("%s: %s", name.c_str(), service.response.message.c_str());
    } else {
      ROS_INFO("%s: %s", name.c_str(), service.response.message.c_str());
    }
  }

  ros::NodeHandle node_, own_;
  std::string simulator_ = "/simulator", world_frame_ = "world";
  std::vector<std::string> tools_;               // that are held; empty: all of the scene
  double rate_ = 100;                            // of poses [Hz]
  double speed_ = 0.3;                           // [m/s]
  double turn_rate_ = 3;                         // [rad/s]
  double size_ = 0.05;                           // of a marker [m]
  double cut_length_ = 0.08, cut_depth_ = 0.05;  // of the menu's cut [m]
  std::mutex mutex_;
  std::map<std::string, std::unique_ptr<Held>> held_;
  std::unique_ptr<interactive_markers::InteractiveMarkerServer> server_;
  ros::Subscriber scene_;
};

}  // namespace
}  // namespace tissue_sim

int main(int argc, char** argv) {
  ros::init(argc, argv, "play_marker");
  ros::NodeHandle own("~");
  try {
    tissue_sim::PlayMarker(own).run();
  } catch (const std::exception& e) {
    ROS_FATAL("cannot show markers: %s", e.what());
    return 1;
  }
  return 0;
}
