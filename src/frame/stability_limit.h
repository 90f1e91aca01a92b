// How long a substep may be at most: measured now and then, predicted in between.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "tissue_sim/material.h"

namespace tissue_sim {

/// Of the limit, what is used: the rest is for what stiffens within a part, and contact of faces.
constexpr double kStabilityMargin = 0.76;

/// The largest P-wave modulus in an element (some points that a method counts together), as it is
/// deformed [Pa]: when the limit was measured last, and after the last part of a frame; 0 before.
struct Stiffness {
  float measured = 0, last = 0;
};

/// The largest P-wave modulus of deformed tissue [Pa], as its substep sees it. `stiffening`: the
/// largest column of the cofactor of F, squared.
double wave_modulus(const Material& material, float stiffening);

/// The substep that is as stable with viscosity as `elastic` is without [s], where it slows nodes
/// at twice the rate `damping` [1/s]: (dt / elastic)^2 + damping dt = 1.
double viscous_substep(double elastic, double damping);

/// Whether nothing takes energy from tissue of some of these materials.
bool conserves_energy(double damping, const std::vector<Material>& materials);

/// Measures the limit of stability of the linearised motion [s]: of the elements whose flag is set,
/// with `steps` steps of largest_eigenvalue().
using MeasureLimit = std::function<double(const std::vector<std::uint8_t>& elements, int steps)>;

/// The highest frequency is measured now and then, and where a cut went at once; in between the
/// stiffening of each element bounds how it grew.
class StabilityLimit {
 public:
  /// After a part of a frame, which ended at `time` [s]: `modulus` is each element's now [Pa].
  /// Returns how long it is since the last call [s].
  double follow(const std::vector<Stiffness*>& elements, const std::vector<float>& modulus,
                double time);
  /// Measures what is due at `time` [s]: all elements, or those that are new.
  void measure_if_due(const std::vector<Stiffness*>& elements, double time,
                      const MeasureLimit& measure);

  bool known() const { return limit_ > 0; }
  /// For the next part, if tissue stiffens as in the last [s].
  double predicted() const;
  /// Of tissue with these moduli [s]; NAN where one is not finite.
  double at(const std::vector<Stiffness*>& elements, const std::vector<float>& modulus) const;
  /// How much the stiffness grew in the last part, at most: a factor of 1 or more.
  double trend() const { return trend_; }

 private:
  template <class Archive>
  friend void fields(Archive& archive, StabilityLimit& x);  // frame/state_fields.h

  double limit_ = 0;        ///< when it was measured last [s]; 0 where it is not known
  double measured_at_ = 0;  ///< when that was of all elements [s]
  double longest_age_ = 0;  ///< of limit_ [s]
  double growth_ = 1;       ///< of the stiffness since, at most
  double trend_ = 1;
  double followed_at_ = 0;  ///< [s]
};

}  // namespace tissue_sim
