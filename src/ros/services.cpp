#include "ros/services.h"

#include <ros/console.h>

#include <cmath>
#include <stdexcept>

#include "geometry/mesh.h"
#include "ros/conversions.h"
#include "ros/service_answer.h"
#include "scene/read_file.h"
#include "tools/pose_fault.h"

namespace tissue_sim {

Services::Services(ros::NodeHandle& node, const Scene& scene, SimulationThread& simulation,
                   Recorder& recorder, const Frames& frames, const Parameters& parameters,
                   MakeSession make_session)
    : node_(node),
      simulation_(simulation),
      recorder_(recorder),
      frames_(frames),
      parameters_(parameters),
      make_session_(std::move(make_session)),
      scene_(scene) {
  servers_.push_back(node.advertiseService("cut", &Services::cut, this));
  servers_.push_back(node.advertiseService("fill", &Services::fill, this));
  servers_.push_back(node.advertiseService("drain", &Services::drain, this));
  servers_.push_back(node.advertiseService("stop_recording", &Services::stop_recording, this));
  servers_.push_back(node.advertiseService("reset", &Services::reset, this));
  servers_.push_back(node.advertiseService("pause", &Services::pause, this));
  servers_.push_back(node.advertiseService("step", &Services::step, this));
  servers_.push_back(node.advertiseService("settle", &Services::settle, this));
  servers_.push_back(node.advertiseService("load_scene", &Services::load_scene, this));
  servers_.push_back(node.advertiseService("save_state", &Services::save_state, this));
  servers_.push_back(node.advertiseService("save_surface", &Services::save_surface, this));
  servers_.push_back(node.advertiseService("restore_state", &Services::restore_state, this));
  bool (Services::*start)(StartRecording::Request&, StartRecording::Response&) =
      &Services::start_recording;
  servers_.push_back(node.advertiseService("start_recording", start, this));
}

std::unique_lock<std::mutex> Services::begin_building() {
  std::unique_lock<std::mutex> lock(rebuilding_, std::try_to_lock);
  if (!lock) {
    throw std::runtime_error(
        "another scene is being built, or a recording begins: wait for its answer");
  }
  return lock;
}

std::unique_ptr<Simulation> Services::build_again() const {
  const PermitFolders folders(folders_);
  return std::make_unique<Simulation>(scene_);
}

BladePath Services::read_path(const Cut::Request& request) const {
  if (request.path.size() < 2) {
    throw std::runtime_error("path has " + std::to_string(request.path.size()) +
                             " poses: a cut needs at least 2, between which the edge sweeps");
  }
  if (request.edge.size() < 2) {
    throw std::runtime_error("edge has " + std::to_string(request.edge.size()) +
                             " points: a blade's edge needs at least 2");
  }
  Pose frame;
  try {
    frame = frames_.in_world(request.header.frame_id, request.header.stamp);
  } catch (const tf2::TransformException& e) {
    throw std::runtime_error("frame_id '" + request.header.frame_id +
                             "' cannot be used: " + e.what());
  }
  BladePath path;
  for (std::size_t i = 0; i < request.edge.size(); ++i) {
    path.edge.push_back(from_message(request.edge[i]));
    if (!path.edge.back().allFinite()) {
      throw std::runtime_error("edge[" + std::to_string(i) + "] is not finite");
    }
  }
  for (std::size_t i = 0; i < request.path.size(); ++i) {
    const std::string name = "path[" + std::to_string(i) + "]";
    Pose pose = from_message(request.path[i]);
    const std::string wrong = problem_of(pose, kRounding);
    if (!wrong.empty()) throw std::runtime_error(name + " " + wrong);
    if (is_rounded(pose.orientation.norm())) {
      ROS_WARN("cut: %s has a quaternion of norm %.3g, is normalised", name.c_str(),
               pose.orientation.norm());
    }
    pose.orientation.normalize();
    path.poses.push_back(frame * pose);
    path.poses.back().orientation.normalize();
  }
  check_path(path);  // as it is in the world: what is refused here stops no simulation
  return path;
}

bool Services::cut(Cut::Request& request, Cut::Response& response) {
  return answer(response, "cut", [&] {
    const CutReply reply = simulation_.cut(read_path(request));
    if (!reply.success) throw std::runtime_error(reply.message);
    response.points_separated = reply.report.points_separated;
    response.new_fragments.assign(reply.report.new_fragments.begin(),
                                  reply.report.new_fragments.end());
    return std::to_string(reply.report.bonds_broken) + " bonds broken" +
           (reply.message.empty() ? "" : "; " + reply.message);
  });
}

bool Services::fill(FillHollow::Request& request, FillHollow::Response& response) {
  return answer(response, "fill", [&] {
    simulation_.order(request.body, "pressure", request.pressure);
    return "body '" + request.body + "' takes fluid in until it has the pressure";
  });
}

bool Services::drain(DrainHollow::Request& request, DrainHollow::Response& response) {
  return answer(response, "drain", [&] {
    simulation_.order(request.body, "volume", request.volume);
    return "body '" + request.body + "' gives it up within half a second";
  });
}

std::set<std::string> Services::select(const std::vector<std::string>& topics) const {
  std::set<std::string> all = simulation_.topics();
  if (topics.empty()) return all;
  std::set<std::string> chosen;
  for (const std::string& topic : topics) {
    const std::string name = node_.resolveName(topic);
    if (name == node_.resolveName("surface")) all.insert(name);  // of all methods, where asked for
    if (all.count(name) == 0) {
      std::string known;
      for (const std::string& each : all) known += (known.empty() ? "" : ", ") + each;
      throw std::runtime_error("topic '" + topic + "' is none of this node's: " + known);
    }
    chosen.insert(name);
  }
  // Without these a bag cannot be run again.
  chosen.insert(
      {node_.resolveName("scene"), node_.resolveName("inputs"), node_.resolveName("saved_state")});
  return chosen;
}

std::string Services::start_recording(const std::string& path,
                                      const std::vector<std::string>& topics) {
  if (clock_is_missing()) {
    throw std::runtime_error(
        "/use_sim_time is set and no /clock has come yet: all would be recorded at the time 0; "
        "start the clock (rosbag play --clock) or unset /use_sim_time");
  }
  // While a scene is built the present one would be recorded, and then the other.
  const std::lock_guard<std::mutex> lock(rebuilding_);
  const std::string bag = recorder_.start(path, select(topics));
  records_all_ = topics.empty();
  simulation_.record_scene();
  ROS_INFO("recording %s", bag.c_str());
  const std::int64_t frame = simulation_.record_state();
  return bag + (frame >= 0
                    ? ""
                    : " (without the beginning of the present run, so it can be run again from "
                      "the next reset on only)");
}

bool Services::start_recording(StartRecording::Request& request,
                               StartRecording::Response& response) {
  return answer(response, "start_recording",
                [&] { return start_recording(request.path, request.topics); });
}

bool Services::stop_recording(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  return answer(response, "stop_recording", [&] {
    const RecorderStatus s = recorder_.stop();
    std::uint64_t dropped = 0;
    for (const auto& topic : s.dropped) dropped += topic.second;
    const std::string text = s.path + ": " + std::to_string(s.messages) + " messages, " +
                             std::to_string(dropped) + " lost";
    ROS_INFO("recorded %s", text.c_str());
    return text;
  });
}

bool Services::reset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  return answer(response, "reset", [&] {
    const auto lock = begin_building();
    const LimitWork limit(parameters_.limits());
    simulation_.reset(build_again());
    return std::string("frame 0 of scene '") + scene_.name + "'";
  });
}

