#include "mpm/state_figures.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "mpm/tear/bond_bridges.h"
#include "mpm/tear/deformation.h"

namespace tissue_sim {

namespace {

/// Half the fastest rate at which viscosity slows a node [1/s]: of the masks of points in a cell
/// the worst gives 9.4 eta / (rho h^2). Viscous stress F S has F twice, outside and in dE/dt: it
/// grows with the square of the largest stretch, which is at most that of the stiffening where J
/// = 1.
double damping(const Material& m, double cell_size, float stiffening) {
  return 5 * m.viscosity * stiffening * stiffening / (m.density * cell_size * cell_size);
}

double stable_substep(const Material& m, double cell_size, double cfl, float stiffening) {
  const double modulus = wave_modulus(m, stiffening);
  const double elastic = cfl * cell_size * std::sqrt(m.density / modulus);
  return viscous_substep(elastic, damping(m, cell_size, stiffening));
}

}  // namespace

double wave_modulus(const Material& m, float stiffening) {
  const double mu = lame_mu(m), lambda = lame_lambda(m);
  // Waves in the deformed body, in reference space: the volumetric stiffness grows with the
  // square of the cofactor's columns.
  const double volumetric = m.law == Law::kNeoHookean ? lambda + mu : lambda;
  return lambda + 2 * mu + volumetric * std::max(0.0f, stiffening - 1);
}

double viscous_substep(double elastic, double damping) {
  const double b = 0.5 * damping * elastic * elastic;
  return std::sqrt(b * b + elastic * elastic) - b;
}

double fastest_damping(const MpmState& state, const Stiffening& stiffening) {
  double fastest = 0;
  for (std::size_t i = 0; i < state.bodies.size(); ++i) {
    const LatticeBody& b = state.bodies[i];
    for (std::size_t m = 0; m < b.materials.size(); ++m) {
      fastest = std::max(fastest, damping(b.materials[m], b.cell_size, stiffening[i][m]));
    }
  }
  return fastest;
}

Stiffening even_stiffening(const MpmState& state, float stiffening) {
  Stiffening all;
  for (const LatticeBody& b : state.bodies) all.emplace_back(b.materials.size(), stiffening);
  return all;
}

// Stiffness, damping and mass of any motion are sums over points, and the condition is linear in
// each of them: what every point bears on its own, a mixture bears.
float stable_substep(const MpmState& state, const Stiffening& stiffening) {
  double dt = 1e9;
  for (std::size_t i = 0; i < state.bodies.size(); ++i) {
    const LatticeBody& b = state.bodies[i];
    for (std::size_t m = 0; m < b.materials.size(); ++m) {
      dt = std::min(dt,
                    stable_substep(b.materials[m], b.cell_size, state.scene.cfl, stiffening[i][m]));
    }
  }
  return static_cast<float>(dt);
}

bool may_be_wild(const MpmState& state) {
  return (!state.threads.empty() && state.wildest >= kThreadStiffening) ||
         (!state.crumbs.empty() && state.wildest >= kWildStiffening);
}

std::uint64_t checksum(const MpmState& state, const Pieces& pieces) {
  std::uint64_t hash = 0xcbf29ce484222325u;  // FNV-1a, over words and the bytes that are left
  const auto add = [&hash](const auto& array) {
    const auto* bytes = reinterpret_cast<const unsigned char*>(array.data());
    const std::size_t size = array.size() * sizeof(array[0]);
    for (std::size_t i = 0; i + 4 <= size; i += 4) {
      std::uint32_t word;
      std::memcpy(&word, bytes + i, 4);
      hash = (hash ^ word) * 0x100000001b3u;
    }
    for (std::size_t i = size / 4 * 4; i < size; ++i) hash = (hash ^ bytes[i]) * 0x100000001b3u;
  };
  for (int a = 0; a < 3; ++a) {
    add(state.nodes.u[a]);
    add(state.nodes.v[a]);
  }
  add(state.points.bonds);
  add(pieces.of_point);
  return hash;
}

}  // namespace tissue_sim
