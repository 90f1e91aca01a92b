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

namespace {

/// Of what touches, together, at the group's number; each other has no mass.
std::vector<Flight> together(const State& s, const std::vector<Flight>& of) {
  std::vector<Flight> sum(of.size());
  for (std::size_t c = 0; c < of.size(); ++c) {
    Flight& f = sum[s.group[c]];
    f.mass += of[c].mass;
    f.centre += of[c].mass * of[c].centre;
    f.linear += of[c].linear;
    f.is_free = f.is_free && of[c].is_free;
  }
  for (Flight& f : sum) f.centre /= f.mass > 0 ? f.mass : 1;
  for (std::size_t c = 0; c < of.size(); ++c) {
    Flight& f = sum[s.group[c]];
    const Vec3 r = of[c].centre - f.centre;
    f.angular += of[c].angular + r.cross(of[c].linear);
    f.inertia += of[c].inertia +
                 of[c].mass * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
  }
  return sum;
}

}  // namespace

std::vector<RigidChange> missing_motion(const State& s, const std::vector<Flight>& before_each,
                                        const std::vector<Flight>& now_each, int steps, float h) {
  const Scene& scene = s.scene;
  const std::vector<Flight> before = together(s, before_each), now = together(s, now_each);
  const double decay = static_cast<float>(std::exp(-scene.damping * h));
  std::vector<RigidChange> changes(now.size());
  for (std::size_t c = 0; c < now.size(); ++c) {
    if (!now[c].is_free || !(now[c].mass > 0)) continue;
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
  for (std::size_t c = 0; c < now.size(); ++c) changes[c] = changes[s.group[c]];
  return changes;
}

void keep_momentum(State& s, const std::vector<Flight>& before, int steps, float h) {
  Vertices& v = s.vertices;
  std::vector<Flight> now = flights(s);
  for (int i = 0; i < v.size(); ++i) {
    const std::int32_t c = s.component[i];
    if (s.pushed[i] != 0) now[c].is_free = false;
  }
  const std::vector<RigidChange> changes = missing_motion(s, before, now, steps, h);
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
