// What stretch tissue bears, from its toughness: docs/cutting.md, "Tears".
#pragma once

#include "tissue_sim/material.h"

namespace tissue_sim {

/// The least and the largest of Material::tear_stretch.
inline constexpr double kLeastTearStretch = 1.001, kLargestTearStretch = 100;

/// Energy of the material per volume where it is pulled along one line, free to narrow [J/m^3].
double energy_of_pull(const Material& material, double stretch);

/// The stretch at which a crack goes on whose front takes toughness J for each area, where the
/// tissue that it relieves is as high as `height` [m] while it tears at small strain:
///   energy_of_pull(stretch) (1/2 + 3/4 / stretch) height = J,
/// for a tip that is drawn out far is blunt, and relieves less. One of 1 or kLargestTearStretch
/// where that lies beyond.
double tear_stretch_of(const Material& material, double height);

}  // namespace tissue_sim
