// Small bodies and cuts for tests.
#pragma once

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "mpm/mpm_tissue.h"
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

/// Moves the nodes by a smooth field with stretches of some 20 %.
inline void deform(MpmState& state) {
  for (const LatticeBody& b : state.bodies) {
    for (int i = 0; i < b.node_count(); ++i) {
      const double x = i % b.pitch_y * b.cell_size, y = i % b.pitch_z / b.pitch_y * b.cell_size;
      const double z = i / b.pitch_z * b.cell_size;
      const double u[3] = {0.2 * y + 0.002 * std::sin(60 * x), 0.15 * x - 0.2 * y,
                           0.2 * z + 0.1 * x};
      for (int a = 0; a < 3; ++a) state.nodes.u[a][b.first_node + i] = static_cast<float>(u[a]);
    }
  }
  measure_motion(state);
}

/// Shakes each node, fields of a split one apart, by `size` [m] and gives it a velocity.
inline void shake(MpmState& state, unsigned seed, double size) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  for (std::size_t i = 0; i < state.nodes.size(); ++i) {
    for (int a = 0; a < 3; ++a) {
      state.nodes.u[a][i] += static_cast<float>(size) * normal(random);
      state.nodes.v[a][i] = state.nodes.inv_mass[i] == 0 ? 0 : 0.1f * normal(random);
    }
  }
}

/// How many points each piece has, largest first.
inline std::vector<int> piece_sizes(const Tissue& tissue) {
  std::vector<int> sizes;
  for (const Fragment& f : tissue.fragments()) sizes.push_back(f.point_count);
  std::sort(sizes.rbegin(), sizes.rend());
  return sizes;
}

/// Cuts at once, without moving anything: zero substeps.
inline CutReport cut_now(Tissue& tissue, const BladePath& path) {
  tissue.advance(0, 1e-4f, {{}, {&path, 1}});
  return tissue.finish().cut_reports[0];
}

}  // namespace tissue_sim
