// The limit of stability of tissue by power iteration, and bodies to find it for.
#pragma once

#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "mpm/contact/block_contact.h"
#include "mpm/mpm_tissue.h"

namespace tissue_sim {

/// Accelerations of the nodes for the displacements `at + scale * x`: a substep of one second from
/// rest leaves them as velocities.
inline std::vector<double> accelerations(MpmState& state, const std::vector<float>& at,
                                         double scale, const std::vector<double>& x) {
  Nodes& n = state.nodes;
  const std::size_t count = n.size();
  for (std::size_t i = 0; i < 3 * count; ++i) {
    n.u[i / count][i % count] = static_cast<float>(at[i] + scale * x[i]);
    n.v[i / count][i % count] = 0;
  }
  std::vector<ColliderLoad> loads;
  const float dt = std::exchange(state.dt, 0.0f);
  Front& front = state.front;  // parted nodes stay where they are
  Array<float> d[3], rate[3];
  for (int c = 0; c < 3; ++c) {
    d[c] = front.d[c];
    rate[c] = front.rate[c];
  }
  substep(state, 1.0f, loads);
  for (int c = 0; c < 3; ++c) {
    std::swap(front.d[c], d[c]);
    std::swap(front.rate[c], rate[c]);
  }
  state.dt = dt;
  std::vector<double> a(3 * count);
  for (std::size_t i = 0; i < 3 * count; ++i) a[i] = n.v[i / count][i % count];
  return a;
}

/// Largest substep that the undamped tissue bears in its present state, without contact [s]: 2 over
/// the highest frequency.
inline double stability_limit(MpmTissue& tissue) {
  MpmState& state = tissue.state();
  Nodes& n = state.nodes;
  state.colliders.clear();
  find_near_colliders(state, {}, 0);
  const std::size_t count = n.size();
  std::vector<float> at(3 * count);
  std::vector<double> x(3 * count, 0.0);
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (std::size_t i = 0; i < 3 * count; ++i) {
    at[i] = n.u[i / count][i % count];
    if (n.inv_mass[i % count] > 0) x[i] = normal(random);
  }
  const std::vector<double> at_rest = accelerations(state, at, 0, x);
  double square = 0;
  for (int k = 0; k < 100; ++k) {
    double largest = 0;
    for (const double v : x) largest = std::max(largest, std::fabs(v));
    const double scale = 1e-3 * state.scene.cell_size / largest;
    const std::vector<double> a = accelerations(state, at, scale, x);
    double work = 0, mass = 0;
    for (std::size_t i = 0; i < 3 * count; ++i) {
      const double stiff = -(a[i] - at_rest[i]) / scale;
      work += n.mass[i % count] * x[i] * stiff;
      mass += n.mass[i % count] * x[i] * x[i];
      x[i] = stiff / largest;
    }
    square = work / mass;  // Rayleigh's quotient
  }
  for (std::size_t i = 0; i < 3 * count; ++i) {
    n.u[i / count][i % count] = at[i];
    n.v[i / count][i % count] = 0;
  }
  tissue.finish();
  return 2 / std::sqrt(square);
}

inline Scene soft_body(double nu, const Vec3& cells, Law law = Law::kFixedCorotated) {
  Scene s;
  s.cell_size = 0.002;
  s.gravity = Vec3::Zero();
  s.ground.enabled = false;
  s.materials.resize(1);
  s.materials[0].poisson_ratio = nu;
  s.materials[0].law = law;
  s.bodies.resize(1);
  s.bodies[0].size = cells * s.cell_size;
  return s;
}

inline std::vector<BladePath> random_planes(int count, double size) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<BladePath> paths(count);
  for (BladePath& path : paths) {
    const Vec3 n = Vec3(uniform(random), uniform(random), uniform(random)).normalized();
    const Vec3 a = n.unitOrthogonal(), b = n.cross(a), c = n * uniform(random) * 0.4 * size;
    path.edge = {-2 * size * a, 2 * size * a};
    path.poses.resize(2);
    path.poses[0].position = c - 2 * size * b;
    path.poses[1].position = c + 2 * size * b;
  }
  return paths;
}

}  // namespace tissue_sim
