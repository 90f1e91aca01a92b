// When contacts between faces are looked at, on the CPU: contact/look_at_face.h says how.
#pragma once

#include "contact/face_contact.h"

namespace tissue_sim {

/// How a facet stands, from the nodes as they are.
FacetMotion motion_of(const MpmState& state, std::int32_t facet);

/// Looks at the contacts that are due, `all` of them after a search, which knows where facets are.
/// The fastest says when all are due again, but for those of small pieces: crumbs that rattle about
/// are looked at by themselves in between.
void look_at_due(MpmState& state, double dt, bool all);

}  // namespace tissue_sim
