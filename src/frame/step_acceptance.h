// Whether a part of a frame is accepted, or rejected and done again with shorter substeps.
#pragma once

#include <cmath>
#include <functional>

namespace tissue_sim {

/// What a part of a frame left and brought [J].
struct PartEnergy {
  double kinetic = NAN, elastic = NAN;  ///< at its end; NAN where they were not measured
  double given = 0;                     ///< by instruments
  double time = 0;                      ///< that it took [s]
};

/// Nothing foresees what a part of a frame brings: a few points that swing may stiffen tenfold
/// within six substeps. So a part whose substeps were too long at its end, or that has energy from
/// nowhere, is rejected, and done again with shorter ones: until one is accepted, or they cannot be
/// the reason.
class StepAcceptance {
 public:
  /// Whether a part with substeps of `dt` is accepted where tissue bears `limit` at its end [s].
  /// Where `watched`, its energy counts, too; `by_gravity` is what gravity may have given [J]. If
  /// it is rejected, shortened() falls.
  bool accepts(double dt, double limit, const PartEnergy& energy, bool watched,
               const std::function<double()>& by_gravity);
  /// What the next part begins with [J]; NAN where something else than a part changed it, such as a
  /// cut: no energy counts until it is known again.
  void begin_with(double energy) { energy_ = energy; }
  bool knows_energy() const { return !std::isnan(energy_); }
  /// A part was accepted.
  void restart() { shortened_ = 1; }
  /// How much substeps are shorter than they would be, after parts that were rejected.
  double shortened() const { return shortened_; }

 private:
  template <class Archive>
  friend void fields(Archive& archive, StepAcceptance& x);  // frame/state_fields.h

  double energy_ = NAN;  ///< after the last part that was accepted [J]
  double shortened_ = 1;
};

}  // namespace tissue_sim
