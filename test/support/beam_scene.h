// A beam of tissue along x, for the tests of bending.
#pragma once

#include "support/beam_theory.h"
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
  s.device = Device::kCpu;
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

}  // namespace tissue_sim
