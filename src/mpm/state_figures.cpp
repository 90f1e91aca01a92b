#include "mpm/state_figures.h"

#include <algorithm>
#include <cmath>

#include "frame/checksum.h"
#include "frame/stability_limit.h"
#include "mpm/tear/debris.h"
#include "mpm/tear/tear.h"

namespace tissue_sim {

namespace {

/// Half the fastest rate at which viscosity slows a node [1/s]: of the masks of points in a cell
/// the worst gives 9.4 eta / (rho h^2). Viscous stress F S has F twice, outside and in dE/dt: it
/// grows with the square of the largest stretch, which is at most ||F||^2, and at most that of the
/// stiffening where J = 1. Squeezed tissue stiffens much more than it is stretched.
double damping(const Material& m, double cell_size, float stiffening, float stretch2) {
  const float grown = std::min(stiffening * stiffening, stretch2);
  return 5 * m.viscosity * grown / (m.density * cell_size * cell_size);
}

double stable_substep(const Material& m, double cell_size, double cfl, float stiffening,
                      float stretch2) {
  const double modulus = wave_modulus(m, stiffening);
  const double elastic = cfl * cell_size * std::sqrt(m.density / modulus);
  return viscous_substep(elastic, damping(m, cell_size, stiffening, stretch2));
}

}  // namespace

double fastest_damping(const MpmState& state, const Stiffening& stiffening) {
  double fastest = 0;
  for (std::size_t i = 0; i < state.bodies.size(); ++i) {
    const LatticeBody& b = state.bodies[i];
    for (std::size_t m = 0; m < b.materials.size(); ++m) {
      fastest = std::max(
          fastest, damping(b.materials[m], b.cell_size, stiffening[i][m], stiffening[i].back()));
    }
  }
  return fastest;
}

Stiffening even_stiffening(const MpmState& state, float stiffening) {
  Stiffening all;
  for (const LatticeBody& b : state.bodies) all.emplace_back(b.materials.size() + 1, stiffening);
  return all;
}

// Stiffness, damping and mass of any motion are sums over points, and the condition is linear in
// each of them: what every point bears on its own, a mixture bears.
float stable_substep(const MpmState& state, const Stiffening& stiffening) {
  double dt = 1e9;
  for (std::size_t i = 0; i < state.bodies.size(); ++i) {
    const LatticeBody& b = state.bodies[i];
    for (std::size_t m = 0; m < b.materials.size(); ++m) {
      dt = std::min(dt, stable_substep(b.materials[m], b.cell_size, state.scene.cfl,
                                       stiffening[i][m], stiffening[i].back()));
    }
  }
  return static_cast<float>(dt);
}

bool may_be_ill_conditioned(const MpmState& state) {
  return (!state.bridge_ends.empty() && state.worst_stiffening >= kBridgeStiffening) ||
         (!state.debris.empty() && state.worst_stiffening >= kIllConditioned);
}

std::uint64_t checksum(const MpmState& state, const Pieces& pieces) {
  Checksum sum;
  for (int a = 0; a < 3; ++a) {
    sum.add(state.nodes.u[a]);
    sum.add(state.nodes.v[a]);
  }
  for (int a = 0; a < 3; ++a) {
    if (state.front.nodes.empty()) break;
    sum.add(state.front.d[a]);
    sum.add(state.front.rate[a]);
  }
  sum.add(state.points.bonds);
  sum.add(pieces.of_point);
  return sum.value();
}

Momentum momentum(const MpmState& state) {
  const Nodes& n = state.nodes;
  Momentum sum;
  Vec3 about_origin = Vec3::Zero();
  const auto add = [&](std::int32_t i, const Vec3& home) {
    const double mass = n.mass[i];
    const Vec3 x = home + Vec3(n.u[0][i], n.u[1][i], n.u[2][i]);
    const Vec3 p = mass * Vec3(n.v[0][i], n.v[1][i], n.v[2][i]);
    sum.mass += mass;
    sum.centre += mass * x;
    sum.linear += p;
    about_origin += x.cross(p);
  };
  for (const LatticeBody& b : state.bodies) {
    b.for_each_node([&](int node, int x, int y, int z) {
      const Vec3 home = b.node_position(x, y, z);
      add(node, home);
      const NodeFields::Split* split = state.fields->split(node);
      if (split == nullptr) return;
      for (const auto& field : split->fields) {
        if (field.node != node) add(field.node, home);
      }
    });
  }
  const Front& front = state.front;
  for (std::size_t i = 0; i < front.nodes.size(); ++i) {
    const Vec3 d(front.d[0][i], front.d[1][i], front.d[2][i]);
    const Vec3 rate(front.rate[0][i], front.rate[1][i], front.rate[2][i]);
    about_origin += front.nodes[i].mass * d.cross(rate);
  }
  sum.centre /= sum.mass;
  sum.angular = about_origin - sum.centre.cross(sum.linear);
  return sum;
}

}  // namespace tissue_sim
