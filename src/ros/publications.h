// Publications: everything that the node says about one scene's simulation.
#pragma once

#include <geometry_msgs/WrenchStamped.h>
#include <ros/node_handle.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/String.h>
#include <tf2_msgs/TFMessage.h>
#include <visualization_msgs/MarkerArray.h>

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "ros/cameras.h"
#include "ros/cloud_memory.h"
#include "ros/fluid_output.h"
#include "ros/markers.h"
#include "ros/messages.h"
#include "ros/output.h"
#include "ros/pace.h"
#include "ros/parameters.h"
#include "ros/state_message.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {

/// When a frame is done.
struct FrameTime {
  ros::Time stamp;     ///< of its messages
  double elapsed = 0;  ///< by the clock that rates of topics are of [s]
};

/// Belongs to the simulation's thread, but for the constructor and topics().
class Publications {
 public:
  /// Without `frames` cameras stay where the scene has them.
  Publications(ros::NodeHandle& node, const Scene& scene, const Parameters& parameters,
               Recorder& recorder, const Frames* frames = nullptr);

  /// Names of the topics as they are in bags.
  std::set<std::string> topics() const;
  const std::string& surface_topic() const { return surface_.topic(); }

  /// The scene, latched: at the start and at every reset.
  void announce(const ros::Time& stamp);
  /// The scene into a recording that has just begun.
  void record_scene(const ros::Time& stamp);
  /// The state that a run in the bag goes on from.
  void record_state(const Simulation& simulation, const std::vector<std::uint8_t>& state,
                    const ros::Time& stamp);
  /// A frame is done. `all`: also what has a rate and is not due yet.
  void publish(Simulation& simulation, const FrameReport& report, const RunState& run,
               const FrameTime& time, bool all);
  /// Forces and tf of a simulation that stands still: clients wait for them. Not into the bag.
  void hold(const FrameReport& report, const RunState& run, const ros::Time& stamp);
  /// For those who watch a simulation that stands still. Nothing goes into the bag.
  void show(Simulation& simulation, const FrameReport& report, const RunState& run,
            const ros::Time& stamp);

 private:
  struct ToolOutputs {
    Output<geometry_msgs::WrenchStamped> body, spatial;
    std::optional<Output<JawGrip>> grip;  // of a grasper
  };
  struct AnchorOutput {
    std::size_t number;  // in the order of the scene
    Output<geometry_msgs::WrenchStamped> spatial;
  };
  std_msgs::Header header(const ros::Time& stamp) const;
  boost::shared_ptr<const SimulationState> state(Simulation& simulation, const FrameReport& report,
                                                 const RunState& run, const ros::Time& stamp) const;
  boost::shared_ptr<const FragmentArray> fragment_message(Simulation& simulation,
                                                          const ros::Time& stamp) const;
  boost::shared_ptr<const sensor_msgs::PointCloud2> cloud(Simulation& simulation, bool loose_only,
                                                          const ros::Time& stamp);
  boost::shared_ptr<const visualization_msgs::MarkerArray> marker_message(Simulation& simulation,
                                                                          const FrameReport& report,
                                                                          const ros::Time& stamp);
  boost::shared_ptr<const visualization_msgs::Marker> surface_message(Simulation& simulation,
                                                                      const ros::Time& stamp);
  /// `into_bag`: else to those who listen alone.
  void publish_loads(const FrameReport& report, const ros::Time& stamp, bool into_bag) const;
  void publish_tf(const FrameReport& report, const ros::Time& stamp, bool into_bag);

  const Scene scene_;
  const Parameters parameters_;
  std_msgs::String::ConstPtr scene_text_;
  Markers markers_;

  Output<std_msgs::String> scene_output_;
  Output<SimulationState> state_;
  Output<FrameInputMessage> inputs_;
  Output<SavedState> saved_state_;
  Output<FragmentArray> fragments_;
  Output<sensor_msgs::PointCloud2> points_, loose_points_;
  Output<visualization_msgs::Marker> surface_;
  Output<visualization_msgs::MarkerArray> marker_output_;
  Output<tf2_msgs::TFMessage> tf_;
  std::vector<ToolOutputs> tools_;
  std::vector<AnchorOutput> anchors_;  ///< those that have names

  SurfaceTriangles surface_triangles_;  ///< kept for their memory
  Throttle state_due_, fragments_due_, clouds_due_, markers_due_;
  /// The last clouds, to be filled again when nobody else holds them: see ros/cloud_memory.h.
  std::array<boost::shared_ptr<sensor_msgs::PointCloud2>, 4> clouds_;
  std::size_t next_cloud_ = 0;
  PieceCount pieces_;
  ros::Time tf_stamp_;
  std::optional<FluidOutput> fluid_;  ///< of a scene that has any
  std::unique_ptr<Cameras> cameras_;  ///< null without any; last, for it has a thread
};

}  // namespace tissue_sim
