#include "pbd/viscosity.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "pbd/free_flight.h"

namespace tissue_sim {
namespace pbd {
namespace {

constexpr double kLeastOfCuts = 1;  // [Pa s]
constexpr double kDensity = 1000;   // [kg/m^3]

/// How fast what has no hold turns with that angular momentum [1/s]. A piece of few vertices may
/// have no inertia about one of its axes: no spin there.
Vec3 spin_of(const Flight& f, const Vec3& angular) {
  if (!f.is_free) return Vec3::Zero();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(f.inertia);
  const Vec3 there = axes.eigenvectors().transpose() * angular;
  Vec3 spin = Vec3::Zero();
  for (int a = 0; a < 3; ++a) {
    const double moment = axes.eigenvalues()[a];
    if (!(moment > 1e-3 * axes.eigenvalues()[2])) continue;
    spin += there[a] / moment * axes.eigenvectors().col(a);
  }
  return spin;
}

}  // namespace

std::vector<double> viscosities(const State& s) {
  if (!s.tetrahedra.empty()) return {};
  std::vector<double> of;
  for (const Body& body : s.scene.bodies) {
    const double own = find_material(s.scene, body.material).viscosity;
    of.push_back(s.wounds.empty() ? own : std::max(own, kLeastOfCuts));
  }
  if (std::all_of(of.begin(), of.end(), [](double eta) { return eta == 0; })) of.clear();
  return of;
}

void damp_neighbours(State& s, double duration) {
  const std::vector<double> viscosity = viscosities(s);
  if (viscosity.empty()) return;
  const std::vector<Flight> before = flights(s);
  std::vector<Vec3> spins;
  for (const Flight& f : before) spins.push_back(spin_of(f, f.angular));
  Vertices& v = s.vertices;
  for (int c = 0; c < s.edge_count; ++c) {
    const auto [a, b] = s.links.vertices[c];
    const double wa = v.x[4 * a + 3], wb = v.x[4 * b + 3];
    if (!(wa + wb > 0)) continue;
    const double length = s.links.numbers[c][0];
    const double lost =
        1 - std::exp(-viscosity[v.body[a]] * duration / (kDensity * length * length));
    const Vec3 rigid = spins[s.component[a]].cross(v.position(b) - v.position(a));
    const Vec3 push = lost / (wa + wb) * (v.velocity(b) - v.velocity(a) - rigid);
    for (int k = 0; k < 3; ++k) {
      v.v[4 * a + k] += static_cast<float>(wa * push[k]);
      v.v[4 * b + k] -= static_cast<float>(wb * push[k]);
    }
  }
  // Pushes across an edge turn what they act on: back.
  const std::vector<Flight> after = flights(s);
  for (std::size_t c = 0; c < spins.size(); ++c) {
    spins[c] = spin_of(after[c], before[c].angular - after[c].angular);
  }
  for (int i = 0; i < v.size(); ++i) {
    const Flight& f = after[s.component[i]];
    const Vec3 add = spins[s.component[i]].cross(v.position(i) - f.centre);
    for (int k = 0; k < 3; ++k) v.v[4 * i + k] += static_cast<float>(add[k]);
  }
}

}  // namespace pbd
}  // namespace tissue_sim
