// What the node says about itself on /diagnostics.
#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/node_handle.h>
#include <ros/wall_timer.h>

#include <cstdint>
#include <string>

#include "ros/recorder.h"
#include "ros/simulation_thread.h"

namespace tissue_sim {

/// For who waits for a simulation that is this many times too slow: what to make coarser, and how
/// much.
std::string coarser(const Scene& scene, double slower);

/// Once a second: the simulation, its tools' poses and the recording.
class Diagnostics {
 public:
  Diagnostics(ros::NodeHandle& node, const SimulationThread& simulation, const Recorder& recorder);

 private:
  using Status = diagnostic_updater::DiagnosticStatusWrapper;
  void simulation(Status& status);
  void tools(Status& status);
  void recording(Status& status);

  ros::NodeHandle node_;
  const SimulationThread& simulation_;
  const Recorder& recorder_;
  std::uint64_t refused_before_ = 0;
  int slow_reports_ = 0;  // one after the other
  diagnostic_updater::Updater updater_;
  ros::WallTimer timer_;
};

}  // namespace tissue_sim
