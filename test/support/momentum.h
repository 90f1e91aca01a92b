// Reference places of nodes, for tests.
#pragma once

#include <vector>

#include "mpm/state_figures.h"

namespace tissue_sim {

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
