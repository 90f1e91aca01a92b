// A beam of tissue along x, for the tests of bending.
#pragma once

#include <algorithm>

#include "beam_theory.h"
#include "mpm/mpm_tissue.h"
#include "tissue_sim/scene.h"

namespace tissue_sim {

/// 16 mm high (z), half as wide (y), 20 kPa, as heavy as water.
inline Beam soft_beam(double slenderness, double poisson_ratio) {
  const double height = 0.016;
  return {slenderness * height, height, height / 2, 2e4, poisson_ratio, 1000};
}

/// The beam from x = 0 on, `cells` thick, no gravity, no ground. With `clamped`, another height of
/// it lies at x < 0, anchored.
inline Scene beam_scene(const Beam& beam, int cells, bool clamped, Law law = Law::kFixedCorotated) {
  Scene s;
  s.device = Device::kCpu;  // the tests look into its state
  s.cell_size = beam.height / cells;
  s.gravity = Vec3::Zero();
  s.ground.enabled = false;
  s.materials.resize(1);
  s.materials[0].name = "beam";
  s.materials[0].law = law;
  s.materials[0].young_modulus = beam.young_modulus;
  s.materials[0].poisson_ratio = beam.poisson_ratio;
  s.materials[0].density = beam.density;
  s.bodies.resize(1);
  Body& body = s.bodies[0];
  body.material = "beam";
  const double held = clamped ? beam.height : 0;
  body.size = Vec3(beam.length + held, beam.width, beam.height);
  body.pose.position.x() = (beam.length - held) / 2;
  if (clamped) {
    Region region;
    region.kind = Region::Kind::kBox;
    region.min = Vec3::Constant(-1);
    region.max = Vec3(1e-3 * s.cell_size, 1, 1);
    body.anchors = {region};
  }
  return s;
}

/// Where the clamp acts [m]: a quarter of a cell behind the last plane of held nodes.
///
/// Take a bar whose nodes are held up to x_0, under tension that far away stretches it by e. With
/// a_j the strain between nodes j - 1 and j, in units of e, a cell's two points see (3 a_j + a_j+1)
/// / 4 and (a_j + 3 a_j+1) / 4, so equilibrium reads 3 a_j-1 + 10 a_j + 3 a_j+1 = 16, with a_0 = 0.
/// Its solution is a_j = 1 - (-1/3)^j, whose surplus over 1 sums up to 1/4: from afar the bar looks
/// a quarter of a cell longer than from x_0. The same holds for shear and for bending.
inline double clamp_place(MpmState& state) {
  const LatticeBody& b = state.bodies[0];
  double last = -1e9;
  for (int x = -1; x <= b.nx; ++x) {
    const int node = b.node(x, b.ny / 2, b.nz / 2);
    if (state.nodes.mass[node] > 0 && state.nodes.inv_mass[node] == 0) {
      last = std::max(last, b.node_position(x, 0, 0).x());
    }
  }
  return last - b.cell_size / 4;
}

}  // namespace tissue_sim
