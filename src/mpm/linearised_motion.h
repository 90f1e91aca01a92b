// The linearised motion of the tissue on the CPU: accelerations for small displacements.
#pragma once

#include <cstdint>
#include <vector>

#include "mpm/mpm_state.h"

namespace tissue_sim {

/// Largest displacement [cells]: between what curves and what is rounded. The largest is that of
/// the lightest node, at the rim of a cut, where the rest moves a hundredth of it: at a thousandth
/// of a cell that drowned in the rounding of displacements.
inline constexpr float kSmallMotion = 1.0f / 64;

/// A = M^-1 K about the present state, without contact, for largest_eigenvalue(): by differences of
/// the forces that the kernels of the substep give. Vectors are displacements of the nodes, their
/// inner product is weighed by mass. What faces of anchors hold has no part in it. The same bits
/// for any number of threads.
class LinearisedMotion {
 public:
  /// `takes_part`: of each of the state's blocks, whether its stiffness counts; the rest of the
  /// tissue is mass alone.
  LinearisedMotion(MpmState& state, const std::vector<std::uint8_t>& takes_part);
  ~LinearisedMotion();
  LinearisedMotion(const LinearisedMotion&) = delete;
  LinearisedMotion& operator=(const LinearisedMotion&) = delete;

  void start();
  double apply();
  double orthogonalise(double along_v, double along_before);
  void next(double length);

 private:
  using Vector = Array<float>[3];

  /// Sums f(component, i, acceleration) over all entries of a vector, for the nodes' displacements.
  template <class F>
  double accelerations(const F& f);
  /// Sums f(component, i) over all entries of a vector, in a fixed order.
  template <class F>
  double sum(const F& f);
  /// Calls f(component, i) for all entries of a vector.
  template <class F>
  void for_each(const F& f);

  /// Adds the parted nodes at a front whose cells' nodes were all seen.
  void add_front(const std::vector<std::uint8_t>& seen);
  /// Rate of the i-th entry of a vector.
  float& rate(int a, int i);

  MpmState& state_;
  std::vector<int> blocks_;                ///< that take part
  std::vector<std::int32_t> nodes_;        ///< that those see: the vectors have an entry for each
  std::vector<int> front_cells_;           ///< that take part
  std::vector<std::int32_t> front_nodes_;  ///< parted nodes: entries behind those of nodes
  std::vector<int> held_;                  ///< groups of anchors' faces that hold some of these
  Array<float> mass_;                      ///< of these [kg]
  Array<float> d_[3], front_rates_[3];     ///< what the front had
  Array<float> u_[3], rates_[3];           ///< what the state's nodes had
  Vector at_rest_;                         ///< accelerations without displacement [m/s^2]
  Vector before_, v_, w_;
};

}  // namespace tissue_sim
