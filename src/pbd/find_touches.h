// Which vertices may touch which triangles of other pieces in a frame.
#pragma once

#include "pbd/pbd_state.h"

namespace tissue_sim {
namespace pbd {

/// Makes State::touches and State::touching anew, from where vertices are now: pairs that the frame
/// of `duration` seconds may bring together. Lips of a cut, which lie on one another at rest, touch
/// and do not push.
void find_touches(State& s, double duration);

}  // namespace pbd
}  // namespace tissue_sim
