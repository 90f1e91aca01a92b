// LatticeTissue: the tissue of a scene on its lattices, whatever works on it.
#pragma once

#include <memory>
#include <vector>

#include "compute/for_each.h"
#include "mpm/lattice/lattice_body.h"
#include "mpm/lattice/nodes.h"
#include "mpm/split/front.h"
#include "mpm/split/node_fields.h"
#include "tissue_sim/scene.h"

namespace tissue_sim {

struct LatticeTissue {
  Scene scene;
  std::vector<LatticeBody> bodies;     ///< never change
  Points points;                       ///< their bonds go as tissue is cut and tears
  Array<std::uint8_t> whole_bonds;     ///< per point: its bonds before any broke
  Nodes nodes;                         ///< move; there are more behind cuts
  std::unique_ptr<NodeFields> fields;  ///< which of the nodes a point sees
  Front front;
  std::unique_ptr<Cpu> cpu;
};

}  // namespace tissue_sim
