// What edges of blades do in the substeps of a part of a frame: cutting/edge_forces.h.
#pragma once

#include <vector>

#include "tools/collider.h"

namespace tissue_sim {

class EdgePushes {
 public:
  virtual ~EdgePushes() = default;
  /// Before a substep of dt seconds, of which the nodes feel `kick`, with the scene's colliders
  /// where they will be: pushes nodes, adds what acts on the blades to `loads`. Returns the work of
  /// cutting [J].
  virtual double push(double dt, double kick, std::vector<ColliderLoad>& loads) = 0;
  /// After the last substep: what edges hold is known.
  virtual void end() = 0;
};

}  // namespace tissue_sim
