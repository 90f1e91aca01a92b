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
#include "compute/host_device.h"
#include "mpm/lattice/lattice_body.h"
#include "mpm/lattice/nodes.h"
#include "mpm/split/node_box.h"

namespace tissue_sim {

class NodeFields {
 public:
  struct Cell {
    int body, x, y, z;
  };

  /// Fills the nodes of all bodies: masses, anchors, at rest.
  NodeFields(const std::vector<LatticeBody>& bodies, const Points& points, Nodes& nodes);

  /// The node that stands for lattice node (x, y, z) as `point` sees it.
  int node(const LatticeBody& body, const Points::Site& point, int x, int y, int z) const;
  /// The same for the node `k` (0..26, x fastest) of the point's stencil.
  int node(const LatticeBody& body, const Points::Site& point, int k) const;

  struct Split {
    struct Field {
      Planes points;  ///< around the node: a component
      std::int32_t node;
      TISSUE_SIM_FIELDS(points, node)
    };
    std::vector<Field> fields;

    /// The node that the point at a place of the box sees: `in_plane` is bit_in_plane().
    std::int32_t field_at(int plane, int in_plane) const {
      std::size_t i = fields.size() - 1;
      while (i > 0 && (fields[i].points[plane] >> in_plane & 1) == 0) --i;
      return fields[i].node;
    }
    /// The node that `point` sees, of the node of cell (x, y, z).
    int seen_by(const Points::Site& point, int x, int y, int z) const;
    TISSUE_SIM_FIELDS(fields)
  };
  /// How a lattice node is split, null where it is not.
  const Split* split(int lattice_node) const {
    if (split_of_.empty() || split_of_[lattice_node] < 0) return nullptr;
    return &splits_[split_of_[lattice_node]];
  }
  const BondWindows& bonds() const { return bonds_; }
  std::size_t split_count() const { return splits_.size(); }
  /// After bonds and fields were read from a saved state.
  void follow(const std::vector<LatticeBody>& bodies, const Points& points) {
    bonds_ = BondWindows(bodies, points);
  }

  /// Takes the nodes apart that the points `changed` (whose bonds broke) belong to; adds nodes with
  /// their parents' motion. Returns the cells whose node changed.
  std::vector<Cell> update(const std::vector<LatticeBody>& bodies, const Points& points,
                           const std::vector<std::int32_t>& changed, Nodes& nodes, Cpu& cpu);

 private:
  template <class Archive>
  friend void fields(Archive& archive, NodeFields& x);  // mpm/mpm_fields.h

  /// How the node of a cell is split now, if otherwise than before, else nothing. The first
  /// component that was part of a field keeps it; for others `node` is ~ their parent.
  Split taken_apart(const Cell& cell, int lattice_node) const;

  BondWindows bonds_;
  /// Per lattice node: the mass of each of its points where it is the same for all and none is
  /// anchored, else 0 [kg].
  std::vector<float> mass_of_point_;
  std::vector<Split> splits_;
  std::vector<std::int32_t> split_of_;  ///< per lattice node, -1 where whole; empty before any cut
};

// The cells around which something changes where points lose bonds.

/// The cells of a body that lie near some of its points.
class CellsAround {
 public:
  /// Those within `reach` cells along each axis of cells that hold points of `some`.
  CellsAround(const LatticeBody& body, int reach, const Points& points,
              const std::vector<std::int32_t>& some);

  /// Calls f(x, y, z, node, near, count) for rows of the body's lattice nodes, in their order:
  /// `count` from x on, numbered from `node` on, of which near[i] says whether their cell is one.
  template <class F>
  void for_each_row(const F& f) const {
    for (int z = 0; z < n_[2]; ++z) {
      for (int y = 0; y < n_[1]; ++y) {
        const std::uint8_t* row = &near_[(static_cast<std::size_t>(z) * n_[1] + y) * n_[0]];
        body_.for_each_node_in_row(low_[0], low_[0] + n_[0], low_[1] + y, low_[2] + z,
                                   [&](int x, int node, int count) {
                                     f(x, low_[1] + y, low_[2] + z, node, row + x - low_[0], count);
                                   });
      }
    }
  }

 private:
  const LatticeBody& body_;
  int low_[3] = {}, n_[3] = {};     // of a box [cells]
  std::vector<std::uint8_t> near_;  // [z][y][x] of it
};

}  // namespace tissue_sim
