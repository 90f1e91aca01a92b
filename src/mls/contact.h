// Contact of nodes with tools and the ground.
#pragma once

#include "mls/state.h"

namespace tissue_sim {

/// Whether groups list anew in this substep which colliders are near; counts down.
bool is_list_due(MlsState& state);

/// Lists the colliders that the group may meet before the next list.
void list_near(MlsState& state, int group, float dt);

/// Adds to the forces [4 kMlsGroup] on a group's nodes what colliders at their present places push
/// them with, and notes it in the group's loads.
void add_contact(MlsState& state, int group, float* force);

}  // namespace tissue_sim
