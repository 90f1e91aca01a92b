// Sums over a particle's neighbours, eight at a time: the same bits with any instructions.
#pragma once

#include "fluid/fluid_state.h"

namespace tissue_sim {

/// Of the neighbours' volumes by the kernel, without the particle's own [1].
float neighbour_volume(const FluidState& state, int i);

/// Adds what pressure and viscosity of its neighbours do to a particle [N].
void add_pair_forces(const FluidState& state, int i, float* force);

}  // namespace tissue_sim
