// ToolInput: where one instrument is, from its topics or from tf, checked.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <ros/node_handle.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Float64.h>

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "ros/frames.h"
#include "ros/held_samples.h"
#include "ros/jaw_check.h"
#include "ros/pace.h"
#include "ros/parameters.h"
#include "ros/pose_check.h"
#include "ros/recorder.h"
#include "ros/sample_track.h"
#include "ros/tool_status.h"
#include "tissue_sim/tool.h"

namespace tissue_sim {

/// Thread-safe. Callbacks come on the node handle's queue.
class ToolInput {
 public:
  /// `tissue` is the box of all tissue as it is at the start [m]. With `on_sample`, samples are
  /// held until they are taken by stamp or one by one, and it is called for each. With
  /// `publishes_tf` the node says where the tool is, as a frame of its name, in which no pose of
  /// its own can be.
  ToolInput(const ros::NodeHandle& node, const Tool& tool, const ToolParameters& source,
            const PoseLimits& limits, const Frames& frames, const Box& tissue, Recorder& recorder,
            std::function<void()> on_sample, bool publishes_tf = true);

  /// Where the tool shall be in a frame that takes the samples stamped up to `until` [ns], or kAll,
  /// or kNext: the oldest pose that is held, with the oldest jaw angle. It is where the newest of
  /// these says or, with interpolation, on the way to it. None before the first pose. Where the
  /// tool follows tf, looks there.
  std::optional<ToolRequest> at(std::int64_t until);
  static constexpr std::int64_t kAll = std::numeric_limits<std::int64_t>::max();
  static constexpr std::int64_t kNext = std::numeric_limits<std::int64_t>::min();

  /// For a simulation that starts anew, and its instruments' time with it: the newest sample counts
  /// as placed, and the next pose as the first.
  void rewind();
  /// For a simulation that goes on from a state, in which the tool moves like this: nothing is
  /// asked for before the next pose comes, and if one frame can bring the tool there it moves
  /// there.
  void go_on(const ToolMotion& state);

  bool has_next();         ///< a pose and, of a grasper whose jaws are connected, an angle
  bool connected() const;  ///< somebody publishes its poses
  /// Stamp of the oldest pose that is held [ns].
  std::optional<std::int64_t> first_held();
  /// Somebody publishes its poses, but none has come since the start.
  bool awaited() const;

  /// A scene starts at its frame 0.
  void begin();
  /// Time has jumped back to `now`: what came before is forgotten but for what is latched, which
  /// will not come again.
  void restart(const ros::Time& before, const ros::Time& now);
  /// Samples that came after the frame that they were for had begun, since begin(); and those that
  /// were held in vain, for too many others came.
  std::uint64_t late() const;

  ToolStatus status() const;
  const std::string& tool() const { return tool_.name; }
  /// What it listens to, for a recording.
  std::set<std::string> topics() const;

 private:
  struct PoseSample {
    std_msgs::Header header;
    Pose pose;
    bool latched;
  };
  struct JawSample {
    JawAngle jaw;
    bool latched;
  };

  template <class Event>
  void on_pose(const Event& event);
  void on_jaw(const ros::MessageEvent<const sensor_msgs::JointState>& event);
  void on_grip_pressure(const std_msgs::Float64::ConstPtr& message);
  /// Accepts a sample now, or when a frame takes it.
  template <class Sample>
  void add(HeldSamples<Sample>& held, const ros::Time& stamp, Sample sample);
  void accept(const PoseSample& sample);
  void accept(const JawSample& sample);
  /// Where the tool follows tf: where it was at that time; 0: the newest.
  void follow_tf(const ros::Time& at);
  /// A pose, in a frame that stands in the world like this, is checked and becomes the newest.
  void use(const Pose& frame, const Pose& in_frame, const ros::Time& stamp);
  /// Refuses, and says so, what is stamped as nothing can be.
  bool has_wrong_stamp(const ros::Time& stamp, bool is_pose);
  void refuse(Refusal refusal, const std::string& text);
  void forget_if_time_jumped_back();
  /// By what samples follow one another [s]: when they come, or by the stamps of those that are
  /// held.
  double now() const;
  /// Whether a warning is due again, once a second by the wall's clock.
  bool may_warn();

  const Tool tool_;
  const std::string tf_frame_;
  const bool interpolates_, publishes_tf_;
  const Frames& frames_;
  const Box tissue_;
  Recorder& recorder_;
  std::string pose_topic_, jaw_topic_, grip_topic_;  // resolved

  const std::function<void()> on_sample_;
  mutable std::mutex held_mutex_;  // of what follows
  HeldSamples<PoseSample> held_poses_;
  HeldSamples<JawSample> held_jaws_;
  std::uint64_t late_ = 0;
  bool pose_latched_ = false, jaw_latched_ = false;  // the newest is
  bool came_since_ = false;                          // a pose since the start
  double held_now_ = 0;                              // [s]

  mutable std::mutex mutex_;  // of what follows
  PoseCheck check_;
  PoseCounts counts_;
  SampleTrack<Pose> poses_;   // accepted
  SampleTrack<double> jaws_;  // the same
  bool placed_ = false;       // no frame took the pose since it was placed
  std::optional<double> grip_pressure_;
  std::optional<Pose> goes_on_from_;  // until the next pose
  bool came_ = false, rounded_ = false, warned_of_distance_ = false;
  ros::Time tf_stamp_, newest_time_;
  WallTime last_came_;  // or when it began to listen
  WallTime last_warning_;
  std::string waiting_, far_;  // see ToolStatus
  std::string jaw_problem_;    // that was said last: each is said once

  ros::Subscriber pose_subscriber_, jaw_subscriber_, grip_subscriber_;  // last: end before the rest
};

using ToolInputs = std::vector<std::unique_ptr<ToolInput>>;  // parallels Scene::tools

}  // namespace tissue_sim
