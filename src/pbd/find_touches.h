// Which vertices may touch which triangles of other pieces in a frame.
#pragma once

#include "pbd/pbd_state.h"

namespace tissue_sim {
namespace pbd {

/// Makes State::touches and State::group anew, from where vertices are now: pairs that the frame
/// of `duration` seconds may bring together. Lips of a cut, which lie on one another at rest, touch
/// and do not push.
void find_touches(State& s, double duration);

/// How many searches a frame of `duration` seconds takes, at least 1. Between two of them no vertex
/// that may meet another piece goes farther than an edge is long: what went farther passed through.
/// `struck` [m/s]: how fast tools come, which what they strike is not yet known to be.
double searches_of(const State& s, double struck, double duration);

}  // namespace pbd
}  // namespace tissue_sim
