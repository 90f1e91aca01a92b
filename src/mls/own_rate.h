// How fast a node's own strain swings, and what of its volume bears strain so that it is no faster
// than elsewhere.
#pragma once

#include "mls/state.h"

namespace tissue_sim {

/// Sums over the pairs of a node.
struct MlsSums {
  double moment[6];    ///< w r r^T: 00 11 22 01 02 12
  double per_mass[6];  ///< w^2 / m_j r r^T
  double first[3];     ///< w r
};
MlsSums mls_sums(const MlsState& state, std::int32_t node);

/// Largest eigenvalue that the energy of a node's own strain has by itself, or less than three
/// times it: how fast nodes around it swing hangs on that [1/s^2]. Beside a cut that of all that
/// bore strain while it was whole: what is bounded tells as much of the nodes around it.
double own_rate(const MlsState& state, std::int32_t node);

/// Volume of the node that bears strain [m^3]. A support that is thin across some direction, but
/// spans space, reads strain across it from a node or two: all of the node's volume at once moves
/// with them, and swings up to ten times as fast as within a lattice. The whole body would have to
/// go by its substep. So no more of the volume bears strain than what swings by itself at a rate
/// of 20 c^2 / h^2 while the node is whole (corners of a lattice have 6.0), and of 4.5 beside a
/// cut (inner nodes of a flat face have 3.3, those at its edge 5.5); c is the speed of pressure
/// waves, h the distance to its neighbours. Of given nodes, whose distances and shares differ by
/// much, it is 8 while they are whole, and h no less than the spacing of as many even ones. The
/// penalty and the mass stay.
float strained_volume(const MlsState& state, std::int32_t node);
float strained_volume(const MlsState& state, std::int32_t node, const MlsSums& sums);

/// Takes from MlsNodes::strained_volume of whole nodes what swings too fast; whether there was any.
bool bound_own_rates(MlsState& state);

}  // namespace tissue_sim
