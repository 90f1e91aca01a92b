// Tears of tetrahedra: faces part where tissue is stretched past what its material bears, by the
// same path as under blades.
//
// A vertex is stretched as the tetrahedra around it are on the mean, one at a crack's front as the
// one of them that is stretched most. Past its limit, they come apart across the direction that is
// stretched most, in reference space, along faces:
//   A crack goes on at the vertices of its front: what lies across the plane through the middles of
//   the links that it broke there parts, and what the crack passed knows its side. Beside what an
//   anchor holds it parts what hangs on there from what does not, whatever the direction.
//   A crack begins where there is none beside it: at the vertex of each body that is furthest past
//   its limit and, unless that is by a tenth of the limit's strain, not before waves from the last
//   tear have crossed the body, for they relieve what is past its limit by a little.
// Lips do not tear on, so nothing turns to dust where much is past its limit at once.
#pragma once

#include <vector>

#include "pbd/pbd_state.h"
#include "tissue_sim/cut.h"

namespace tissue_sim {
namespace pbd {

/// Whether any tetrahedra of the state tear.
bool can_tear(const State& s);
/// How many times a frame of `duration` [s] looks for tears: a crack goes on by kTearSteps vertices
/// each time, about as fast as pressure waves.
int tear_checks(const State& s, double duration);
constexpr int kTearSteps = 6;
/// Parts what tears, `since` [s] after the last look; as cut_tetrahedra() for the rest.
bool tear_tetrahedra(State& s, double since, std::vector<std::int32_t>& origin, CutReport& report);

}  // namespace pbd
}  // namespace tissue_sim
