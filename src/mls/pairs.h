// Pairs of neighbours and their weights: all that moving least squares know of the body's shape.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "compute/array.h"
#include "compute/for_each.h"
#include "mls/nodes.h"

namespace tissue_sim {

/// Each pair stands twice, once with each of its nodes: entries begin[i] .. begin[i + 1] - 1 are
/// those of node i, by rising neighbour. Both entries of a pair have the same weights.
struct MlsPairs {
  Array<std::int32_t> begin;  ///< per node, and one more
  Array<std::int32_t> other;  ///< the neighbour
  Array<std::int32_t> twin;   ///< the pair's entry with the neighbour
  Array<float> whole;         ///< weight while nothing is cut, in units of the mean
  Array<float> weight;        ///< the same times what cuts leave of it, 1 to 0
  /// 0, or where a cut passes between the two, as mark_of_crossing() says. Of the two entries of a
  /// pair each has it from its own node.
  Array<std::uint8_t> crossed;
  std::vector<double> support;  ///< radius of each node's kernel [m]

  std::int32_t nodes() const { return static_cast<std::int32_t>(begin.size()) - 1; }
  /// Entry of the pair, -1 where they are no neighbours.
  std::int32_t find(std::int32_t node, std::int32_t neighbour) const;
};

/// What MlsPairs::crossed holds of a pair that a cut passes at this share of the way from the
/// entry's node to the other, and back.
inline std::uint8_t mark_of_crossing(float share) {
  return static_cast<std::uint8_t>(1.5f + 254 * (share > 0 ? (share < 1 ? share : 1.0f) : 0.0f));
}
inline double crossing_place(std::uint8_t mark) { return (mark - 1) / 254.0; }

/// Radius of the support over the mean distance to the six nearest, so that a node within a regular
/// lattice has as many neighbours.
double support_factor(int neighbours);

/// Pairs nodes of one body that are nearer than the mean of their supports, and that no gap parts;
/// of a tetrahedral mesh those alone that hang together in it; what hangs together there but in no
/// such pairs gets pairs along its edges.
/// The weight is the kernel (h^2 - r^2)^3 / h^9 of Aras, Shen, Audette 2014, eq. 11, of that mean:
/// symmetric, so that forces are. Times the fourth root of both volumes, not by whole ones: a node
/// reads its strain where the middle of its support is, and of graded nodes large shares draw that
/// inward. Throws std::invalid_argument for nodes at one place.
MlsPairs make_pairs(const MlsNodes& nodes, int neighbours, Cpu& cpu);

/// Notes how many pairs are farther than supports reach: cells of a tetrahedral mesh are too long
/// and thin then.
void note_far_pairs(const MlsNodes& nodes, const MlsPairs& pairs, std::vector<std::string>& notes);

/// Changes the weights as little as needed (each in proportion to itself) for uniform stress to
/// leave all nodes but those at the surface in balance:
///   sum_j w_ij (N_i + N_j) r_ij = 0,   N_i = V_i M_i^-1,   M_i = sum_j w_ij r_ij r_ij^T,
/// by Newton's method, where each step is the one of least sum dw^2 / w. No weight changes by more
/// than 32 times. Returns the largest part of the sum that is left, over the sum of the lengths of
/// its terms.
///
/// Of a node j at the surface of a lattice, what of its volume lies outside of the nodes (a share
/// f, along the normal n) does not count across the surface:
///   N_j = V_j (M_j^-1 - f M_j^-1 n n^T M_j^-1 / n^T M_j^-1 n).
/// Uniform stress there is borne by what pulls at the surface, not by the pairs behind it. With it
/// n nodes in a row would have to pass n volumes on by n - 1 gaps between them, all alike: they do
/// with binomial weights alone, 1 at the ends and 5e6 in the middle of 26.
double balance(const MlsNodes& nodes, bool lattice, Cpu& cpu, MlsPairs& pairs);

}  // namespace tissue_sim
