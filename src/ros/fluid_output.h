// What the node says of a scene's fluid.
#pragma once

#include <ros/node_handle.h>
#include <sensor_msgs/PointCloud2.h>

#include <set>
#include <string>

#include "ros/messages.h"
#include "ros/output.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {

class FluidOutput {
 public:
  FluidOutput(ros::NodeHandle& node, Recorder& recorder)
      : points_(node, "fluid/points", 2, recorder), amounts_(node, "fluids", 10, recorder) {}
  std::set<std::string> topics() const { return {points_.topic(), amounts_.topic()}; }
  /// What anybody wants; `into_bag`: else those who listen alone.
  void send_points(Simulation& simulation, const std_msgs::Header& header, bool into_bag) const;
  void send_amounts(Simulation& simulation, const std_msgs::Header& header, bool into_bag) const;

 private:
  Output<sensor_msgs::PointCloud2> points_;
  Output<FluidArray> amounts_;
};

}  // namespace tissue_sim
