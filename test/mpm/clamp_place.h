// Where a clamp of the lattice acts.
#pragma once

#include <algorithm>

#include "mpm/mpm_tissue.h"

namespace tissue_sim {

/// Where the clamp of a beam along x acts [m]: where the scene has its face, if the boundary is the
/// body's surface; with the lattice's a quarter of a cell behind the last plane of held nodes.
///
/// Take a bar whose nodes are held up to x_0, under tension that far away stretches it by e. With
/// a_j the strain between nodes j - 1 and j, in units of e, a cell's two points see (3 a_j + a_j+1)
/// / 4 and (a_j + 3 a_j+1) / 4, so equilibrium reads 3 a_j-1 + 10 a_j + 3 a_j+1 = 16, with a_0 = 0.
/// Its solution is a_j = 1 - (-1/3)^j, whose surplus over 1 sums up to 1/4: from afar the bar looks
/// a quarter of a cell longer than from x_0. The same holds for shear and for bending.
inline double clamp_place(MpmState& state) {
  const LatticeBody& b = state.bodies[0];
  if (!state.anchors.rows.empty()) return state.anchors.rows[0].place[0];
  double last = -1e9;
  for (int x = -1; x <= b.nx; ++x) {
    const int node = b.node(x, b.ny / 2, b.nz / 2);
    if (state.nodes.mass[node] > 0 && state.nodes.inv_mass[node] == 0) {
      last = std::max(last, b.node_position(x, 0, 0).x());
    }
  }
  return last - b.cell_size / 4;
}

}  // namespace tissue_sim
