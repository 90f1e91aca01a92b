// A body and blade paths for tests.
#pragma once

#include <vector>

#include "tissue_sim/simulation.h"

namespace tissue_sim {

/// A box alone in space: no ground, no gravity. Its lowest corner is the origin.
inline Scene free_box(const Vec3& size, double cell_size) {
  Scene scene;
  scene.cell_size = cell_size;
  scene.gravity = Vec3::Zero();
  scene.ground.enabled = false;
  Body body;
  body.size = size;
  body.pose.position = 0.5 * size;
  scene.bodies.push_back(body);
  return scene;
}

/// The same without viscosity, which shortens substeps and, on the GPU, asks for a second column of
/// threads: for what is about the shapes of thread blocks, or whose substeps are given.
inline Scene inviscid(Scene scene) {
  scene.materials = {find_material(scene, scene.bodies[0].material)};
  scene.materials[0].viscosity = 0;
  return scene;
}

/// A blade whose edge stands along z from -0.1 to 0.1 m, moved through `places` (their z counts
/// too).
inline BladePath upright_blade(const std::vector<Vec3>& places) {
  BladePath path;
  path.edge = {Vec3(0, 0, -0.1), Vec3(0, 0, 0.1)};
  for (const Vec3& place : places) path.poses.push_back({place, Quat::Identity()});
  return path;
}

/// A large plane sweep through `place` with this normal: cuts whatever it meets.
inline BladePath plane_cut(const Vec3& place, const Vec3& normal) {
  const Quat turn = Quat::FromTwoVectors(Vec3::UnitY(), normal.normalized());
  BladePath path = upright_blade({});
  for (const double x : {-0.2, 0.2}) {
    path.poses.push_back({place + turn * Vec3(x, 0, 0), turn});
  }
  return path;
}

}  // namespace tissue_sim
