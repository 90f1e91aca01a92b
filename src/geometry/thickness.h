// How many points a body has across.
#pragma once

#include <string>

#include "geometry/lattice.h"

namespace tissue_sim {

/// How long the body is within a run of points without a gap, on the mean over the runs along an
/// axis: along that one of x, y, z along which this is shortest. Less than two thirds of a ball's
/// diameter it is not, nor more than 1.7 times the thickness of a sheet, whatever its slant.
struct Thickness {
  char axis = 'x';
  double points = 0;  ///< [-], that fit in it
  double length = 0;  ///< [m]
};
/// Of a lattice that has points.
Thickness thickness_of(const Lattice& lattice);

/// A warning of a body with fewer than two points across: bending, for instance, needs two. Else
/// "".
std::string thickness_note(const Lattice& lattice);

}  // namespace tissue_sim
