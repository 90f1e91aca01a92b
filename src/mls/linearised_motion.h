// Small motion about the present state, for largest_eigenvalue().
#pragma once

#include "mls/state.h"

namespace tissue_sim {

/// Steps of Lanczos' method on M^-1/2 K M^-1/2, K from differences of forces.
class MlsLinearisedMotion {
 public:
  explicit MlsLinearisedMotion(MlsState& state);
  void start();
  double apply();
  double orthogonalise(double a, double b);
  void next(double b);

 private:
  MlsState& s_;
  double step_ = 0;  ///< how far a node moves at most [m]
  Array<float> at_rest_, force_, u_;
  std::vector<double> v_, w_, before_, root_;  ///< root_: 1 / sqrt(m), 0 where held
};

/// The longest substep that the present state bears, 2 over its highest frequency [s]; infinite
/// where all is held.
double measured_limit(MlsState& state, int steps);

}  // namespace tissue_sim
