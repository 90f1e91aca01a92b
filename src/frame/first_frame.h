// Whether a scene can be run, before its first frame.
#pragma once

#include <string>
#include <vector>

#include "tissue_sim/fragments.h"
#include "tissue_sim/scene.h"

namespace tissue_sim {

class Tissue;

/// Throws std::invalid_argument where a frame would take more than kMostSubstepsOfFrame, even as
/// long as the undeformed tissue of each material bears them; names the fields.
void check_first_frame(const Scene& scene);

/// Throws std::invalid_argument for a piece that lies below the ground as a whole.
void check_ground(const Scene& scene, Span<const Fragment> pieces);
/// Throws std::invalid_argument where tissue of an anchored body begins more than a cell below the
/// ground and no anchor holds it: between the two it would be stretched without bound.
void check_held(const Scene& scene, Tissue& tissue);
/// What there is to say of pieces that reach below the ground by more than a cell.
std::vector<std::string> ground_notes(const Scene& scene, Span<const Fragment> pieces);

}  // namespace tissue_sim
