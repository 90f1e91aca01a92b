// A cantilever that sags under its own weight, and how far.
#pragma once

#include <string>
#include <vector>

#include "support/beam_scene.h"
#include "support/curve_file.h"
#include "tissue/each_method.h"

namespace tissue_sim {

struct Bend {
  double tip;     ///< [m]
  double theory;  ///< [m]
  double error() const { return tip / theory - 1; }
};

/// Mean of how far the points sank that lie between x = begin and end.
inline double sunk(const std::vector<Point>& rest, const std::vector<Point>& now, double begin,
                   double end) {
  double sum = 0;
  int count = 0;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    if (rest[i].x < begin || rest[i].x > end) continue;
    sum += static_cast<double>(rest[i].z) - now[i].z;
    ++count;
  }
  return sum / count;
}

/// Lets the beam sink under a weight that bends it by 0.5 % of its length, with the drag that lets
/// the first mode settle soonest, until it stands still. `scene` is beam_scene()'s, clamped, for a
/// method on a device.
inline Bend bend(Scene scene, const Beam& beam, const std::string& curve = "") {
  const double gravity = 0.005 * beam.length / tip_deflection(beam, 1);
  const double frequency = bending_frequency(beam, Ends::kClampedFree);
  scene.gravity = Vec3(0, 0, -gravity);
  scene.damping = 2 * frequency;
  scene.frame_rate = 4 * frequency;
  scene.cfl = 0.8;
  Simulation simulation(scene);
  const std::vector<Point> rest = points_of(simulation.tissue());
  for (int i = 0; i < 56; ++i) simulation.advance_frame();  // (1 + 14) exp(-14) = 1e-5
  const std::vector<Point> now = points_of(simulation.tissue());

  const double h = scene.cell_size, end = beam.length;
  CurveFile file(curve, "x [m],sunk [m]");
  for (double x = -beam.height; x < end - h / 4; x += h / 2) {
    file.add({x + h / 4, sunk(rest, now, x, x + h / 2)});
  }
  const double theory = tip_deflection(beam, gravity);
  if (scene.method == Method::kPbd) {  // vertices lie at the end itself
    return {sunk(rest, now, end - h / 4, end + h / 4), theory};
  }
  // The last two layers of points lie 1/4 and 3/4 of a cell before the free end.
  const double last = sunk(rest, now, end - h / 2, end),
               other = sunk(rest, now, end - h, end - h / 2);
  return {last + (last - other) / 2, theory};
}

}  // namespace tissue_sim
