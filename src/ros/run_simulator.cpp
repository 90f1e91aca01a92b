// simulator_node: the simulator as an executable.
#include <ros/console.h>
#include <ros/init.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>

#include <csignal>
#include <exception>
#include <memory>

#include "ros/node.h"
#include "ros/programs.h"

namespace tissue_sim {

int run_simulator(int argc, char** argv) {
  ros::init(argc, argv, "simulator");
  ros::NodeHandle node("~");
  // As SIGINT does in roscpp: a recording is closed before the program ends.
  std::signal(SIGTERM, [](int) { ros::requestShutdown(); });
  std::unique_ptr<Node> simulator;
  try {
    simulator = std::make_unique<Node>(node, true);
  } catch (const std::exception& e) {
    ROS_FATAL("cannot start: %s", e.what());
    return 1;
  }
  ros::spin();
  return 0;
}

}  // namespace tissue_sim
