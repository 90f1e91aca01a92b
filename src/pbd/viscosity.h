// Viscosity: a dashpot at each edge.
#pragma once

#include <vector>

#include "pbd/pbd_state.h"

namespace tissue_sim {
namespace pbd {

/// Neighbours along edges of surfaces or of tetrahedra lose what they move by against one another,
/// apart from the rigid motion of what they hang together with, as their body's viscosity would
/// have it over `duration` [s] and the edge's length, at the rate eta / (rho l^2): a wave of shear
/// in tetrahedra decays as the material's eta has it, within a fifth. Of surfaces it is, from 1 Pa
/// s on, 80 / s at least; where they were cut eta is at least liver's, for constraints of slivers,
/// which nothing else damps, carry what each further cut adds. Pair by pair, so linear momentum is
/// kept; angular momentum is given back.
void damp_neighbours(State& s, double duration);

/// Makes State::dampers for `duration`, unless they are; whether there are any.
bool make_dampers(State& s, double duration);

}  // namespace pbd
}  // namespace tissue_sim
