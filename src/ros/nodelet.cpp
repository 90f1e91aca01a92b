// tissue_sim/Simulator: the simulator as a nodelet.
#include <nodelet/nodelet.h>

#include <exception>
#include <memory>
#include <pluginlib/class_list_macros.hpp>

#include "ros/node.h"

namespace tissue_sim {

class SimulatorNodelet : public nodelet::Nodelet {
  void onInit() override {
    try {
      node_ = std::make_unique<Node>(getPrivateNodeHandle());
    } catch (const std::exception& e) {
      NODELET_FATAL("cannot start: %s", e.what());
      throw;
    }
  }

  std::unique_ptr<Node> node_;
};

}  // namespace tissue_sim

PLUGINLIB_EXPORT_CLASS(tissue_sim::SimulatorNodelet, nodelet::Nodelet)
