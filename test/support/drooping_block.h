// A viscous block that is held at one end and droops, by how many substeps it takes.
#pragma once

#include "tissue_sim/simulation.h"

namespace tissue_sim {

/// Substeps of a quarter of a second, held up to x = `face` [m].
inline int substeps_of_drooping_block(Device device, double cell_size, double face = 0.0053) {
  Scene scene;
  scene.device = device;
  scene.cell_size = cell_size;
  scene.damping = 2;
  scene.ground.enabled = false;
  scene.materials.resize(1);
  Material& m = scene.materials[0];
  m.name = "soft";
  m.young_modulus = 5000;
  m.poisson_ratio = 0.45;
  m.viscosity = 5;
  scene.bodies.resize(1);
  Body& body = scene.bodies[0];
  body.material = m.name;
  body.size = Vec3(0.06, 0.04, 0.03);
  body.pose.position = 0.5 * body.size;
  Region held;
  held.kind = Region::Kind::kBox;
  held.min = Vec3(-1, -1, -1);
  held.max = Vec3(face, 1, 1);
  body.anchors.emplace_back(held);
  Simulation simulation(scene);
  int substeps = 0;
  for (int frame = 0; frame < 15; ++frame) {
    substeps += simulation.advance_frame().result.substeps;
  }
  return substeps;
}

}  // namespace tissue_sim
