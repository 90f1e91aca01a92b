#include "material/tear_limit.h"

#include <algorithm>

#include "material/laws.h"

namespace tissue_sim {

double energy_of_pull(const Material& m, double stretch) {
  const double mu = lame_mu(m), lambda = lame_lambda(m);
  const auto at = [&](double across) {
    const double F[9] = {stretch, 0, 0, 0, across, 0, 0, 0, across};
    return m.law == Law::kFixedCorotated ? energy<FixedCorotated>(F, mu, lambda)
                                         : energy<NeoHookean>(F, mu, lambda);
  };
  double low = 0, high = 1;  // it narrows as far as it has least energy
  for (int i = 0; i < 80; ++i) {
    const double a = low + (high - low) / 3, b = high - (high - low) / 3;
    (at(a) < at(b) ? high : low) = at(a) < at(b) ? b : a;
  }
  return at(0.5 * (low + high));
}

double tear_stretch_of(const Material& m, double height) {
  double low = 1, high = kLargestTearStretch;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    const double borne = energy_of_pull(m, middle) * (0.5 + 0.75 / middle) * height;
    (borne < m.toughness ? low : high) = middle;
  }
  return high;
}

}  // namespace tissue_sim
