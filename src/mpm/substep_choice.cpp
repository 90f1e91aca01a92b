#include "mpm/substep_choice.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "tools/frame_colliders.h"

namespace tissue_sim {
namespace {

constexpr double kFreeMotion = 0.25;  // of a tool in a part [cells]; beyond it the margin grows
constexpr float kStrained = 8;  // BlockState::worst_stiffening, from which on the margin grows
constexpr double kStrainedMargin = 0.7;  // by that, and energy is watched

std::vector<Stiffness*> stiffness_of(const MpmState& state) {
  std::vector<Stiffness*> all;
  for (Block* block : state.blocks.all) all.push_back(&block->modulus);
  return all;
}

/// Whether something tore within the last twentieth of a second: then more may soon, in pieces that
/// nobody has measured.
bool tears(const MpmState& state) {
  return std::any_of(state.tore_at.begin(), state.tore_at.end(),
                     [&](double time) { return state.time - time < 0.05; });
}

/// Whether nothing takes energy from some of the tissue.
bool conserves_energy(const MpmState& state) {
  return std::any_of(state.bodies.begin(), state.bodies.end(), [&](const LatticeBody& body) {
    return conserves_energy(state.scene.damping, body.materials);
  });
}

/// What gravity may have done in a part, at the most [J].
double by_gravity(const MpmState& state, const PartEnergy& e) {
  const double mass = std::accumulate(state.nodes.mass.begin(), state.nodes.mass.end(), 0.0);
  return state.scene.gravity.norm() * e.time * std::sqrt(2 * mass * e.kinetic);
}

/// Whether tissue is within two cells of a box.
bool is_near(const MpmState& state, const Box& box) {
  const double margin = 2 * state.scene.cell_size;
  return std::any_of(state.motion.begin(), state.motion.end(), [&](const BlockMotion& m) {
    return (m.box.min.array() <= box.max.array() + margin).all() &&
           (box.min.array() <= m.box.max.array() + margin).all();
  });
}

/// How far a tool that is near tissue goes in the frame at most, with both ends, where it pushes
/// [m]: a blade cuts its way along its plane.
double farthest_motion(const MpmState& state, const FrameInput& input,
                       const FrameColliders& colliders) {
  const std::vector<Collider>& shapes = colliders.at_end();
  const std::vector<Box>& reach = colliders.reach();
  double farthest = 0;
  for (std::size_t c = 1; c < reach.size(); ++c) {  // the first is the ground
    const ToolMotion& m = input.tools[shapes[c].tool];
    if (!m.present || !is_near(state, reach[c])) continue;
    const double length = shapes[c].length;
    const bool is_blade = shapes[c].kind == Collider::kBlade;
    const double turn = m.begin.orientation.angularDistance(m.end.orientation) +
                        (is_blade ? 0 : 0.5 * std::fabs(m.jaw_end - m.jaw_begin));
    const Vec3 step = m.end.position - m.begin.position;
    const double pushed =
        is_blade ? std::fabs(step.dot(m.begin.orientation * Vec3::UnitY())) : step.norm();
    farthest = std::max(farthest, pushed + turn * length);
  }
  return farthest;
}

bool is_strained(const MpmState& state) { return state.worst_stiffening > kStrained; }

}  // namespace

bool SubstepChoice::is_watched(const MpmState& state) {
  // What moving anchors give is not reckoned.
  return is_strained(state) || (!state.debris.empty() && !state.anchors.moves);
}

bool SubstepChoice::is_borne(const MpmState& state, const std::vector<float>& modulus,
                             double cautious, double dt, const PartEnergy& energy) {
  const double measured = limit_.at(stiffness_of(state), modulus);
  const double limit = std::isnan(measured) ? 0 : std::max(cautious / kStabilityMargin, measured);
  return acceptance_.accepts(dt, limit, energy, is_watched(state),
                             [&] { return by_gravity(state, energy); });
}

void SubstepChoice::follow(MpmState& state, const std::vector<float>& modulus) {
  acceptance_.restart();
  const double passed = limit_.follow(stiffness_of(state), modulus, state.time);
  length_.follow(passed, limit_.trend(), 1 / state.scene.frame_rate);
}

PartSubsteps SubstepChoice::part(const MpmState& state, const FrameInput& input,
                                 const FrameColliders& colliders, double time,
                                 double longest) const {
  const double motion = farthest_motion(state, input, colliders) / state.scene.cell_size;
  const double free = kFreeMotion / (std::max(motion, kFreeMotion) * state.scene.frame_rate);
  const bool is_short = !input.cuts.empty() || acceptance_.shortened() < 1;
  return length_.part(time, longest, state.dt, is_short ? 0 : free);
}

double SubstepChoice::longest(MpmState& state, const FrameInput& input,
                              const FrameColliders& colliders, const Stiffening& stiffening,
                              const MeasureLimit& measure) {
  const double cautious = stable_substep(state, stiffening);
  const double predicted =
      longest_predicted(state, input, colliders, stiffening, cautious, measure);
  const double shortened = acceptance_.shortened();
  const bool at_once = shortened < 1 || predicted <= cautious;
  return shortened *
         length_.choose(state.time, predicted, limit_.trend(), at_once, conserves_energy(state));
}

double SubstepChoice::longest_predicted(MpmState& state, const FrameInput& input,
                                        const FrameColliders& colliders,
                                        const Stiffening& stiffening, double cautious,
                                        const MeasureLimit& measure) {
  if (!input.cuts.empty() || tears(state)) return cautious;
  limit_.measure_if_due(stiffness_of(state), state.time, measure);
  if (!limit_.known()) return cautious;
  const double asked = std::min(1.0, state.scene.cfl / Scene().cfl);
  const double margin = kStabilityMargin * (is_strained(state) ? kStrainedMargin : 1);
  const double elastic = asked * margin * limit_.predicted();
  const double chosen = viscous_substep(elastic, fastest_damping(state, stiffening));
  const double motion = farthest_motion(state, input, colliders) / state.scene.cell_size;
  const double in_part = motion * std::min(1.0, kShortestPart * chosen * state.scene.frame_rate);
  return std::max(cautious, chosen / (1 + std::max(0.0, in_part - kFreeMotion)));
}

}  // namespace tissue_sim
