// Contact of tissue with tools and the ground, block by block.
#pragma once

#include <vector>

#include "mpm/mpm_state.h"

namespace tissue_sim {

inline constexpr std::uint8_t kPointKey = 128;  ///< Touch::key of a point, above those of places

/// Finds out which colliders each block may meet in a frame of `duration` seconds, from where its
/// points are, how fast they move (MpmState::motion) and what each collider sweeps (`reach`); lets
/// go of contacts that are out of reach. `before`: where they were before, too.
void find_near_colliders(MpmState& state, const std::vector<Box>& reach, double duration,
                         const std::vector<BlockMotion>& before = {});

/// Whether a block (MpmState::motion) has come to a collider that find_near_colliders() did not
/// foresee, for it went faster later.
bool came_unforeseen(const MpmState& state, const std::vector<Box>& reach);

/// Makes the lists of points in contact anew after update_blocks(), with no collider near.
void list_contacts(MpmState& state);

/// Of some points, in order, that were put elsewhere: contact begins as deep as they are now.
void begin_anew(Contacts& contacts, const std::vector<std::int32_t>& points);

/// Counts a substep. Returns whether cells near colliders must be listed anew before it.
bool is_list_due(Contacts& contacts);

/// Lists a block's cells that a collider may touch until the next list, with substeps of `dt`
/// seconds.
void list_near_cells(MpmState& state, int block, float dt);

/// Adds contact forces to the block's part of the force buffer, before a substep of `dt` seconds,
/// and sums the loads of the colliders.
void add_contact(MpmState& state, int block, float dt, float* force,
                 std::vector<ColliderLoad>& loads);

}  // namespace tissue_sim
