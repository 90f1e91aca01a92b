// When contacts between faces are looked at, on the CPU: mpm/contact/narrow_phase.h says how.
#pragma once

#include "mpm/contact/face_contact.h"

namespace tissue_sim {

/// How a facet stands, from the nodes as they are.
FacetMotion motion_of(const MpmState& state, std::int32_t facet);

/// Looks at the contacts that are due, `all` of them after a search, which knows where facets are.
/// How fast each moves says when it is due again, not the fastest: debris that rattles about does
/// not make all others be looked at as often.
void look_at_due(MpmState& state, double dt, bool all);

}  // namespace tissue_sim
