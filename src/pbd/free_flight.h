// Momentum of what flies freely: single precision loses it, vertex by vertex and step by step.
#pragma once

#include <vector>

#include "pbd/pbd_state.h"

namespace tissue_sim {
namespace pbd {

/// What hangs together (State::component), in double precision.
struct Flight {
  bool is_free = true;  ///< nothing holds it
  double mass = 0;      ///< [kg]
  Vec3 centre = Vec3::Zero(), linear = Vec3::Zero();
  Vec3 angular = Vec3::Zero();  ///< about its centre
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
};
std::vector<Flight> flights(const State& s);
/// How fast it turns with that angular momentum [1/s]; not at all where it is not free, nor about
/// an axis about which it has no inertia, as a piece of few vertices may.
Vec3 spin_of(const Flight& f, const Vec3& angular);

/// What hangs together gets `keep` of its velocities, and a rigid motion.
struct RigidChange {
  bool is_free = false;  ///< nothing where not
  double keep = 1;
  Vec3 centre = Vec3::Zero(), linear = Vec3::Zero(), spin = Vec3::Zero();
};
/// What gives each what it is short of after `steps` of `h` seconds, see keep_momentum(); what a
/// collider pushed is not free in `now`, and pieces that touch one another (State::group) are one.
std::vector<RigidChange> missing_motion(const State& s, const std::vector<Flight>& before,
                                        const std::vector<Flight>& now, int steps, float h);

/// After `steps` of `h` seconds: what is free and no collider pushed (State::pushed) gets a rigid
/// motion that gives it the momentum that gravity and damping leave of the one before. Constraints
/// change none; their rounding does, by 2 % in four seconds. What small pieces move by apart from
/// their rigid motion decays as a viscosity of 1 Pa s (liver's) would have it at their size: scraps
/// of some ten vertices that hang together by a few edges have nothing else that stops them.
void keep_momentum(State& s, const std::vector<Flight>& before, int steps, float h);

}  // namespace pbd
}  // namespace tissue_sim
