// Viscosity of a surface that was cut: a dashpot at each edge.
#pragma once

#include "pbd/pbd_state.h"

namespace tissue_sim {
namespace pbd {

/// Neighbours along edges lose what they move by against one another, apart from the rigid motion
/// of what they hang together with, as a viscosity of 1 Pa s (liver's) would have it over
/// `duration` [s] and the edge's length, at the rate eta / (rho l^2). Pair by pair, so linear
/// momentum is kept; angular momentum is given back. A surface that was cut needs it: constraints
/// of slivers, which nothing else damps, carry what each further cut adds. Nothing for what was not
/// cut, and for tetrahedra.
void damp_neighbours(State& s, double duration);

}  // namespace pbd
}  // namespace tissue_sim
