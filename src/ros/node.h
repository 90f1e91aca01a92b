// Node: the simulator as a ROS node, for the executable and the nodelet alike.
#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>
#include <ros/wall_timer.h>

#include <memory>

#include "ros/clock_topic.h"
#include "ros/diagnostics.h"
#include "ros/frames.h"
#include "ros/parameters.h"
#include "ros/recorder.h"
#include "ros/services.h"
#include "ros/shutdown_watch.h"
#include "ros/simulation_thread.h"

namespace tissue_sim {

class Node {
 public:
  /// Reads the parameters below `node`, builds their scene and starts the simulation. Throws
  /// std::exception with one line that says why it cannot.
  /// `owns_process`: where it cannot end in time, the process ends.
  explicit Node(const ros::NodeHandle& node, bool owns_process = false);
  ~Node();

 private:
  Session make_session(const Scene& asked);
  /// Starts the recording that the parameters ask for, and the simulation, which stood still so
  /// that the bag holds frame 0. While there is no /clock it waits for one, and says so.
  void record_from_start(const std::string& name);
  void connect_clock();
  void stop_recording();

  ShutdownWatch watch_;  // first: outlives what works
  // Queues of their own: a service that takes long does not hold up the poses.
  ros::CallbackQueue pose_queue_, service_queue_;
  ros::NodeHandle pose_node_, service_node_;
  const Parameters parameters_;
  Recorder recorder_;
  Frames frames_;
  ClockTopic clock_;
  std::unique_ptr<SimulationThread> simulation_;
  std::unique_ptr<Services> services_;
  std::unique_ptr<Diagnostics> diagnostics_;
  ros::WallTimer clock_timer_;
  int waited_ = 0;  // for /clock, a tenth of a second each
  ros::Subscriber clock_subscriber_;
  ros::AsyncSpinner pose_spinner_, service_spinner_;
};

}  // namespace tissue_sim
