#include "mpm/substep_choice.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "tools/frame_colliders.h"

namespace tissue_sim {
namespace {

constexpr int kSteps = 8, kStepsAtCut = 4;
constexpr double kLongestAge = 0.5;      // of the measured limit [s] ...
constexpr double kFallenAge = 0.1;       // ... where it fell to less than this share: what made it
constexpr double kFall = 0.9;            // fall may have passed, or be gone with the cut
constexpr double kMostGrowth = 1.3;      // of the stiffness, until it is measured again ...
constexpr double kYoungest = 0.015;      // ... unless that is not long ago [s]
constexpr double kMargin = 0.76;         // for what stiffens within the part, and contact of faces
constexpr double kFreeMotion = 0.25;     // of a tool in a part [cells]; beyond it the margin grows
constexpr double kCalmTrend = 1.2;       // of the stiffness in a part: the next one is longer ...
constexpr double kMostTrend = 1.3;       // ... or shorter
constexpr int kShortestPart = 6;         // substeps
constexpr double kSwing = 0.06;          // [s]; where nothing damps substeps are as short as the
constexpr double kLonger = 1.1;          // shortest of one or two, until all are longer by that
constexpr double kMostAbove = 1.1;       // the first substep over what all should come to: that, or
                                         // what the trend, which is not there yet, takes from it
constexpr double kBorne = 0.9;           // of the limit at the end of a part: else it is undone ...
constexpr double kMostShortened = 0.25;  // ... and substeps made shorter by that at most ...
constexpr double kLeastShortened = 0.7;  // ... and by that at least, ...
constexpr double kShortest = 1e-3;       // ... until by that: then it is no use
constexpr float kStrained = 8;           // BlockState::wildest, from which on the margin grows
constexpr double kStrainedMargin = 0.7;  // by that, and energy is watched:
constexpr double kMostGain = 1.03;       // a part that grows it by more than was given is undone,
constexpr double kHalf = 0.5;            // and done again with substeps half as long

/// Whether something tore within the last twentieth of a second: then more may soon, in pieces that
/// nobody has measured.
bool tears(const MpmState& state) {
  return std::any_of(state.tore_at.begin(), state.tore_at.end(),
                     [&](double time) { return state.time - time < 0.05; });
}

/// Whether nothing takes energy from some of the tissue.
bool conserves_energy(const MpmState& state) {
  return state.scene.damping == 0 &&
         std::any_of(state.bodies.begin(), state.bodies.end(), [](const LatticeBody& body) {
           return std::any_of(body.materials.begin(), body.materials.end(),
                              [](const Material& m) { return m.viscosity == 0; });
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
double farthest_motion(const MpmState& state, const FrameInput& input) {
  const Scene& scene = state.scene;
  const FrameColliders colliders(scene, input, 1 / scene.frame_rate);
  const std::vector<Collider> shapes = colliders.at(1);
  const std::vector<Box> reach = colliders.reach();
  double farthest = 0;
  for (std::size_t c = 1; c < reach.size(); ++c) {  // the first is the ground
    const Tool& tool = scene.tools[shapes[c].tool];
    const ToolMotion& m = input.tools[shapes[c].tool];
    if (!m.present || !is_near(state, reach[c])) continue;
    const double length = shapes[c].length;
    const double turn = m.begin.orientation.angularDistance(m.end.orientation) +
                        0.5 * std::fabs(m.jaw_end - m.jaw_begin);
    const Vec3 step = m.end.position - m.begin.position;
    const double pushed = tool.type == ToolType::kScalpel
                              ? std::fabs(step.dot(m.begin.orientation * Vec3::UnitY()))
                              : step.norm();
    farthest = std::max(farthest, pushed + turn * length);
  }
  return farthest;
}

}  // namespace

bool SubstepChoice::is_strained(const MpmState& state) { return state.wildest > kStrained; }

bool SubstepChoice::is_borne(const MpmState& state, const std::vector<float>& modulus,
                             double cautious, double dt, const PartEnergy& energy) {
  double growth = 1;
  for (std::size_t i = 0; i < modulus.size(); ++i) {
    const float measured = state.blocks.all[i]->modulus.measured;
    // not the other way round: it may be not finite
    if (measured > 0 && !(modulus[i] <= growth * measured)) growth = modulus[i] / measured;
  }
  const double longest =
      std::isfinite(growth) ? std::max(cautious / kMargin, limit_ / std::sqrt(growth)) : 0;
  const double now = energy.kinetic + energy.elastic;
  const double explained = kMostGain * energy_ + std::max(0.0, energy.given);
  const bool grew =
      is_strained(state) && now > explained && now > explained + by_gravity(state, energy);
  if ((dt <= kBorne * longest && !grew) || shortened_ < kShortest) {
    energy_ = now;
    return true;
  }
  const double wanted = std::min(kMargin * longest / dt, grew ? kHalf : 1.0);
  shortened_ *= wanted > kMostShortened ? std::min(wanted, kLeastShortened) : kMostShortened;
  return false;
}

void SubstepChoice::follow(MpmState& state, const std::vector<float>& modulus) {
  growth_ = shortened_ = 1;
  double trend = 1;
  for (std::size_t i = 0; i < modulus.size(); ++i) {
    Block::Modulus& m = state.blocks.all[i]->modulus;
    if (m.measured > 0) growth_ = std::max(growth_, static_cast<double>(modulus[i] / m.measured));
    if (m.last > 0) trend = std::max(trend, static_cast<double>(modulus[i] / m.last));
    m.last = modulus[i];
  }
  const double frame = 1 / state.scene.frame_rate, last = state.time - followed_at_;
  if (last > 0) {
    trend_ = trend;
    part_ = trend > kMostTrend ? last / 2 : trend < kCalmTrend ? 2 * last : last;
  }
  part_ = std::min(part_, frame);
  if (state.time == 0) part_ = frame;
  followed_at_ = state.time;
}

PartSubsteps SubstepChoice::part(const MpmState& state, const FrameInput& input, double time,
                                 double longest) const {
  const double motion = farthest_motion(state, input) / state.scene.cell_size;
  const double free = kFreeMotion / (std::max(motion, kFreeMotion) * state.scene.frame_rate);
  const bool is_short = !input.cuts.empty() || shortened_ < 1;
  PartSubsteps part = substeps_for(time, longest, state.dt, most_);
  const double wanted = is_short ? 0 : std::min(part_, free);
  const int most = std::max(kShortestPart, static_cast<int>(wanted / part.last + 0.5));
  const int parts = (part.count + most - 1) / most;
  part.count = (part.count + parts - 1) / parts;
  return part;
}

void SubstepChoice::measure_if_due(MpmState& state, const MeasureLimit& measure) {
  const std::vector<Block*>& blocks = state.blocks.all;
  std::vector<std::uint8_t> to_measure(blocks.size(), 1);
  const double age = state.time - measured_at_;
  const bool just_measured = age > 0 && age < kYoungest;
  const double before = limit_;
  if (limit_ == 0 || age > longest_age_ || (growth_ > kMostGrowth && !just_measured)) {
    limit_ = measure(to_measure, kSteps);
    longest_age_ = kLongestAge;
    growth_ = 1;
    measured_at_ = state.time;
  } else {
    bool any = false;
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      to_measure[i] = blocks[i]->modulus.measured == 0;
      any = any || to_measure[i] != 0;
    }
    if (!any) return;
    limit_ = std::min(limit_, measure(to_measure, kStepsAtCut));
  }
  if (limit_ < kFall * before) longest_age_ = kFallenAge;
  if (!std::isfinite(limit_)) limit_ = 0;  // all is anchored
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    if (to_measure[i] != 0) blocks[i]->modulus.measured = blocks[i]->modulus.last;
  }
}

double SubstepChoice::longest(MpmState& state, const FrameInput& input,
                              const Stiffening& stiffening, const MeasureLimit& measure) {
  const double cautious = stable_substep(state, stiffening);
  double foreseen = longest_foreseen(state, input, stiffening, cautious, measure);
  const bool at_once = shortened_ < 1 || foreseen <= cautious;
  if (!at_once && conserves_energy(state)) foreseen = held(state.time, foreseen);
  most_ = at_once ? 0 : std::max(kMostAbove, std::sqrt(trend_)) * foreseen;
  return shortened_ * foreseen;
}

double SubstepChoice::held(double time, double foreseen) {
  if (time >= swing_end_) {
    of_last_swing_ = std::exchange(of_swing_, INFINITY);
    swing_end_ = time + kSwing;
  }
  of_swing_ = std::min(of_swing_, foreseen);
  const double shortest = std::min(of_swing_, of_last_swing_);
  if (shortest < held_ || shortest > kLonger * held_) held_ = shortest;
  return held_;
}

double SubstepChoice::longest_foreseen(MpmState& state, const FrameInput& input,
                                       const Stiffening& stiffening, double cautious,
                                       const MeasureLimit& measure) {
  if (!input.cuts.empty() || tears(state)) return cautious;
  measure_if_due(state, measure);
  if (limit_ == 0) return cautious;
  const double asked = std::min(1.0, state.scene.cfl / Scene().cfl);
  const double margin = kMargin * (is_strained(state) ? kStrainedMargin : 1);
  const double elastic = asked * margin * limit_ / std::sqrt(growth_ * trend_);
  const double chosen = viscous_substep(elastic, fastest_damping(state, stiffening));
  const double motion = farthest_motion(state, input) / state.scene.cell_size;
  const double in_part = motion * std::min(1.0, kShortestPart * chosen * state.scene.frame_rate);
  return std::max(cautious, chosen / (1 + std::max(0.0, in_part - kFreeMotion)));
}

}  // namespace tissue_sim
