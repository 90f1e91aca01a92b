// Small bodies and cuts for tests.
#pragma once

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "mpm/mpm_tissue.h"
#include "support/cut_paths.h"
#include "support/fixed_substeps.h"
#include "support/momentum.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {

/// Puts four further materials into the box of 31 x 29 x 17 mm that the tests of a substep use: two
/// balls, one of them within the other, a box and a layer.
inline void add_inclusions(Scene& scene, bool both_laws) {
  const double stiffer[] = {3, 0.4, 1.7, 6}, denser[] = {1.2, 0.7, 1.5, 0.9};
  Body& body = scene.bodies[0];
  for (int i = 0; i < 4; ++i) {
    Material m = scene.materials[0];
    m.name += std::to_string(i);
    m.young_modulus *= stiffer[i];
    m.poisson_ratio = 0.1 + 0.1 * i;
    m.density *= denser[i];
    m.viscosity *= i;
    if (both_laws && i % 2 == 0) {
      m.law = m.law == Law::kNeoHookean ? Law::kFixedCorotated : Law::kNeoHookean;
    }
    scene.materials.push_back(m);
    Inclusion inclusion;
    inclusion.material = m.name;
    inclusion.region.kind = i < 2 ? Region::Kind::kBall : Region::Kind::kBox;
    inclusion.region.center = Vec3(0.017 + 0.001 * i, 0.015, 0.009);
    inclusion.region.radius = i == 0 ? 0.009 : 0.004;
    inclusion.region.min = i == 2 ? Vec3(0.02, 0.002, 0.001) : Vec3(-1, 0.0221, -1);
    inclusion.region.max = i == 2 ? Vec3(0.026, 0.012, 0.011) : Vec3::Ones();
    body.inclusions.push_back(inclusion);
  }
}

/// A body in free space but for gravity: for one substep against the reference.
inline Scene free_body(Law law, double viscosity, Shape shape) {
  Scene scene = free_box(Vec3(0.031, 0.029, 0.017), 0.002);
  scene.gravity = Vec3(0.3, -0.2, -9.81);
  scene.bodies[0].shape = shape;
  scene.bodies[0].radii = Vec3(0.016, 0.014, 0.009);
  Material m;
  m.name = "test";
  m.law = law;
  m.viscosity = viscosity;
  scene.materials.push_back(m);
  scene.bodies[0].material = "test";
  return scene;
}

/// Moves the nodes by a smooth field with stretches of some 20 %.
inline void deform(MpmState& state) {
  for (const LatticeBody& b : state.bodies) {
    b.for_each_node([&](int node, int i, int j, int k) {
      const double x = (i + 1) * b.cell_size, y = (j + 1) * b.cell_size, z = (k + 1) * b.cell_size;
      const double u[3] = {0.2 * y + 0.002 * std::sin(60 * x), 0.15 * x - 0.2 * y,
                           0.2 * z + 0.1 * x};
      for (int a = 0; a < 3; ++a) state.nodes.u[a][node] = static_cast<float>(u[a]);
    });
  }
  measure_motion(state);
}

/// Shakes each node, fields of a split one apart, by `size` [m] and gives it a velocity: nodes at
/// one place the same, whatever their numbers.
inline void shake(MpmState& state, unsigned seed, double size) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  const auto shake_node = [&](int i) {
    for (int a = 0; a < 3; ++a) {
      const float by = static_cast<float>(size) * normal(random);
      if (i < 0) continue;
      state.nodes.u[a][i] += by;
      state.nodes.v[a][i] = state.nodes.inv_mass[i] == 0 ? 0 : 0.1f * normal(random);
    }
  };
  for (const LatticeBody& b : state.bodies) {
    for (int z = -1; z <= b.nz; ++z) {
      for (int y = -1; y <= b.ny; ++y) {
        for (int x = -1; x <= b.nx; ++x) shake_node(b.node(x, y, z));
      }
    }
  }
  const int count = static_cast<int>(state.nodes.size());
  for (int i = lattice_node_count(state.bodies); i < count; ++i) shake_node(i);
}

/// Grips what lies where held(place, margin) says, for tests that move it as no anchor does: nodes
/// within nine tenths of a cell of that stay where they are put, and points in it do not tear. To
/// be done anew where bonds broke, which makes nodes anew.
template <class Held>
void grip(MpmState& s, const Held& held) {
  for (int p = 0; p < s.points.size(); ++p) {
    const Points::Site& site = s.points.site[p];
    const LatticeBody& b = s.bodies[site.body];
    if (!held(b.site_position(site.x, site.y, site.z), 0)) continue;
    s.points.anchored[p] = Points::kInAnchor;
  }
  const std::vector<Vec3> home = homes(s);
  for (std::size_t i = 0; i < home.size(); ++i) {
    if (!held(home[i], 0.9 * s.bodies[0].cell_size)) continue;
    s.nodes.inv_mass[i] = 0;
    for (int a = 0; a < 3; ++a) s.nodes.v[a][i] = 0;
  }
}

/// How many points each piece has, largest first.
inline std::vector<int> piece_sizes(Tissue& tissue) {
  std::vector<int> sizes;
  for (const Fragment& f : tissue.fragments()) sizes.push_back(f.point_count);
  std::sort(sizes.rbegin(), sizes.rend());
  return sizes;
}

/// Cuts at once, without moving anything: zero substeps.
template <class T>
CutReport cut_now(T& tissue, const BladePath& path) {
  advance_by(tissue, 0, 1e-4f, {{}, {&path, 1}});
  return tissue.finish().cut_reports[0];
}

}  // namespace tissue_sim