bool Services::pause(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
  return answer(response, "pause", [&] {
    simulation_.set_paused(request.data);
    return std::string(request.data ? "paused" : "running");
  });
}

bool Services::step(Step::Request& request, Step::Response& response) {
  return answer(response, "step", [&] {
    if (request.frames < 1 || request.frames > 1000000) {
      throw std::runtime_error("frames is " + std::to_string(request.frames) +
                               ": must be from 1 to 1000000");
    }
    const StepReply reply = simulation_.step(request.frames);
    response.frame = reply.frame;
    response.time = reply.time;
    if (!reply.success) throw std::runtime_error(reply.message);
    return std::to_string(request.frames) + " frames done";
  });
}

bool Services::settle(Settle::Request& request, Settle::Response& response) {
  return answer(response, "settle", [&] {
    SettleLimits limits;
    const auto read = [](const char* name, double asked, double most, double& value) {
      if (asked == 0) return;
      if (!(asked > 0 && asked <= most)) {
        throw std::runtime_error(std::string(name) + " is " + std::to_string(asked) +
                                 ": must lie above 0 and up to " + std::to_string(most) +
                                 ", or be 0 for the default");
      }
      value = asked;
    };
    read("speed", request.speed, 100, limits.speed);
    read("time", request.time, 3600, limits.time);
    read("damping", request.damping, 1000, limits.damping);
    const StepReply reply = simulation_.settle(limits);
    if (!reply.success) throw std::runtime_error(reply.message);
    response.at_rest = reply.settled.at_rest;
    response.took = reply.settled.time;
    response.fastest = reply.settled.speed;
    return std::string(response.at_rest ? "at rest" : "not at rest when the time was over");
  });
}

bool Services::load_scene(LoadScene::Request& request, LoadScene::Response& response) {
  return answer(response, "load_scene", [&] {
    if (request.path.empty() == request.yaml.empty()) {
      throw std::runtime_error("give one of path and yaml, not " +
                               std::string(request.path.empty() ? "none" : "both"));
    }
    const auto lock = begin_building();
    const LimitWork limit(parameters_.limits());
    const PermitFolders folders(parameters_.load_folders);
    const auto permitted = [&folders](const std::string& address, const char* kind) {
      const std::string path = resolve_path(address, kind);
      folders.check(path);
      return path;
    };
    const Scene scene = request.yaml.empty()
                            ? tissue_sim::load_scene(permitted(request.path, "scene"))
                            : scene_from_yaml(request.yaml);
    for (const Body& body : scene.bodies) {
      if (body.shape == Shape::kMesh) permitted(body.mesh, "mesh");
    }
    for (const Tool& tool : scene.tools) {
      if (!tool.mesh.empty()) permitted(tool.mesh, "mesh");
    }
    if (scene.fragment_network != "off") permitted(scene.fragment_network, "network");
    Session session = make_session_(scene);
    session.folders = folders_ = parameters_.load_folders;
    if (records_all_) recorder_.add(topics_of(session));
    scene_ = session.simulation->scene();
    std::string said = "frame 0 of scene '" + scene.name + "'";
    for (const std::string& note : session.simulation->tissue().notes()) said += "; " + note;
    simulation_.replace(std::move(session));
    return said;
  });
}

}  // namespace tissue_sim
