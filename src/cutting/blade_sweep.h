// Blade sweep: does a moving edge pass through a moving bond? Both are segments whose ends move
// linearly over the same interval, so nothing slips through, however the tissue gives way.
#pragma once

#include <algorithm>
#include <vector>

#include "tissue_sim/cut.h"
#include "tissue_sim/types.h"

namespace tissue_sim {

/// A segment whose ends move linearly from (a0, b0) to (a1, b1) [m].
struct MovingSegment {
  Vec3 a0, b0, a1, b1;
};

/// Between two planes across an axis.
struct Slab {
  Vec3 axis = Vec3::Zero();         ///< unit; 0 where there is none
  double low = 1e30, high = -1e30;  ///< of axis . x [m]
};

/// What an edge sweeps lies within three slabs: across its surface (of an edge that is held still,
/// any along it), along the edge, along its motion.
struct SweptEdge : MovingSegment {
  Slab slabs[3];
};
SweptEdge swept(const MovingSegment& edge);

/// Whether all of the bond stays outside of what the edge sweeps: cheap, and true for most.
inline bool stays_aside(const SweptEdge& e, const MovingSegment& b) {
  for (const Slab& slab : e.slabs) {
    const double a0 = slab.axis.dot(b.a0), b0 = slab.axis.dot(b.b0);
    const double a1 = slab.axis.dot(b.a1), b1 = slab.axis.dot(b.b1);
    if (std::min(std::min(a0, b0), std::min(a1, b1)) > slab.high ||
        std::max(std::max(a0, b0), std::max(a1, b1)) < slab.low) {
      return true;
    }
  }
  return false;
}

/// Where an edge meets a bond.
struct Meeting {
  double place = 0;            ///< along the bond, 0 to 1
  Vec3 normal = Vec3::Zero();  ///< to what the edge sweeps past the bond, of any length; 0 if none
};

/// Whether the two segments meet at some moment of the interval, and where. The edge includes its
/// ends (with a margin of 1e-9 of its length, so that the pieces of a polyline leave no gap), the
/// bond its own.
bool edge_passes(const MovingSegment& edge, const MovingSegment& bond, Meeting* meeting = nullptr);

/// A part of a path, short enough to be taken as linear, and the share of the path's time that it
/// spans.
struct SweepPart {
  double begin, end;  ///< in [0, 1] of the time over which the tissue moves
  std::vector<SweptEdge> edges;
  Box box;  ///< of the edges
};

/// Takes a path apart at its poses, and between poses so that no part turns by more than 4 degrees.
/// The path's time runs evenly over its poses. The edge is moved aside by some 1e-9 m, so that
/// it never passes exactly through a lattice point.
std::vector<SweepPart> sweep_parts(const BladePath& path);

}  // namespace tissue_sim
