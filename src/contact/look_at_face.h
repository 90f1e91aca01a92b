// A look at a contact: which facet a facet touches, how deep it is, where it is held.
#pragma once

#include "contact/face_contact.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

// Lengths in cells.
inline constexpr float kSearchReach =
    0.75f;                                ///< half size of the box in which a facet looks around
inline constexpr float kNearGap = 0.25f;  ///< up to which a contact is worked on in each substep
inline constexpr float kMovedBetweenLooks = 0.1f;

/// Looks anew at contact `i` of FaceContacts::all: which facet, its normal, and the place held.
/// Returns how fast the two move against one another [m/s], 0 if there is none.
float look(MpmState& state, int i, double dt);

/// Lets contact `i` go on from what it was before blocks were made anew. Returns whether it does.
bool take_up(MpmState& state, int i, const KeptContact& kept, double dt);

}  // namespace tissue_sim
