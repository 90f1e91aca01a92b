// How many steps tetrahedra of a material need.
#include <algorithm>
#include <cmath>

#include "pbd/model.h"

namespace tissue_sim {
namespace pbd {
namespace {

/// A step of h seconds lets an element move by `rate` h^2 of what its deviatoric compliance does,
/// and a ball's force came out smaller by 1 - 1 / (1 + kTooSoft rate h^2), whatever the mesh
/// (docs/pbd.md). Within 5 % at kMost.
constexpr double kTooSoft = 2.2, kMost = 0.022;
constexpr int kMostSteps = 1000, kStepsOfOthers = 20;

/// The largest of all bodies, each the mean over its volume [1/s^2].
double rate_of(const State& s) {
  const auto bodies = s.scene.bodies.size();
  std::vector<double> sum(bodies, 0.0), volume(bodies, 0.0);
  for (const Tetrahedron& t : s.tetrahedra) {
    const auto& x = s.vertices.reference;
    Eigen::Matrix3d q;
    for (int k = 0; k < 3; ++k) q.col(k) = x[t[k + 1]] - x[t[0]];
    const Eigen::Matrix3d g = q.inverse();  // rows: slopes of the corners' shares
    const Vec3 first = -g.colwise().sum().transpose();
    double mobility = first.squaredNorm() / s.vertices.mass[t[0]];
    for (int k = 0; k < 3; ++k) mobility += g.row(k).squaredNorm() / s.vertices.mass[t[k + 1]];
    const int b = s.vertices.body[t[0]];
    const Vec3 centre = 0.25 * (x[t[0]] + x[t[1]] + x[t[2]] + x[t[3]]);
    const double v = q.determinant() / 6;
    // Over all directions of the strain.
    sum[b] += v * lame_mu(material_at(s.scene, s.scene.bodies[b], centre)) * v * 2 / 3 * mobility;
    volume[b] += v;
  }
  double rate = 0;
  for (std::size_t b = 0; b < bodies; ++b) {
    if (volume[b] > 0) rate = std::max(rate, sum[b] / volume[b]);
  }
  return rate;
}

int steps_within(double duration, double longest) {
  return std::max(1, std::min(kMostSteps, static_cast<int>(std::ceil(duration / longest - 1e-6))));
}

std::string percent(double share) {
  return std::to_string(static_cast<int>(std::lround(100 * share))) + " %";
}

}  // namespace

void choose_steps(State& s, std::vector<std::string>* notes) {
  int& steps = s.scene.pbd.steps;
  const bool chosen = steps == 0;
  const double frame = 1 / s.scene.frame_rate;
  if (s.tetrahedra.empty() || s.scene.pbd.elasticity != PbdElasticity::kMaterial) {
    if (chosen) steps = kStepsOfOthers;
    s.longest_step = frame / steps;
    return;
  }
  const double rate = rate_of(s);
  const double longest = std::sqrt(kMost / rate);
  const int enough = steps_within(frame, longest);
  if (chosen) steps = enough;
  s.longest_step = chosen ? longest : frame / steps;
  if (s.scene.pbd.iterations > 1 || notes == nullptr) return;
  const double h = frame / steps, soft = kTooSoft * rate * h * h;
  if (soft <= 1.1 * kTooSoft * kMost) return;
  notes->push_back("pbd: " + std::to_string(steps) +
                   " steps a frame are few for tetrahedra so fine and stiff: " +
                   "they press back by some " + percent(soft / (1 + soft)) + " too little" +
                   (chosen ? "; coarser ones would need fewer"
                           : "; " + std::to_string(enough) + " would be within 5 %" +
                                 (has_fluid(s.scene) ? "" : ", and are chosen with steps: 0")));
}

int steps_of(const State& s, double duration) { return steps_within(duration, s.longest_step); }

}  // namespace pbd
}  // namespace tissue_sim
