// Tissue that is drawn so far over a tool that its places of contact lie further apart than the
// tool is wide: it must not come through between them.
#pragma once

#include <vector>

#include "mpm/contact/facet_in_world.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

/// Half of the longest diagonal of a cell's surface elements, as they are stretched: how far their
/// rims are from their middles [m].
///   x: places of the block's points, [3][lane_count()] (BlockKernels::positions)
///   cell: lane of the cell's first point
float element_reach(const LatticeBody& body, const Block& block, const float* x, int cell);

/// How far elements of whole tissue reach.
inline constexpr float kWholeReach = 0.36f;  // cells

/// Where a tool can sink into elements that reach so far by more than may be, while their middles
/// do not touch it, NearCell::taut; else 0.
std::uint8_t taut_reach(const Collider& collider, const LatticeBody& body, float reach);

/// Deeper than this in a tool tissue is held by more than its contact springs.
inline constexpr float kMaySink = 0.25f;  // cells

/// A place of a surface element that lies deeper in a tool than it may.
struct SunkPlace {
  std::int32_t node;  ///< lowest of its cell, in the block's nodes
  std::uint8_t collider;
  float at[3];  ///< [m]
  float deep;   ///< beyond what it may [m]
  float normal[3];
  AxisWeights weights;
};

/// Appends, of each surface element of a cell, the place that is deepest in a tool, if that is too
/// deep.
void find_sunk(const MpmState& state, const Block& block, const NearCell& cell,
               const Collider& collider, std::vector<SunkPlace>& sunk);

/// Pushes on all of a block: by springs as stiff as substeps of `dt` bear together, without
/// friction. Adds the colliders' loads.
void push_sunk(const MpmState& state, const Block& block, const std::vector<SunkPlace>& sunk,
               float dt, float* force, std::vector<ColliderLoad>& loads);

}  // namespace tissue_sim
