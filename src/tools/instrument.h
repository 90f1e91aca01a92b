// Instrument: a tool of a running simulation: what it was asked for last, and how it follows.
#pragma once

#include <string>

#include "tissue_sim/tissue.h"
#include "tools/grip.h"

namespace tissue_sim {

class Instrument {
 public:
  /// Of the next frame; until the next request it goes on towards this one.
  void ask(const ToolRequest& request);
  void set_grip_pressure(double pressure) { grip_pressure_ = pressure; }  ///< 0: the scene's [Pa]
  /// The tool is where somebody else moved it.
  void put(const ToolMotion& motion, double grip_pressure);

  /// How it moves in the next frame, of `duration` [s], from where `motion` left it. Returns what
  /// there is to say of it, "" for nothing.
  std::string move(const Tool& tool, double duration, double cell_size, Tissue& tissue,
                   ToolMotion& motion);
  /// Closes a grasper's jaws no further than its pressure lets them. Returns that pressure as it
  /// comes out, for a replay gets the jaws no longer as they were asked for; 0 of others [Pa].
  double limit_jaws(const Tool& tool, double duration, ToolMotion& motion) const;
  /// What the frame brought.
  void follow(const ToolMotion& motion, const ToolLoad& load);

 private:
  template <class Archive>
  friend void fields(Archive& archive, Instrument& instrument);  // frame/state_fields.h

  Pose asked_;
  double jaw_ = 0;            // that was asked for [rad]
  bool is_placed_ = false;    // the next frame places it
  bool is_asked_ = false;     // ever
  double way_in_ = 0;         // left of it: it is drawn back by that along its shaft [m]
  double grip_pressure_ = 0;  // 0: the scene's [Pa]
  Grip grip_;
};

}  // namespace tissue_sim
