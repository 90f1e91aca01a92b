// The bytes of a state with what they need to be recognised: version, device, scene, checksum.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tissue_sim/types.h"

namespace tissue_sim {

/// What a state belongs to.
struct StateOrigin {
  std::string scene;   ///< as YAML
  std::string device;  ///< what does the work
};

std::vector<std::uint8_t> seal_state(const StateOrigin& origin,
                                     const std::vector<std::uint8_t>& state);

/// The state in it. Throws std::runtime_error with the reason for what is no sealed state, cut
/// short, damaged, of another version, scene or device.
Span<const std::uint8_t> open_state(Span<const std::uint8_t> sealed, const StateOrigin& origin);

}  // namespace tissue_sim
