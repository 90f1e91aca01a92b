// Parameters of the node, from the parameter server. All functions throw std::invalid_argument with
// "~<name> is <value>: <what is allowed>".
#pragma once

#include <ros/node_handle.h>

#include <map>
#include <string>
#include <vector>

#include "ros/pose_track.h"
#include "tissue_sim/limits.h"
#include "tissue_sim/scene.h"

namespace tissue_sim {

/// Where a tool's poses come from: the group `tools/<tool>`.
struct ToolParameters {
  std::string pose_type = "PoseStamped";  ///< of measured_cp: PoseStamped or TransformStamped
  std::string tf_frame;                   ///< follow this tf frame instead of the topic
  std::string interpolate = "none";       ///< between samples: none, or linear, one sample later
};

/// What frames keep to.
enum class TimeMode {
  kWall,      ///< the wall clock, dropping behind where they are late
  kRos,       ///< ROS time: /clock, with poses by their stamps
  kLockstep,  ///< the instruments: one frame for each sample of all of them, or by step
};

struct Parameters {
  TimeMode time = TimeMode::kWall;
  double pose_delay = 0.02;    ///< kRos: the frame at t uses poses stamped up to t less this [s]
  double time_factor = 1;      ///< but kRos: simulated over wall time, 0: as fast as it goes
  bool publish_clock = false;  ///< but kRos: /clock
  std::vector<std::string> lockstep_tools;  ///< that are waited for; empty: who is connected
  std::string world_frame = "world";
  bool paused = false;     ///< at the start
  double cloud_rate = 30;  ///< [Hz] of wall time
  int cloud_stride = 1;    ///< every n-th point
  bool cloud_surface_only = false;
  unsigned cloud_fields = 0;       ///< PointFields that clouds carry, too
  double fragment_rate = 10;       ///< [Hz], and whenever the pieces change
  double state_rate = 0;           ///< [Hz], 0 for every frame of the scene's frame_rate
  double wrench_rate = 0;          ///< [Hz]: frames are as short as it asks; 0: the scene's
  double marker_rate = 15;         ///< [Hz]
  bool checksum = true;            ///< in each state
  double force_scale = 0.02;       ///< length of the force arrows [m/N]
  bool publish_tf = true;          ///< world_frame -> tool
  double max_tool_speed = 5;       ///< [m/s]
  double max_tool_turn_rate = 60;  ///< [rad/s]
  double tf_tolerance = 0.1;       ///< how old the newest transform of a moving frame may be [s]
  std::string recording_folder;    ///< absolute
  std::string record;              ///< name of a recording from the first frame on; "" for none
  double recording_queue = 1024;   ///< [MiB]
  double recording_reserve = 256;  ///< disk space left free [MiB]
  double recording_limit = 0;      ///< largest bag [MiB], 0 for as much as the disk takes
  std::vector<std::string> load_folders;  ///< that services load from, absolute; empty: anywhere
  double longest_work = 300;              ///< that a frame, or building a scene, takes at most [s]
  /// Of building and of frames; `stop` is whoever's who runs them.
  WorkLimits work;
  std::map<std::string, ToolParameters> tools;

  /// `work`, from now on for longest_work.
  WorkLimits limits() const;
};

/// `stop`, if given, ends the work of the node once it is true.
Parameters read_parameters(const ros::NodeHandle& node, const std::atomic<bool>* stop = nullptr);

/// The scene that the parameters ask for: ~scene_file, or ~scene (YAML text or a tree of
/// parameters), by ~method if that is set, with ~mesh and ~mesh_scale in place of the first body's
/// shape.
Scene read_scene_parameters(const ros::NodeHandle& node);

/// Puts a mesh in the place of the scene's first body: its bounding box is centred where the body's
/// centre was, seen from above, and rests on the ground (or, without one, is centred in z too). The
/// material stays; inclusions and anchors keep their place in proportion to the box.
void put_mesh(Scene& scene, const std::string& mesh, double scale);

/// A recording's name from a parameter or an argument: "", false: none; "true": "" (date and time).
struct RecordRequest {
  bool wanted = false;
  std::string name;
};
RecordRequest record_request(const std::string& value);

}  // namespace tissue_sim
