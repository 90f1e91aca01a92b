// The loops of edges around wounds of the surface model.
#pragma once

#include <vector>

#include "pbd/pbd_state.h"

namespace tissue_sim {
namespace pbd {

/// Loops of edges that have one triangle, against that triangle's sense; only of vertices that lie
/// on strokes. From an edge the next one is found around the vertex, through its triangles: several
/// loops may pass there.
std::vector<std::vector<std::int32_t>> open_loops(const State& s);

struct LoopPart {
  std::vector<std::int32_t> loop;
  std::int32_t twin;  ///< of the loop's first vertex, where it comes back to; -1 if to itself
};

/// A loop that comes back to the same place goes around a slit there, whose lips lie on one
/// another, or is two loops that touch: each part by itself, without what has no area.
std::vector<LoopPart> simple_loops(const State& s, const std::vector<std::int32_t>& loop);

}  // namespace pbd
}  // namespace tissue_sim
