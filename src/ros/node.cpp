#include "ros/node.h"

#include <ros/console.h>
#include <ros/names.h>
#include <ros/time.h>
#include <rosgraph_msgs/Clock.h>

#include <set>
#include <string>

#include "frame/first_frame.h"
#include "ros/guarded.h"
#include "ros/remappings.h"
#include "scene/scene_text.h"

namespace tissue_sim {
namespace {

constexpr double kMebibyte = 1024.0 * 1024.0;
constexpr int kServiceThreads = 4;  // a long step, and still pause and stop_recording are answered

ros::NodeHandle with_queue(const ros::NodeHandle& node, ros::CallbackQueue& queue) {
  ros::NodeHandle handle(node);
  handle.setCallbackQueue(&queue);
  return handle;
}

}  // namespace

Node::Node(const ros::NodeHandle& node, bool owns_process)
    : pose_node_(with_queue(node, pose_queue_)),
      service_node_(with_queue(node, service_queue_)),
      parameters_(read_parameters(node, &watch_.stopping())),
      recorder_(parameters_.recording_folder, parameters_.recording_queue * kMebibyte,
                parameters_.recording_reserve * kMebibyte, parameters_.recording_limit * kMebibyte),
      frames_(parameters_.world_frame, parameters_.tf_tolerance),
      pose_spinner_(1, &pose_queue_),
      service_spinner_(kServiceThreads, &service_queue_) {
  if (owns_process) {
    watch_.end_process([this] { stop_recording(); });
  }
  // What who starts the node asks for may take as long as it does.
  const LimitWork limit(parameters_.work);
  Session session = make_session(read_scene_parameters(node));
  const Scene scene = session.simulation->scene();
  Parameters first = parameters_;
  const RecordRequest record = record_request(parameters_.record);
  first.paused = parameters_.paused || record.wanted;  // so that the bag holds frame 0
  if (parameters_.publish_clock) {
    clock_.advertise(service_node_);
  }
  simulation_ = std::make_unique<SimulationThread>(
      std::move(session), first, [this](const ros::Time& now) { clock_.say(now); });
  connect_clock();
  services_ =
      std::make_unique<Services>(service_node_, scene, *simulation_, recorder_, frames_,
                                 parameters_, [this](const Scene& s) { return make_session(s); });
  diagnostics_ = std::make_unique<Diagnostics>(service_node_, *simulation_, recorder_);
  if (record.wanted) record_from_start(record.name);
  pose_spinner_.start();
  service_spinner_.start();
}

Node::~Node() {
  watch_.stop();
  // First what services may be waiting for, then the services, then what they call.
  if (simulation_) simulation_->stop();
  service_spinner_.stop();
  pose_spinner_.stop();
  stop_recording();
}

void Node::stop_recording() {
  try {
    recorder_.stop();
  } catch (const std::exception&) {  // nothing was recorded, or it has been said
  }
}

void Node::record_from_start(const std::string& name) {
  const auto start = [this, name] {
    services_->start_recording(name, {});
    simulation_->set_paused(parameters_.paused);
  };
  if (!clock_is_missing()) {
    start();
    return;
  }
  const auto wait = [this, start](const ros::WallTimerEvent&) {
    if (clock_is_missing()) {
      if (waited_++ % 50 == 0) {
        ROS_WARN(
            "/use_sim_time is set and no /clock has come yet: the recording waits for it, and "
            "the simulation with it (rosbag play --clock, or unset /use_sim_time)");
      }
      return;
    }
    clock_timer_.stop();
    try {
      start();
    } catch (const std::exception& e) {
      ROS_ERROR("cannot record: %s; the simulation stays paused", e.what());
    }
  };
  clock_timer_ = service_node_.createWallTimer(ros::WallDuration(0.1), wait);
}

void Node::connect_clock() {
  if (parameters_.publish_clock) {
    if (!ros::Time::isSimTime()) {
      ROS_WARN(
          "this node publishes /clock, but nobody follows it: set /use_sim_time to true before "
          "nodes start");
    }
    return;
  }
  if (!ros::Time::isSimTime()) return;
  if (parameters_.time != TimeMode::kRos) {
    ROS_WARN(
        "/use_sim_time is set: messages carry the time of /clock, frames do not keep to it "
        "(time: ros would)");
  }
  clock_subscriber_ = listen<rosgraph_msgs::Clock>(
      pose_node_, "/clock", 100,
      [this](const auto& event) { simulation_->on_clock(event.getConstMessage()->clock); });
}

Session Node::make_session(const Scene& asked) {
  Session session;
  // A force for hands comes more often by shorter frames: with them poses are taken as often, and
  // nothing is felt that a replay would not compute. What is for eyes keeps its own rate.
  Scene scene = asked;
  Parameters parameters = parameters_;
  if (parameters.wrench_rate > scene.frame_rate) {
    if (parameters.state_rate == 0) parameters.state_rate = scene.frame_rate;
    scene.frame_rate = parameters.wrench_rate;
  }
  session.simulation = std::make_unique<Simulation>(scene);
  session.tools = std::make_shared<ToolInputs>();
  PoseLimits limits;
  limits.speed = parameters_.max_tool_speed;
  limits.turn_rate = parameters_.max_tool_turn_rate;
  limits.frame_time = 1 / scene.frame_rate;
  Box box;
  for (const Fragment& piece : session.simulation->tissue().fragments()) {
    box.min = box.min.cwiseMin(piece.box.min);
    box.max = box.max.cwiseMax(piece.box.max);
  }
  std::set<std::string> names;
  std::function<void()> on_sample;
  if (parameters_.time != TimeMode::kWall) {  // no callback runs before the spinners are started
    on_sample = [this] { simulation_->on_sample(); };
  }
  for (const Tool& tool : scene.tools) {
    names.insert(tool.name);
    if (tool.name == parameters_.world_frame) {
      throw std::invalid_argument("tools: a tool is named '" + tool.name +
                                  "' as the world's frame (~world_frame): give it another name");
    }
    const auto source = parameters_.tools.find(tool.name);
    session.tools->push_back(std::make_unique<ToolInput>(
        pose_node_, tool, source == parameters_.tools.end() ? ToolParameters() : source->second,
        limits, frames_, box, recorder_, on_sample, parameters_.publish_tf));
  }
  for (const auto& source : parameters_.tools) {
    if (names.count(source.first) == 0) {
      ROS_WARN("~tools/%s names no tool of the scene", source.first.c_str());
    }
  }
  for (const std::string& warning :
       useless_remappings(pose_node_.getNamespace(), names, ros::names::getRemappings())) {
    ROS_WARN("%s", warning.c_str());
  }
  if (parameters.cloud_fields & ~session.simulation->tissue().point_fields()) {
    ROS_WARN("~cloud_fields: clouds of method %s have no stress_tensor",
             name_of(scene.method, kMethodNames));
  }
  session.scene_input =
      std::make_shared<SceneInput>(pose_node_, scene, frames_, parameters_.max_tool_speed);
  session.publications =
      std::make_shared<Publications>(service_node_, scene, parameters, recorder_, &frames_);
  Tissue& tissue = session.simulation->tissue();
  for (const std::string& note : tissue.notes()) ROS_WARN("%s", note.c_str());
  for (const std::string& note : ground_notes(scene, tissue.fragments())) {
    ROS_WARN("%s", note.c_str());
  }
  ROS_INFO("scene '%s': %d particles, cells of %g mm, %zu tools, on %s", scene.name.c_str(),
           tissue.point_count(), scene.cell_size * 1e3, scene.tools.size(),
           tissue.device_name().c_str());
  return session;
}

}  // namespace tissue_sim
