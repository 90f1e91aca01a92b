// The highest frequency of a linear motion, by Lanczos' method.
#pragma once

#include <Eigen/Eigenvalues>
#include <cmath>

namespace tissue_sim {

/// Upper estimate of the largest eigenvalue of the symmetric operator A of `motion`, which holds
/// the vectors v, w and the one before v (its steps are named in order below). The largest Ritz
/// value of `steps` steps from a random start plus its residual: Zhou and Li, Bounding the spectrum
/// of large Hermitian matrices, Linear Algebra Appl. 435 (2011). 0 for a motion without any.
///   start()              v random, of length 1, the one before it 0
///   apply()              w = A v; returns <v, w>
///   orthogonalise(a, b)  w -= a v + b (the one before v); returns |w|
///   next(b)              the one before = v, v = w / b
template <class Motion>
double largest_eigenvalue(Motion& motion, int steps) {
  Eigen::VectorXd diagonal(steps), off(steps);
  motion.start();
  double beta = 0;
  int count = 0;
  while (count < steps) {
    const double alpha = motion.apply();
    const double length = motion.orthogonalise(alpha, beta);
    diagonal[count] = alpha;
    off[count] = beta = length;
    ++count;
    if (!(beta > 1e-6 * std::fabs(diagonal[0]))) break;  // all of it is found
    if (count < steps) motion.next(beta);
  }
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> ritz;
  ritz.computeFromTridiagonal(diagonal.head(count), off.head(count - 1));
  return ritz.eigenvalues()[count - 1] +
         beta * std::fabs(ritz.eigenvectors()(count - 1, count - 1));
}

}  // namespace tissue_sim
