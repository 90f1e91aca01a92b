// Replay: runs a bag that the node recorded again, from `scene` and `inputs` alone, and compares
// each `state` in it with what comes out.
#pragma once

#include <rosbag/bag.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "ros/state_message.h"

namespace tissue_sim {

/// The resolved names of one node's topics in a bag.
struct RecordedTopics {
  std::string node;  ///< its namespace, as in "/simulator"
  std::string scene, inputs, state, saved_state;
  std::vector<std::string> all;  ///< every topic of the bag
};

/// Of the node in that namespace; an empty one stands for the only one in the bag. Throws
/// std::runtime_error that says what the bag lacks.
RecordedTopics recorded_topics(const rosbag::Bag& bag, const std::string& node);

struct ReplayReport {
  int runs = 0;                     ///< from a frame 0 or a saved state on
  std::int64_t frames = 0;          ///< run again
  std::int64_t compared = 0;        ///< of them, with a `state`
  std::int64_t checksums = 0;       ///< of these, with a checksum
  std::int64_t left_out = 0;        ///< frames of a run whose beginning is not in the bag
  std::int64_t differing = 0;       ///< frames of which anything differs
  std::string first;                ///< the first of them, and in what; empty: all are the same
  std::string recorded_on, run_on;  ///< devices
};

/// What somebody may want to do with the new run. Stamps are those of the recorded one.
struct ReplayObserver {
  std::function<void(const Scene&, const ros::Time&)> begin;  ///< of a run
  /// The run goes on from this state instead of from frame 0.
  std::function<void(const Simulation&, const std::vector<std::uint8_t>&, const ros::Time&)>
      restored;
  std::function<void(Simulation&, const FrameReport&, const RunState&, const ros::Time&)> frame;
  std::function<bool()> goes_on;  ///< asked before each frame
};

class Replay {
 public:
  /// `change` may change each scene before it is run (another device).
  Replay(ReplayObserver observer, std::function<void(Scene&)> change);

  /// Throws std::runtime_error where the bag cannot be run again at all.
  ReplayReport run(rosbag::Bag& bag, const RecordedTopics& topics);

 private:
  void on_input(const FrameInputMessage& input);
  void on_state(const SimulationState& recorded);
  void on_saved_state(const SavedState& saved);
  void begin_run(const ros::Time& stamp);
  void differs(std::int64_t frame, const std::string& text);

  ReplayObserver observer_;
  std::function<void(Scene&)> change_;
  ReplayReport report_;
  std::string scene_text_;  // of the newest `scene`
  std::unique_ptr<Simulation> simulation_;
  FrameReport frame_;  // the last one
  RunState run_;
  PieceCount pieces_;
  std::int64_t last_differing_ = -1;
};

/// How `run` differs from `recorded`, in words with both values; empty if they are the same. What
/// depends on the machine (times, the device) does not count.
std::string difference(const SimulationState& recorded, const SimulationState& run);
std::string difference(const FrameInputMessage& recorded, const FrameInputMessage& run);

}  // namespace tissue_sim
