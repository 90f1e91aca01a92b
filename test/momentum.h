// Linear and angular momentum of all tissue, for tests.
#pragma once

#include <vector>

#include "mpm/mpm_state.h"

namespace tissue_sim {

struct Momentum {
  Vec3 linear = Vec3::Zero();   ///< [kg m/s]
  Vec3 angular = Vec3::Zero();  ///< about the centre of mass [kg m^2/s]
};

/// Sums over the nodes, in double. Fields of split nodes stand behind the lattice's nodes; `home`
/// maps each node to its reference place.
inline Momentum momentum(const MpmState& state, const std::vector<Vec3>& home) {
  const Nodes& n = state.nodes;
  double mass = 0;
  Vec3 center = Vec3::Zero(), linear = Vec3::Zero();
  std::vector<Vec3> place(n.size()), velocity(n.size());
  for (std::size_t i = 0; i < n.size(); ++i) {
    place[i] = home[i] + Vec3(n.u[0][i], n.u[1][i], n.u[2][i]);
    velocity[i] = Vec3(n.v[0][i], n.v[1][i], n.v[2][i]);
    mass += n.mass[i];
    center += n.mass[i] * place[i];
    linear += n.mass[i] * velocity[i];
  }
  center /= mass;
  Momentum m;
  m.linear = linear;
  for (std::size_t i = 0; i < n.size(); ++i) {
    m.angular += (place[i] - center).cross(n.mass[i] * (velocity[i] - linear / mass));
  }
  return m;
}

/// Reference place of each node, those of split fields included.
inline std::vector<Vec3> homes(const MpmState& state) {
  std::vector<Vec3> home(state.nodes.size(), Vec3::Zero());
  for (const LatticeBody& b : state.bodies) {
    b.for_each_node([&](int node, int x, int y, int z) {
      home[node] = b.node_position(x, y, z);
      const NodeFields::Split* split = state.fields->split(node);
      if (split == nullptr) return;
      for (const auto& field : split->fields) home[field.node] = home[node];
    });
  }
  return home;
}

}  // namespace tissue_sim
