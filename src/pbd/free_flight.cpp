#include "pbd/free_flight.h"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace tissue_sim {
namespace pbd {
namespace {

constexpr double kViscosity = 1;      // [Pa s]
constexpr double kDensity = 1000;     // [kg/m^3]
constexpr double kLeastDecay = 0.95;  // a frame's; larger pieces, of some 5 cm^3, keep all

}  // namespace

std::vector<Flight> flights(const State& s) {
  const Vertices& v = s.vertices;
  std::vector<Flight> of(s.components);
  for (int i = 0; i < v.size(); ++i) {
    Flight& f = of[s.component[i]];
    f.mass += v.mass[i];
    f.centre += v.mass[i] * v.position(i);
    f.linear += v.mass[i] * v.velocity(i);
    f.is_free = f.is_free && v.anchored[i] == 0;
  }
  for (Flight& f : of) f.centre /= f.mass;
  for (int i = 0; i < v.size(); ++i) {
    Flight& f = of[s.component[i]];
    if (!f.is_free) continue;
    const Vec3 r = v.position(i) - f.centre;
    f.angular += v.mass[i] * r.cross(v.velocity(i));
    f.inertia += v.mass[i] * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
  }
  return of;
}

Vec3 spin_of(const Flight& f, const Vec3& angular) {
  Vec3 spin = Vec3::Zero();
  if (!f.is_free) return spin;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(f.inertia);
  const Vec3 there = axes.eigenvectors().transpose() * angular;
  for (int a = 0; a < 3; ++a) {
    const double moment = axes.eigenvalues()[a];
    if (!(moment > 1e-3 * axes.eigenvalues()[2])) continue;
    spin += there[a] / moment * axes.eigenvectors().col(a);
  }
  return spin;
}

std::vector<RigidChange> missing_motion(const Scene& scene, const std::vector<Flight>& before,
                                        const std::vector<Flight>& now, int steps, float h) {
  const double decay = static_cast<float>(std::exp(-scene.damping * h));
  std::vector<RigidChange> changes(now.size());
  for (std::size_t c = 0; c < now.size(); ++c) {
    if (!now[c].is_free) continue;
    changes[c].is_free = true;
    changes[c].centre = now[c].centre;
    Vec3 speed = before[c].linear / before[c].mass, angular = before[c].angular;
    for (int i = 0; i < steps; ++i) {
      speed = decay * speed + h * scene.gravity;
      angular *= decay;
    }
    const double mass = now[c].mass;
    const double rate = kViscosity / (kDensity * std::pow(mass / kDensity, 2.0 / 3));
    const double keep = std::exp(-rate * steps * h);
    changes[c].keep = keep < kLeastDecay ? keep : 1;
    const double lost = 1 - changes[c].keep;
    changes[c].linear = speed - changes[c].keep * now[c].linear / mass;
    changes[c].spin = spin_of(now[c], angular - now[c].angular + lost * now[c].angular);
  }
  return changes;
}

void keep_momentum(State& s, const std::vector<Flight>& before, int steps, float h) {
  Vertices& v = s.vertices;
  std::vector<Flight> now = flights(s);
  for (int i = 0; i < v.size(); ++i) {
    const std::int32_t c = s.component[i];
    if (s.pushed[i] != 0 || s.touching[c] != 0) now[c].is_free = false;
  }
  const std::vector<RigidChange> changes = missing_motion(s.scene, before, now, steps, h);
  for (int i = 0; i < v.size(); ++i) {
    const RigidChange& change = changes[s.component[i]];
    if (!change.is_free) continue;
    const Vec3 add = change.linear + change.spin.cross(v.position(i) - change.centre);
    const auto keep = static_cast<float>(change.keep);
    for (int a = 0; a < 3; ++a) {
      v.v[4 * i + a] = keep * v.v[4 * i + a] + static_cast<float>(add[a]);
    }
  }
}

}  // namespace pbd
}  // namespace tissue_sim
