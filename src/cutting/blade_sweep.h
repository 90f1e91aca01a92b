// Blade sweep: the edges of a blade as they move along its path.
#pragma once

#include <vector>

#include "cutting/edge_passes.h"
#include "tissue_sim/cut.h"
#include "tissue_sim/types.h"

namespace tissue_sim {

using MovingSegment = SegmentOf<Vec3>;
using Slab = SlabOf<Vec3>;
using SweptEdge = SweptEdgeOf<Vec3>;
using Meeting = MeetingOf<Vec3>;

SweptEdge swept(const MovingSegment& edge);

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

/// How many edges sweep_parts() has in all its parts: what a cut costs.
double swept_edges(const BladePath& path);

}  // namespace tissue_sim
