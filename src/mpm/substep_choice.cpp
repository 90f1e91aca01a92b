#include "mpm/substep_choice.h"

#include <algorithm>
#include <cmath>

#include "contact/frame_colliders.h"

namespace tissue_sim {
namespace {

constexpr int kSteps = 12, kStepsAtCut = 4;
constexpr int kLongestAge = 30;       // frames
constexpr double kMostGrowth = 1.3;   // of the stiffness, until it is measured again
constexpr double kMargin = 0.6;       // for springs of contact, and what stiffens within the frame
constexpr double kFreeMotion = 0.25;  // of a tool in a frame [cells]; beyond it the margin grows

/// Whether something tore within the last twentieth of a second: then more may soon, in pieces that
/// nobody has measured.
bool tears(const MpmState& state) {
  return std::any_of(state.tore_at.begin(), state.tore_at.end(),
                     [&](double time) { return state.time - time < 0.05; });
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
  const std::vector<Box> reach = collider_reach(scene, input, 1 / scene.frame_rate);
  double farthest = 0;
  for (std::size_t i = 0; i < input.tools.size(); ++i) {
    const ToolMotion& m = input.tools[i];
    if (!m.present || !is_near(state, reach[1 + i])) continue;  // reach[0] is the ground
    const Tool& tool = scene.tools[i];
    const double length = tool.type == ToolType::kProbe ? tool.length : tool.blade_length;
    const double turn = m.begin.orientation.angularDistance(m.end.orientation);
    const Vec3 step = m.end.position - m.begin.position;
    const double pushed = tool.type == ToolType::kScalpel
                              ? std::fabs(step.dot(m.begin.orientation * Vec3::UnitY()))
                              : step.norm();
    farthest = std::max(farthest, pushed + turn * length);
  }
  return farthest;
}

}  // namespace

void SubstepChoice::follow(MpmState& state, const std::vector<float>& modulus) {
  growth_ = trend_ = 1;
  ++age_;
  for (std::size_t i = 0; i < modulus.size(); ++i) {
    Block::Modulus& m = state.blocks.all[i]->modulus;
    if (m.measured > 0) growth_ = std::max(growth_, static_cast<double>(modulus[i] / m.measured));
    if (m.last > 0) trend_ = std::max(trend_, static_cast<double>(modulus[i] / m.last));
    m.last = modulus[i];
  }
}

void SubstepChoice::measure_if_due(MpmState& state, const MeasureLimit& measure) {
  const std::vector<Block*>& blocks = state.blocks.all;
  std::vector<std::uint8_t> to_measure(blocks.size(), 1);
  if (limit_ == 0 || age_ >= kLongestAge || growth_ > kMostGrowth) {
    limit_ = measure(to_measure, kSteps);
    growth_ = 1;
    age_ = 0;
  } else {
    bool any = false;
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      to_measure[i] = blocks[i]->modulus.measured == 0;
      any = any || to_measure[i] != 0;
    }
    if (!any) return;
    limit_ = std::min(limit_, measure(to_measure, kStepsAtCut));
  }
  if (!std::isfinite(limit_)) limit_ = 0;  // all is anchored
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    if (to_measure[i] != 0) blocks[i]->modulus.measured = blocks[i]->modulus.last;
  }
}

double SubstepChoice::longest(MpmState& state, const FrameInput& input,
                              const Stiffening& stiffening, const MeasureLimit& measure) {
  const double cautious = stable_substep(state, stiffening);
  if (!input.cuts.empty() || tears(state)) return cautious;
  measure_if_due(state, measure);
  if (limit_ == 0) return cautious;
  const double motion = farthest_motion(state, input) / state.scene.cell_size;
  const double margin = kMargin / (1 + std::max(0.0, motion - kFreeMotion));
  const double asked = std::min(1.0, state.scene.cfl / Scene().cfl);
  const double elastic = asked * margin * limit_ / std::sqrt(growth_ * trend_);
  return std::max(cautious, viscous_substep(elastic, slowest_relaxation(state, stiffening)));
}

}  // namespace tissue_sim
