// A smooth surface about particles of fluid, for pictures.
#pragma once

#include "tissue_sim/fluid.h"
#include "tissue_sim/renderer.h"

namespace tissue_sim {

/// Replaces the fluid of the view by that of particles `spacing` apart [m].
void make_fluid_surface(Span<const FluidPoint> points, double spacing, SceneView& view);

}  // namespace tissue_sim
