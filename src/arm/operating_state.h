// The operating states of a CRTK arm.
#pragma once

#include <string>

namespace tissue_sim {

struct OperatingState {
  std::string state = "ENABLED";  ///< DISABLED, ENABLED, PAUSED or FAULT
  bool homed = true;

  /// Whether motion is accepted.
  bool ready() const { return state == "ENABLED" && homed; }
};

/// enable, disable, pause, resume, home, unhome, fault and clear_fault. Returns "", or why it is
/// refused: then nothing changes. There is nothing to find in homing: it does not move the arm.
std::string command(OperatingState& arm, const std::string& word);

/// Why motion is refused; "" if it is not.
std::string not_ready(const OperatingState& arm);

}  // namespace tissue_sim
