// Where a scene's fluid is at time zero.
#pragma once

#include "fluid/fluid_state.h"
#include "geometry/mesh.h"
#include "tissue_sim/scene.h"

namespace tissue_sim {

/// The fluids that a scene names: its own, then the presets that it uses.
std::vector<Fluid> fluid_kinds(const Scene& scene);

/// Which of them has the name; their number where none has.
int fluid_kind(const std::vector<Fluid>& kinds, const std::string& name);

/// What they are to a substep; a bulk modulus of 0 becomes one by the scene's pressures and
/// heights.
std::vector<FluidLaw> fluid_laws(const Scene& scene);

/// Fills hollows and pools of a scene whose tissue has these `corners` (FluidWalls); what is in a
/// hollow has settled under its pressure while the wall stood still. Throws std::invalid_argument
/// for a hollow or pool that holds no particle, TooLarge for more than `max_points`.
void fill_scene(const Scene& scene, const std::vector<float>& corners, FluidState& state);

}  // namespace tissue_sim
