// Nodes: displacement and velocity live here and nowhere else.
#pragma once

#include <cstddef>

#include "compute/array.h"
#include "compute/host_device.h"

namespace tissue_sim {

/// What a substep changes.
struct NodeMotion {
  Array<float> u[3];  ///< displacement from the reference place [m]
  Array<float> v[3];  ///< velocity [m/s]
  TISSUE_SIM_FIELDS(u, v)
};

/// What a cut changes.
struct NodeMasses {
  Array<float> mass;      ///< [kg], 0 where no point reaches
  Array<float> inv_mass;  ///< [1/kg], 0 where no point reaches and where the node is anchored
  TISSUE_SIM_FIELDS(mass, inv_mass)
};

/// The grid nodes of all bodies, each body's lattice with one ring of nodes around its cells (x
/// fastest), and behind them the further fields of nodes that cuts have split.
struct Nodes : NodeMotion, NodeMasses {
  std::size_t size() const { return mass.size(); }
  void reserve(std::size_t n) {
    for (int c = 0; c < 3; ++c) {
      u[c].reserve(n);
      v[c].reserve(n);
    }
    mass.reserve(n);
    inv_mass.reserve(n);
  }
  void resize(std::size_t n) {
    for (int c = 0; c < 3; ++c) {
      u[c].resize(n);
      v[c].resize(n);
    }
    mass.resize(n);
    inv_mass.resize(n);
  }
};

}  // namespace tissue_sim
