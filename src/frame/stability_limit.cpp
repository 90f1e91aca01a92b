#include "frame/stability_limit.h"

#include <algorithm>
#include <cmath>

namespace tissue_sim {
namespace {

constexpr int kSteps = 8, kStepsOfNew = 4;
constexpr double kLongestAge = 0.5;  // of the measured limit [s] ...
constexpr double kFallenAge = 0.1;   // ... where it fell to less than this share: what made it
constexpr double kFall = 0.9;        // fall may have passed, or be gone with the cut
constexpr double kMostGrowth = 1.3;  // of the stiffness, until it is measured again ...
constexpr double kYoungest = 0.015;  // ... unless that is not long ago [s]

}  // namespace

double wave_modulus(const Material& m, float stiffening) {
  const double mu = lame_mu(m), lambda = lame_lambda(m);
  // Waves in the deformed body, in reference space: the volumetric stiffness grows with the
  // square of the cofactor's columns.
  const double volumetric = m.law == Law::kNeoHookean ? lambda + mu : lambda;
  return lambda + 2 * mu + volumetric * std::max(0.0f, stiffening - 1);
}

double viscous_substep(double elastic, double damping) {
  const double b = 0.5 * damping * elastic * elastic;
  return std::sqrt(b * b + elastic * elastic) - b;
}

bool conserves_energy(double damping, const std::vector<Material>& materials) {
  return damping == 0 && std::any_of(materials.begin(), materials.end(),
                                     [](const Material& m) { return m.viscosity == 0; });
}

double StabilityLimit::follow(const std::vector<Stiffness*>& elements,
                              const std::vector<float>& modulus, double time) {
  growth_ = 1;
  double trend = 1;
  for (std::size_t i = 0; i < modulus.size(); ++i) {
    Stiffness& s = *elements[i];
    if (s.measured > 0) growth_ = std::max(growth_, static_cast<double>(modulus[i] / s.measured));
    if (s.last > 0) trend = std::max(trend, static_cast<double>(modulus[i] / s.last));
    s.last = modulus[i];
  }
  const double passed = time - followed_at_;
  if (passed > 0) trend_ = trend;
  followed_at_ = time;
  return passed;
}

void StabilityLimit::measure_if_due(const std::vector<Stiffness*>& elements, double time,
                                    const MeasureLimit& measure) {
  std::vector<std::uint8_t> to_measure(elements.size(), 1);
  const double age = time - measured_at_;
  const bool just_measured = age > 0 && age < kYoungest;
  const double before = limit_;
  if (limit_ == 0 || age > longest_age_ || (growth_ > kMostGrowth && !just_measured)) {
    limit_ = measure(to_measure, kSteps);
    longest_age_ = kLongestAge;
    growth_ = 1;
    measured_at_ = time;
  } else {
    bool any = false;
    for (std::size_t i = 0; i < elements.size(); ++i) {
      to_measure[i] = elements[i]->measured == 0;
      any = any || to_measure[i] != 0;
    }
    if (!any) return;
    limit_ = std::min(limit_, measure(to_measure, kStepsOfNew));
  }
  if (limit_ < kFall * before) longest_age_ = kFallenAge;
  if (!std::isfinite(limit_)) limit_ = 0;  // all is anchored
  for (std::size_t i = 0; i < elements.size(); ++i) {
    if (to_measure[i] != 0) elements[i]->measured = elements[i]->last;
  }
}

double StabilityLimit::predicted() const { return limit_ / std::sqrt(growth_ * trend_); }

double StabilityLimit::at(const std::vector<Stiffness*>& elements,
                          const std::vector<float>& modulus) const {
  double growth = 1;
  for (std::size_t i = 0; i < modulus.size(); ++i) {
    if (!std::isfinite(modulus[i])) return NAN;  // of an element that is not measured yet, too
    const float measured = elements[i]->measured;
    if (measured > 0 && modulus[i] > growth * measured) growth = modulus[i] / measured;
  }
  return limit_ / std::sqrt(growth);
}

}  // namespace tissue_sim
