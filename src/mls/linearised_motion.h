// Small motion about the present state, for largest_eigenvalue().
#pragma once

#include <functional>

#include "mls/state.h"

namespace tissue_sim {

/// Internal forces at displacements `u`: [4 nodes] both.
using MlsForces = std::function<void(const float* u, float* force)>;

/// Steps of Lanczos' method on M^-1/2 K M^-1/2, K from differences of forces.
class MlsLinearisedMotion {
 public:
  MlsLinearisedMotion(const MlsState& state, MlsForces forces);
  void start();
  double apply();
  double orthogonalise(double a, double b);
  void next(double b);

 private:
  const MlsState& s_;
  MlsForces forces_;
  double step_ = 0;  ///< how far a node moves at most [m]
  Array<float> at_rest_, force_, u_;
  std::vector<double> v_, w_, before_, root_;  ///< root_: 1 / sqrt(m), 0 where held
};

/// The longest substep that the present state bears, 2 over its highest frequency [s]; infinite
/// where all is held.
double measured_limit(const MlsState& state, const MlsForces& forces, int steps);

}  // namespace tissue_sim
