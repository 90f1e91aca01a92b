// Node fields: a node near a cut stands for several pieces of tissue, each of which sees a field
// (displacement and velocity) of its own.
//
// A node's points are those within its weight's support. They are taken apart into the components
// that the bonds among them leave, and each component gets a field. Bonds only ever break, so a
// field only ever comes apart and a new one starts with its parent's motion: no force and no
// momentum appears when tissue is cut, no energy but the little that stabilisation takes up, and a
// slow sweep ends where a fast one does.
#pragma once

#include <cstdint>
#include <vector>

#include "compute/for_each.h"
#include "mpm/lattice_body.h"
#include "mpm/nodes.h"

namespace tissue_sim {

/// Mass of a component at a node, and how much of it is anchored [kg].
struct NodeShare {
  double mass = 0, anchored_mass = 0;
};

class NodeFields {
 public:
  /// Fills the nodes of all bodies: masses, anchors, at rest.
  NodeFields(const std::vector<LatticeBody>& bodies, const Points& points, Nodes& nodes);

  /// The node that stands for lattice node (x, y, z) as `point` sees it.
  int node(const LatticeBody& body, const Points::Site& point, int x, int y, int z) const;
  /// The same for the node `k` (0..26, x fastest) of the point's stencil.
  int node(const LatticeBody& body, const Points::Site& point, int k) const;

  struct Split {
    std::uint8_t component[216];      ///< of each point of the support; 255 where there is none
    std::vector<std::int32_t> field;  ///< node of each component

    /// The node that `point` sees, of the node of cell (x, y, z).
    int seen_by(const Points::Site& point, int x, int y, int z) const;
  };
  /// How a lattice node is split, null where it is not.
  const Split* split(int lattice_node) const {
    if (split_of_.empty() || split_of_[lattice_node] < 0) return nullptr;
    return &splits_[split_of_[lattice_node]];
  }
  std::size_t split_count() const { return splits_.size(); }

  /// Takes the nodes apart that the points `changed` (whose bonds broke) belong to; adds nodes with
  /// their parents' motion. Returns the cells whose node changed.
  struct Cell {
    int body, x, y, z;
  };
  std::vector<Cell> update(const std::vector<LatticeBody>& bodies, const Points& points,
                           const std::vector<std::int32_t>& changed, Nodes& nodes, Cpu& cpu);

 private:
  /// Components of a node's points, as the bonds have them now.
  struct Components {
    std::uint8_t label[216];
    std::vector<NodeShare> share;  ///< of each; empty if they are what they were
  };
  Components find_components(const LatticeBody& body, const Points& points, const Cell& cell) const;
  void split_node(int lattice_node, const Components& components, Nodes& nodes);

  std::vector<Split> splits_;
  std::vector<std::int32_t> split_of_;  ///< per lattice node, -1 where whole; empty before any cut
};

}  // namespace tissue_sim
