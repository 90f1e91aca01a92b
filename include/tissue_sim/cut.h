// A blade's path: the one way in for every cut, whether an instrument moves it or a service asks.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tissue_sim/types.h"

namespace tissue_sim {

/// A blade edge that sweeps: at each of the `poses` the edge is the polyline `edge`, given in the
/// blade's frame. The surface between consecutive poses is what cuts.
struct BladePath {
  std::vector<Vec3> edge;   ///< [m], blade frame, at least 2 points
  std::vector<Pose> poses;  ///< world frame, at least 2
  /// Where the edge is another at the last pose, that, of as many points: between the poses it
  /// becomes it evenly. Empty: it stays.
  std::vector<Vec3> edge_at_end = {};
};

/// Throws std::invalid_argument for what Simulation::cut() does not take: less than two poses or
/// edge points, values that are not finite or absurdly far, more than 1e5 edges that are swept.
void check_path(const BladePath& path);

/// What one frame's cutting did.
struct CutReport {
  int64_t bonds_broken = 0;        ///< bonds between neighbouring particles
  int points_separated = 0;        ///< particles that lost a bond
  std::vector<int> new_fragments;  ///< ids that appeared
  int pieces_left_whole = 0;       ///< that the blade met and that are not cut ...
  std::string why_left_whole;      ///< ... in a sentence, how many and why; empty for none
};

}  // namespace tissue_sim
