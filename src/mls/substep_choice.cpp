#include "mls/substep_choice.h"

#include <algorithm>
#include <cmath>

#include "mls/own_rate.h"

namespace tissue_sim {
namespace {

constexpr double kMostRate = 1.0;  // growth of the fastest node's rate by a cut, until the limit is
                                   // measured again
constexpr double kOfHeld = 1;      // substep where all is held [s]

}  // namespace

MlsSubsteps::MlsSubsteps(const MlsState& s) : stiffness_(s.count()), modulus_(s.count()) {
  for (int i = 0; i < s.count(); ++i) {
    stiffness_[i].last = static_cast<float>(wave_modulus(s.nodes.material_of(i), 1));
    elements_.push_back(&stiffness_[i]);
  }
}

// Viscosity's fastest rate is that of the mode of the highest frequency, omega = 2 / elastic:
// c = 2 eta / (lambda + 2 mu) omega^2, and grows with the square of the stretch.
double MlsSubsteps::damping(const MlsState& s, double elastic) const {
  const double omega = 2 / elastic;
  double fastest = 0;
  for (const Material& m : s.nodes.materials) {
    fastest = std::max(fastest, m.viscosity / wave_modulus(m, 1) * omega * omega * stiffened_);
  }
  return fastest;
}

void MlsSubsteps::cut(const MlsState& s, const std::vector<std::int32_t>& nodes) {
  if (!limit_.known()) return;  // it is measured anyway
  s.cpu->for_each(
      static_cast<int>(nodes.size()),
      [&](int k) {
        if (own_rate(s, nodes[k]) > kMostRate * most_rate_) stiffness_[nodes[k]].measured = 0;
      },
      256);
}

PartSubsteps MlsSubsteps::part(const MlsState& s, double time, const MeasureLimit& measure) {
  limit_.measure_if_due(elements_, s.time, [&](const std::vector<std::uint8_t>& nodes, int steps) {
    std::vector<double> of_group(s.groups(), 0.0);
    s.cpu->for_each(s.groups(), [&](int group) {
      const int first = group * kMlsGroup, last = std::min(s.count(), first + kMlsGroup);
      for (int i = first; i < last; ++i) {
        of_group[group] = std::max(of_group[group], own_rate(s, i));
      }
    });
    most_rate_ = *std::max_element(of_group.begin(), of_group.end());
    return measure(nodes, steps);
  });
  const double elastic = limit_.known() ? limit_.foreseen() : kOfHeld;
  const double asked = std::min(1.0, s.scene.cfl / Scene().cfl);
  const double foreseen = viscous_substep(asked * kStabilityMargin * elastic, damping(s, elastic));
  const double shortened = acceptance_.shortened();
  const bool undamped = conserves_energy(s.scene.damping, s.nodes.materials);
  const double longest =
      shortened * length_.choose(s.time, foreseen, limit_.trend(), shortened < 1, undamped);
  return length_.part(time, longest, s.dt, shortened < 1 ? 0 : 1 / s.scene.frame_rate);
}

bool MlsSubsteps::is_borne(const MlsState& s, const std::vector<float>& stiffening, double dt) {
  s.cpu->for_each(s.groups(), [&](int group) {
    const int first = group * kMlsGroup, last = std::min(s.count(), first + kMlsGroup);
    for (int i = first; i < last; ++i) {
      modulus_[i] = static_cast<float>(wave_modulus(s.nodes.material_of(i), stiffening[i]));
    }
  });
  const double limit = limit_.known() ? limit_.at(elements_, modulus_) : kOfHeld;
  const bool borne = acceptance_.accepts(dt, std::isnan(limit) ? 0 : limit, PartEnergy(), false,
                                         [] { return 0.0; });
  if (!borne) return false;
  acceptance_.restart();
  const double passed = limit_.follow(elements_, modulus_, s.time);
  length_.follow(passed, limit_.trend(), 1 / s.scene.frame_rate);
  stiffened_ = 1;
  for (const float x : stiffening) stiffened_ = std::max<double>(stiffened_, x);
  return true;
}

}  // namespace tissue_sim
