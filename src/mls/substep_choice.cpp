#include "mls/substep_choice.h"

#include <algorithm>
#include <cmath>

#include "mls/own_rate.h"

namespace tissue_sim {
namespace {

constexpr double kMostRate = 1.0;  // growth of the fastest node's rate by a cut, until the limit is
                                   // measured again
constexpr double kOfHeld = 1;      // substep where all is held [s]
/// How fast a material may swing over the fastest of its nodes by itself: 1.2 to 1.9 were seen, in
/// regular and graded nodes, cut and whole, of Poisson's ratios of 0.3 and 0.45.
constexpr double kTogether = 3;

}  // namespace

MlsSubsteps::MlsSubsteps(const MlsState& s)
    : stiffness_(s.count()), modulus_(s.count()), most_rate_(s.nodes.materials.size(), 0.0) {
  for (int i = 0; i < s.count(); ++i) {
    stiffness_[i].last = static_cast<float>(wave_modulus(s.nodes.material_of(i), 1));
    elements_.push_back(&stiffness_[i]);
  }
}

// Viscosity's fastest rate is that of the mode of the highest frequency, omega = 2 / elastic:
// c = 2 eta / (lambda + 2 mu) omega^2. A soft material has not the frequency of a stiff one beside
// it. Viscous stress F S has F twice, outside and in dE/dt: c grows with the square of the largest
// stretch, not with what squeezed tissue stiffens by, which is much more.
double MlsSubsteps::damping(const MlsState& s, double elastic) const {
  const double omega = 2 / elastic;
  double fastest = 0;
  for (std::size_t k = 0; k < s.nodes.materials.size(); ++k) {
    const Material& m = s.nodes.materials[k];
    const double rate = std::min(omega * omega, kTogether * most_rate_[k]);
    fastest = std::max(fastest, m.viscosity / wave_modulus(m, 1) * rate * stretched_);
  }
  return fastest;
}

void MlsSubsteps::cut(const MlsState& s, const std::vector<std::int32_t>& nodes) {
  if (!limit_.known()) return;                                         // it is measured anyway
  const double known = 4 / (limit_.predicted() * limit_.predicted());  // fastest rate [1/s^2]
  s.cpu->for_each(
      static_cast<int>(nodes.size()),
      [&](int k) {
        const std::int32_t i = nodes[k];
        // What springs come to is known, and may be more than all that strain comes to: the spring
        // of a heavy node that is left with a light one.
        const bool faster = s.sprung[i] != 0
                                ? kTogether * own_rate(s, i) > known
                                : own_rate(s, i) > kMostRate * most_rate_[s.nodes.material[i]];
        if (faster) stiffness_[i].measured = 0;
      },
      256);
}

PartSubsteps MlsSubsteps::part(const MlsState& s, double time, const MeasureLimit& measure) {
  limit_.measure_if_due(elements_, s.time, [&](const std::vector<std::uint8_t>& nodes, int steps) {
    std::vector<double> rate(s.count());
    s.cpu->for_each(
        s.count(), [&](int i) { rate[i] = own_rate(s, i); }, kMlsGroup);
    std::fill(most_rate_.begin(), most_rate_.end(), 0.0);
    for (std::int32_t i = 0; i < s.count(); ++i) {
      double& most = most_rate_[s.nodes.material[i]];
      most = std::max(most, rate[i]);
    }
    return measure(nodes, steps);
  });
  const double elastic = limit_.known() ? limit_.predicted() : kOfHeld;
  const double asked = std::min(1.0, s.scene.cfl / Scene().cfl);
  const double predicted = viscous_substep(asked * kStabilityMargin * elastic, damping(s, elastic));
  const double shortened = acceptance_.shortened();
  const bool undamped = conserves_energy(s.scene.damping, s.nodes.materials);
  const double longest =
      shortened * length_.choose(s.time, predicted, limit_.trend(), shortened < 1, undamped);
  return length_.part(time, longest, s.dt, shortened < 1 ? 0 : 1 / s.scene.frame_rate);
}

bool MlsSubsteps::is_borne(const MlsState& s, const std::vector<float>& stiffening, float stretch2,
                           double dt) {
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
  stretched_ = std::max(1.0f, stretch2);
  return true;
}

}  // namespace tissue_sim
