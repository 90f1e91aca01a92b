#include "tissue_sim/simulation.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "cutting/check_path.h"
#include "frame/first_frame.h"
#include "frame/sealed_state.h"
#include "frame/state_fields.h"
#include "tools/grip.h"
#include "tools/points_inside.h"

namespace tissue_sim {
namespace {

void check_grip(double pressure) {
  if (pressure == 0 || (pressure >= 1 && pressure <= kMostSqueeze * 1e7)) return;
  throw std::invalid_argument("grip_pressure is " + std::to_string(pressure) +
                              ": must be from 1 to 1e7 [Pa], or 0 for the tool's own");
}

}  // namespace

struct Simulation::State {
  Scene scene;
  std::unique_ptr<Tissue> tissue;
  std::int64_t frame = 0;
  std::vector<ToolMotion> tools;  // as they stand after the last frame, then as set for the next
  std::vector<BladePath> cuts;
  std::vector<Grip> grips;                  // of each tool
  std::vector<double> grip_pressures;       // of each tool, 0 for the scene's [Pa]
  std::vector<const Anchor*> anchors;       // of all bodies
  std::vector<AnchorMotion> anchor_motion;  // of each; empty while none moved
  Vec3 gravity = Vec3::Zero();              // as of the next frame [m/s^2]
  double damping = 0;                       // the same [1/s]
  double wave_speed = 0;
  bool blew_up = false;

