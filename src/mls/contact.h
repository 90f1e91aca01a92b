// Contact of nodes with tools and the ground.
#pragma once

#include "mls/state.h"
#include "mls/stop_tool.h"

namespace tissue_sim {

/// Whether groups list anew in this substep which colliders are near; counts down.
bool is_list_due(MlsState& state);

/// Lists the colliders that the group may meet before the next list.
void list_near(MlsState& state, int group, float dt);

/// Adds to the forces [4 kMlsGroup] on a group's nodes what colliders at their present places push
/// them with, in a substep of dt whose forces act for `kick` [s], and notes it in the group's
/// loads. What stops tools at its nodes goes into `stops`;
/// returns whether any does.
bool add_contact(MlsState& state, int group, float dt, float kick, float* force, MlsStop* stops);

/// Change of velocity of a node of the group that stops a tool, and on which `force` acts besides.
void move_stopping(MlsState& state, int group, std::int32_t node, const MlsStop& stop, float kick,
                   const float* force, float* dv);

}  // namespace tissue_sim
