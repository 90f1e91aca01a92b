// What `state` says of a frame: the node publishes it, a replay compares it.
#pragma once

#include "ros/messages.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {

/// How the simulation stands, besides what the frame's report says.
struct RunState {
  bool paused = false;
  bool blew_up = false;
  double real_time_factor = 0;
  std::uint64_t late_samples = 0;  ///< of instruments, see ToolInput::late()
};

struct PieceCount {
  int count = 0, loose = 0;
  double volume = 0;  ///< undeformed [m^3]

  /// Counts anew where pieces came apart; returns whether any did.
  bool follow(Tissue& tissue);
};

/// Without its header. `checksum`: whether to work it out.
SimulationState state_message(Simulation& simulation, const FrameReport& report,
                              const RunState& run, const PieceCount& pieces, bool checksum);

}  // namespace tissue_sim