  template <class Archive>
  void each_field(Archive& archive);
  StateOrigin origin() const;
};

Simulation::Simulation(const Scene& scene) : state_(std::make_unique<State>()) {
  validate(scene);
  check_first_frame(scene);
  state_->scene = scene;
  state_->tissue = make_tissue(scene);
  if (scene.ground.enabled) {
    check_ground(scene, state_->tissue->fragments());
    check_held(scene, *state_->tissue);
  }
  state_->tools.resize(scene.tools.size());
  state_->grips.resize(scene.tools.size());
  state_->grip_pressures.resize(scene.tools.size());
  for (const Body& b : state_->scene.bodies) {
    for (const Anchor& anchor : b.anchors) state_->anchors.push_back(&anchor);
  }
  state_->gravity = scene.gravity;
  state_->damping = scene.damping;
  const auto note_speed = [this, &scene](const std::string& material) {
    state_->wave_speed =
        std::max(state_->wave_speed, tissue_sim::wave_speed(find_material(scene, material)));
  };
  for (const Body& b : scene.bodies) {
    note_speed(b.material);
    for (const Inclusion& i : b.inclusions) note_speed(i.material);
  }
}

Simulation::~Simulation() = default;

const Scene& Simulation::scene() const { return state_->scene; }
Tissue& Simulation::tissue() { return *state_->tissue; }
std::int64_t Simulation::frame() const { return state_->frame; }
const std::vector<ToolMotion>& Simulation::tools() const { return state_->tools; }
double Simulation::time() const { return state_->frame / state_->scene.frame_rate; }

void Simulation::set_tool(int tool, const Pose& pose, double jaw) {
  if (tool < 0 || tool >= static_cast<int>(state_->tools.size())) {
    throw std::invalid_argument("tool " + std::to_string(tool) +
                                " is not in the scene, which has " +
                                std::to_string(state_->tools.size()));
  }
  check_pose(pose, "the pose of tool '" + state_->scene.tools[tool].name + "'");
  if (!std::isfinite(jaw)) throw std::invalid_argument("the jaw angle is not finite");
  ToolMotion& m = state_->tools[tool];
  m.end = {pose.position, pose.orientation.normalized()};
  m.jaw_end = static_cast<float>(jaw);
  if (!m.present) {
    m.begin = m.end;
    m.jaw_begin = m.jaw_end;
    m.present = true;
  }
}

void Simulation::set_grip_pressure(int tool, double pressure) {
  if (tool < 0 || tool >= static_cast<int>(state_->tools.size())) {
    throw std::invalid_argument("tool " + std::to_string(tool) + " is not in the scene");
  }
  check_grip(pressure);
  state_->grip_pressures[tool] = pressure;
}

void Simulation::cut(const BladePath& path) {
  check_path(path);
  state_->cuts.push_back(path);
  for (Pose& pose : state_->cuts.back().poses) pose.orientation.normalize();
}

void Simulation::set_anchor(int anchor, const Pose& pose) {
  State& s = *state_;
  if (anchor < 0 || anchor >= static_cast<int>(s.anchors.size())) {
    throw std::invalid_argument("anchor " + std::to_string(anchor) +
                                " is not in the scene, which has " +
                                std::to_string(s.anchors.size()));
  }
  if (!s.tissue->moves_anchors()) {
    throw std::invalid_argument(
        "anchors do not move with this method: they do with method mls, and with method mpm unless "
        "mpm.boundary is lattice");
  }
  check_pose(pose, "the pose of anchor '" + s.anchors[anchor]->name + "'");
  if (s.anchor_motion.empty()) {
    for (const Anchor* a : s.anchors) {
      const Pose rest{a->origin(), Quat::Identity()};
      s.anchor_motion.push_back({rest, rest});
    }
  }
  s.anchor_motion[anchor].end = {pose.position, pose.orientation.normalized()};
}

Pose Simulation::anchor(int anchor) const {
  const State& s = *state_;
  const Pose rest{s.anchors.at(anchor)->origin(), Quat::Identity()};
  return s.anchor_motion.empty() ? rest : s.anchor_motion[anchor].end;
}

void Simulation::set_gravity(const Vec3& gravity) {
  Scene changed;
  changed.bodies.resize(1);
  changed.gravity = gravity;
  validate(changed);
  state_->gravity = gravity;
}

double Simulation::damping() const { return state_->damping; }

void Simulation::set_damping(double damping) {
  Scene changed;
  changed.bodies.resize(1);
  changed.damping = damping;
  validate(changed);
  state_->damping = damping;
}

void Simulation::apply(const AppliedInput& input) {
  if (input.tools.size() != state_->tools.size()) {
    throw std::invalid_argument("the input moves " + std::to_string(input.tools.size()) +
                                " tools, the scene has " + std::to_string(state_->tools.size()));
  }
  for (const ToolMotion& m : input.tools) {
    if (!m.present) continue;
    check_pose(m.begin, "a tool's pose");
    check_pose(m.end, "a tool's pose");
  }
  for (const BladePath& path : input.cuts) check_path(path);
  state_->tools = input.tools;
  if (!input.grip_pressures.empty() && input.grip_pressures.size() != input.tools.size()) {
    throw std::invalid_argument("grip_pressures has " +
                                std::to_string(input.grip_pressures.size()) + " values for " +
                                std::to_string(input.tools.size()) + " tools");
  }
  for (const double pressure : input.grip_pressures) check_grip(pressure);
  state_->grip_pressures = input.grip_pressures;
  state_->grip_pressures.resize(input.tools.size());
  state_->cuts = input.cuts;
  if (!input.anchors.empty() && input.anchors.size() != state_->anchors.size()) {
    throw std::invalid_argument("the input moves " + std::to_string(input.anchors.size()) +
                                " anchors, the scene has " +
                                std::to_string(state_->anchors.size()));
  }
  if (!input.anchors.empty() && !state_->tissue->moves_anchors()) {
    throw std::invalid_argument("the input moves anchors, which this method and device do not");
  }
  for (const AnchorMotion& m : input.anchors) {
    check_pose(m.begin, "an anchor's pose");
    check_pose(m.end, "an anchor's pose");
  }
  if (input.gravity) set_gravity(*input.gravity);
  if (input.damping) set_damping(*input.damping);
  if (!input.anchors.empty()) state_->anchor_motion = input.anchors;
}

template <class Archive>
void Simulation::State::each_field(Archive& archive) {
  archive(frame, tools, cuts, grips, grip_pressures, anchor_motion, gravity, damping, blew_up);
}

StateOrigin Simulation::State::origin() const {
  Scene same = scene;  // but for what does not change a bit
  same.threads = 0;
  same.device = Device::kAuto;
  std::string device = tissue->device_name();
  // Another model of GPU divides tissue otherwise.
  if (device.compare(0, 4, "cuda") != 0) device.resize(std::min(device.size(), device.find(' ')));
  return {scene_to_yaml(same), device};
}

std::vector<std::uint8_t> Simulation::save() {
  ArchiveWriter out;
  std::uint64_t checksum = state_->tissue->checksum();
  std::vector<std::uint8_t> tissue = state_->tissue->save();
  state_->each_field(out);
  out(checksum, tissue);
  return seal_state(state_->origin(), out.bytes());
}

void Simulation::restore(Span<const std::uint8_t> saved) {
  if (state_->frame != 0) throw std::runtime_error("only a new simulation can be restored");
  ArchiveReader in(open_state(saved, state_->origin()));
  std::uint64_t checksum = 0;
  std::vector<std::uint8_t> tissue;
  state_->each_field(in);
  in(checksum, tissue);
  state_->tissue->restore({tissue.data(), tissue.size()});
  if (state_->tissue->checksum() != checksum) {
    throw std::runtime_error(
        "the state cannot be restored: what was read of it has another checksum, so another build "
        "wrote it");
  }
}

FrameReport Simulation::advance_frame() {
  State& s = *state_;
  if (s.blew_up) {
    throw std::runtime_error("the simulation blew up and cannot go on: reset it");
  }
  const auto start = std::chrono::steady_clock::now();
  FrameReport report;
  report.input.grip_pressures.resize(s.tools.size());
  for (std::size_t i = 0; i < s.tools.size(); ++i) {
    const Tool& tool = s.scene.tools[i];
    if (tool.type != ToolType::kGrasper) continue;
    const double set = s.grip_pressures[i] > 0 ? s.grip_pressures[i] : tool.grip_pressure;
    // Said as it comes out: a replay gets the jaws no longer as they were asked for.
    report.input.grip_pressures[i] = squeezed(set, s.tools[i].jaw_end);
    s.grips[i].limit(report.input.grip_pressures[i], 1 / s.scene.frame_rate, s.tools[i]);
  }
  report.input.frame = s.frame;
  report.input.tools = s.tools;
  report.input.cuts = std::exchange(s.cuts, {});
  report.input.anchors = s.anchor_motion;
  report.input.gravity = s.gravity;
  report.input.damping = s.damping;
  s.tissue->advance(1.0 / s.scene.frame_rate,
                    {report.input.tools, report.input.cuts, report.input.anchors,
                     &*report.input.gravity, &*report.input.damping});
  report.result = s.tissue->finish();
  sum_inside(report.result);
  report.cfl = report.result.substep * s.wave_speed / s.scene.cell_size;
  for (std::size_t i = 0; i < s.tools.size(); ++i) {
    const ToolLoad& load = report.result.loads[i];
    s.grips[i].follow(s.tools[i], load.grip_area > 0 ? load.grip / load.grip_area : 0);
  }
  s.blew_up = report.result.blew_up;
  for (ToolMotion& m : s.tools) {
    m.begin = m.end;
    m.jaw_begin = m.jaw_end;
  }
  for (AnchorMotion& m : s.anchor_motion) m.begin = m.end;
  ++s.frame;
  report.compute_time =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

SettleReport Simulation::settle(const SettleLimits& limits) {
  State& s = *state_;
  const double damping = s.damping;
  if (limits.damping >= 0) set_damping(limits.damping);
  const int window = std::max(1, static_cast<int>(std::ceil(0.1 * s.scene.frame_rate)));
  const auto most = static_cast<std::int64_t>(std::ceil(limits.time * s.scene.frame_rate));
  SettleReport report;
  std::vector<double> speeds(window, std::numeric_limits<double>::infinity());
  std::int64_t frames = 0;
  try {
    while (!report.at_rest && frames < most) {
      const FrameReport frame = advance_frame();
      if (frame.result.blew_up) break;
      speeds[frames++ % window] = frame.result.max_speed;
      report.speed = *std::max_element(speeds.begin(), speeds.end());
      report.at_rest = report.speed < limits.speed;
    }
  } catch (...) {
    s.damping = damping;
    throw;
  }
  s.damping = damping;
  report.time = frames / s.scene.frame_rate;
  return report;
}

}  // namespace tissue_sim
