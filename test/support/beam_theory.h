// Timoshenko's beam: what bending should come to in the validation tests.
#pragma once

#include <Eigen/Dense>
#include <cmath>

namespace tissue_sim {

/// A straight beam of rectangular section.
struct Beam {
  double length = 0, height = 0, width = 0;  ///< [m]
  double young_modulus = 0;                  ///< [Pa]
  double poisson_ratio = 0;
  double density = 0;  ///< [kg/m^3]

  double area() const { return width * height; }
  double bending_stiffness() const { return young_modulus * width * std::pow(height, 3) / 12; }
  /// kappa G A, kappa of Cowper (J. Appl. Mech. 33:335, 1966).
  double shear_stiffness() const {
    const double kappa = 10 * (1 + poisson_ratio) / (12 + 11 * poisson_ratio);
    return kappa * young_modulus / (2 * (1 + poisson_ratio)) * area();
  }
};

/// Tip of a cantilever under its own weight: w L^4 / (8 EI) + w L^2 / (2 kappa G A) [m].
inline double tip_deflection(const Beam& b, double gravity) {
  const double w = b.density * b.area() * gravity, l2 = b.length * b.length;
  return w * l2 * l2 / (8 * b.bending_stiffness()) + w * l2 / (2 * b.shear_stiffness());
}

enum class Ends { kFree, kClampedFree };

/// beta L of the first bending mode of a slender beam.
inline double first_mode(Ends ends) { return ends == Ends::kFree ? 4.730040745 : 1.875104069; }

/// First bending mode of a slender beam at x / L, and its slope by x / L.
inline double mode_shape(Ends ends, double x, double* slope) {
  const double b = first_mode(ends), s = ends == Ends::kFree ? 1 : -1;
  const double k = (std::cosh(b) - s * std::cos(b)) / (std::sinh(b) - s * std::sin(b));
  const double c = std::cosh(b * x), h = std::sinh(b * x);
  *slope = b * (h - s * std::sin(b * x) - k * (c + s * std::cos(b * x)));
  return c + s * std::cos(b * x) - k * (h + s * std::sin(b * x));
}

/// Angular frequency of the first bending mode of the slender beam [rad/s].
inline double slender_frequency(const Beam& b, Ends ends) {
  const double k = first_mode(ends) / b.length;
  return k * k * std::sqrt(b.bending_stiffness() / (b.density * b.area()));
}

/// The same with shear and rotary inertia: the frequency at which (w, theta, V, M), carried from
/// one end of the beam to the other by w' = theta + V / (kappa G A), theta' = M / EI, V' = -rho A
/// om^2 w, M' = -V - rho I om^2 theta, can meet the conditions at both ends.
inline double bending_frequency(const Beam& b, Ends ends) {
  const auto mismatch = [&b, ends](double om) {
    const double inertia = b.density * b.area() * om * om;
    Eigen::Matrix4d a = Eigen::Matrix4d::Zero();
    a(0, 1) = 1;
    a(0, 2) = 1 / b.shear_stiffness();
    a(1, 3) = 1 / b.bending_stiffness();
    a(2, 0) = -inertia;
    a(3, 1) = -inertia * b.height * b.height / 12;
    a(3, 2) = -1;
    const Eigen::Matrix4d x = a * (b.length / 1024);
    Eigen::Matrix4d carry = Eigen::Matrix4d::Identity();
    for (int i = 6; i > 0; --i) carry = Eigen::Matrix4d::Identity() + x * carry / i;
    for (int i = 0; i < 10; ++i) carry = (carry * carry).eval();
    return ends == Ends::kFree ? carry.block<2, 2>(2, 0).determinant()
                               : carry.block<2, 2>(2, 2).determinant();
  };
  double low = 0.3 * slender_frequency(b, ends), high = low;
  while (mismatch(low) * mismatch(high) > 0) high *= 1.02;
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    (mismatch(low) * mismatch(middle) > 0 ? low : high) = middle;
  }
  return low;
}

}  // namespace tissue_sim
