// The front of a cut: nodes that are parted ahead of it, so that a cut ends where the blade's edge
// ended, also inside a cell. docs/mpm.md, "The front".
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "compute/array.h"
#include "compute/host_device.h"
#include "mpm/lattice/lattice_body.h"
#include "mpm/split/front_cell.h"
#include "mpm/split/node_box.h"

namespace tissue_sim {

struct LatticeTissue;
struct NodeStep;
struct BladePath;

/// A node (field) around which a cut ends. Two sides of its points see u + other d and u - first d,
/// with the shares of its mass that they have: u is the node's own, their mean by mass.
struct FrontNode {
  std::int32_t node;           ///< in Nodes
  std::int32_t body, x, y, z;  ///< its cell
  float share;                 ///< of how far it is parted, 0 to 1: grows as the cut goes on
  float first, other;          ///< shares of the node's mass
  float mass;                  ///< of d: first other m [kg]
  float lambda_over_mu;        ///< of its points
  Planes all, first_side;      ///< its points, and those of one side
  TISSUE_SIM_FIELDS(node, body, x, y, z, share, first, other, mass, lambda_over_mu, all, first_side)
};

/// What a cut changes of the front.
struct FrontNodes {
  /// Bonds at the rim of what was cut, 3 point + axis, and which of kRimProbes places of the area
  /// that the bond stands for an edge has passed. Others were passed wholly if they are broken.
  std::map<std::int64_t, std::uint32_t> rim;
  std::vector<FrontNode> nodes;  ///< by their number in Nodes
};

/// What a substep changes of it.
struct FrontMotion {
  Array<float> d[3],
      rate[3];  ///< of its nodes: how far apart the two sides are [m], how fast [m/s]
  TISSUE_SIM_FIELDS(d, rate)
};

struct Front : FrontNodes, FrontMotion {
  // What follows from that: list_front_cells().
  std::vector<FrontCell> cells;
  std::vector<FrontPart> parts;
  /// Where forces go: of each node that a cell sees, and of each parted one, places in `force` and
  /// `pull`, in the order of the cells.
  struct Sum {
    std::int32_t node, first, count;
  };
  std::vector<Sum> node_sums, part_sums;
  std::vector<std::int32_t> node_places, part_places;
  Array<float> force, pull;  ///< of the cells [28][4] each, of the parts [4] each [N]

  /// Work of list_front_cells(), by node, as that leaves it: -1 and 0 for all.
  std::vector<std::int32_t> number, counted;
};

inline constexpr int kRimProbes = 32;

/// Whether the bond of a point to the next one along an axis is broken, or none was.
inline bool is_broken(const Points& points, std::int32_t p, int axis) {
  return (points.bonds[p] >> (kForwardBond + axis) & 1) == 0;
}

/// Widens the rim by what the points `changed`, which lost bonds, add to it, and notes what the
/// path passed of it, as sweep_bonds(). Appends points of bonds of which it passed more. `near`:
/// by point, 0 where it is farther than kRimReach from all that the edges sweep; null: not known.
void pass_rim(LatticeTissue& tissue, const BladePath& path, const Array<float>* u_begin,
              const Array<float>* u_end, const std::vector<std::int32_t>& broken,
              const std::uint8_t* near, std::vector<std::int32_t>& touched);
inline constexpr double kRimReach = 3;  ///< [cells]

/// Works out the masses of a node's two sides, from `all` and `first_side`. Returns whether both
/// are heavy enough to part it.
bool weigh_sides(const LatticeTissue& tissue, FrontNode& node);
/// Whether the cut that parts a node ends between its points: not in a field that is left of one
/// where the cut went on beside it. Points of both sides in that are those that the first plane,
/// through a few bonds, put on the wrong one.
bool is_cut_between_sides(const LatticeTissue& tissue, const FrontNode& node);
/// After nodes were split: new fields take over the motion of the side that they were; those of
/// both sides, where another cut came across, are parted as the node was.
void split_front(LatticeTissue& tissue);
/// Parts nodes around the points `touched`, of whose bonds more was passed; not those that `held`,
/// which may end before the last node, names (AnchorFaces::at_row).
void follow_front(LatticeTissue& tissue, const std::vector<std::int32_t>& touched,
                  const std::vector<std::uint8_t>& held);

FrontField front_field(const LatticeTissue& tissue);
/// Moves on what the cells push, after all nodes were moved on without them; parts are i of
/// `front_moves()`.
int front_moves(const Front& front);
void move_front(LatticeTissue& tissue, const NodeStep& step, int i);
/// Of the motion of parted nodes [J].
double front_kinetic_energy(const Front& front);

}  // namespace tissue_sim
