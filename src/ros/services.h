// Services of the node. Each answers in a thread of its own queue; none stops the simulation.
#pragma once

#include <ros/node_handle.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <tissue_sim/Cut.h>
#include <tissue_sim/DrainHollow.h>
#include <tissue_sim/FillHollow.h>
#include <tissue_sim/LoadScene.h>
#include <tissue_sim/RestoreState.h>
#include <tissue_sim/SaveState.h>
#include <tissue_sim/SaveSurface.h>
#include <tissue_sim/Settle.h>
#include <tissue_sim/StartRecording.h>
#include <tissue_sim/Step.h>

#include <atomic>
#include <functional>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "ros/frames.h"
#include "ros/recorder.h"
#include "ros/simulation_thread.h"

namespace tissue_sim {

/// Whether /use_sim_time is set, but no /clock came yet: nothing can be recorded.
inline bool clock_is_missing() { return ros::Time::isSimTime() && ros::Time::now().isZero(); }

class Services {
 public:
  /// Builds the connections to ROS of a scene; throws what Simulation's constructor throws.
  using MakeSession = std::function<Session(const Scene&)>;

  Services(ros::NodeHandle& node, const Scene& scene, SimulationThread& simulation,
           Recorder& recorder, const Frames& frames, const Parameters& parameters,
           MakeSession make_session);

  /// Starts a recording of the given topics (all for none), by their names below the node or
  /// resolved. Returns a message with the bag's path; throws std::runtime_error.
  std::string start_recording(const std::string& path, const std::vector<std::string>& topics);

 private:
  bool cut(Cut::Request& request, Cut::Response& response);
  bool fill(FillHollow::Request& request, FillHollow::Response& response);
  bool drain(DrainHollow::Request& request, DrainHollow::Response& response);
  bool start_recording(StartRecording::Request& request, StartRecording::Response& response);
  bool stop_recording(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  bool reset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  bool pause(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response);
  bool step(Step::Request& request, Step::Response& response);
  bool settle(Settle::Request& request, Settle::Response& response);
  bool load_scene(LoadScene::Request& request, LoadScene::Response& response);
  bool save_state(SaveState::Request& request, SaveState::Response& response);
  bool save_surface(SaveSurface::Request& request, SaveSurface::Response& response);
  bool restore_state(RestoreState::Request& request, RestoreState::Response& response);

  /// Writes a new file within the limits; throws std::runtime_error.
  void keep(const std::string& path, const std::vector<std::uint8_t>& bytes);
  /// Held while a scene is built; throws std::runtime_error where one is.
  std::unique_lock<std::mutex> begin_building();
  /// The present scene from its start. Where it came by load_scene its files are read from where
  /// that may load from, as they were then.
  std::unique_ptr<Simulation> build_again() const;
  BladePath read_path(const Cut::Request& request) const;
  std::set<std::string> select(const std::vector<std::string>& topics) const;

  ros::NodeHandle node_;
  SimulationThread& simulation_;
  Recorder& recorder_;
  const Frames& frames_;
  const Parameters parameters_;
  MakeSession make_session_;
  std::mutex rebuilding_;  // one at a time; a recording begins before or after
  Scene scene_;
  std::vector<std::string> folders_;           // see Session
  std::atomic<std::uint64_t> saved_bytes_{0};  // by save_state and save_surface
  std::atomic<bool> records_all_{false};       // the recording that runs or ran last
  std::vector<ros::ServiceServer> servers_;    // last: end before what they call
};

}  // namespace tissue_sim
