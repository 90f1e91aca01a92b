// arm_node: run it in a namespace that is the arm's name.
#include <exception>

#include "ros/arm/arm_node.h"

int main(int argc, char** argv) {
  using tissue_sim::CrtkTopics;
  ros::init(argc, argv, "arm");
  ros::NodeHandle node, own("~");
  try {
    std::string name = node.getNamespace();
    name = name.substr(name.rfind('/') + 1);
    const auto parameters = tissue_sim::read_arm_parameters(own, name.empty() ? "arm" : name);
    if (!CrtkTopics::available()) {
      ROS_WARN(
          "built without crtk_msgs: operating_state, state_command, info, warning, "
          "forward_kinematics and inverse_kinematics are not there, all else is; build crtk_msgs "
          "from its source, source its workspace (docs/arm.md) and build this package again");
    }
    tissue_sim::ArmNode(node, parameters).run();
  } catch (const std::exception& e) {
    ROS_FATAL("cannot run the arm: %s", e.what());
    return 1;
  }
  return 0;
}
