#include "tissue_sim/simulation.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "frame/first_frame.h"
#include "frame/sealed_state.h"
#include "frame/state_fields.h"
#include "scene/scene_text.h"
#include "tools/instrument.h"
#include "tools/points_inside.h"
#include "tools/pose_fault.h"

namespace tissue_sim {
namespace {

void check_grip(double pressure) {
  if (pressure == 0 || (pressure >= 1 && pressure <= kMostSqueeze * 1e7)) return;
  throw std::invalid_argument("grip_pressure is " + std::to_string(pressure) +
                              ": must be from 1 to 1e7 [Pa], or 0 for the tool's own");
}

void check_field(Scene changed) {
  changed.bodies.resize(1);
  validate(changed);
}

void check_gravity(const Vec3& gravity) {
  Scene changed;
  changed.gravity = gravity;
  check_field(changed);
}

void check_damping(double damping) {
  Scene changed;
  changed.damping = damping;
  check_field(changed);
}

void check_count(const char* what, std::size_t asked, std::size_t there) {
  if (asked == 0 || asked == there) return;
  throw std::invalid_argument("the input moves " + std::to_string(asked) + " " + what +
                              "s, the scene has " + std::to_string(there));
}

void check_order(const Scene& scene, const FluidOrder& order) {
  const bool there = order.body >= 0 && order.body < static_cast<int>(scene.bodies.size());
  const std::string name =
      there ? "body '" + scene.bodies[order.body].name + "'" : "body " + std::to_string(order.body);
  if (!there || scene.bodies[order.body].filled.fluid.empty()) {
    throw std::invalid_argument(name + " is none of the scene's that are filled");
  }
  const auto check = [](const char* what, double value, double most, const char* unit) {
    if (value >= 0 && value <= most) return;
    throw std::invalid_argument(std::string(what) + " is " + text(value) +
                                ": must lie between 0 and " + text(most) + " " + unit);
  };
  check("pressure", order.pressure, 1e5, "Pa");
  check("volume", order.drain, 1, "m^3");
}

/// Of a request for one of them.
template <class T>
std::optional<T>& at(std::vector<std::optional<T>>& all, const char* what, int i,
                     std::size_t there) {
  if (i < 0 || i >= static_cast<int>(there)) {
    throw std::invalid_argument(std::string(what) + " " + std::to_string(i) +
                                " is not in the scene, which has " + std::to_string(there));
  }
  all.resize(there);
  return all[i];
}

}  // namespace

struct Simulation::State {
  Scene scene;
  std::unique_ptr<Tissue> tissue;
  std::int64_t frame = 0;
  std::vector<ToolMotion> tools;            // at rest where the last frame left them
  std::vector<Instrument> instruments;      // of each tool
  std::vector<BladePath> cuts;              // of the next frame
  std::vector<FluidOrder> fluid;            // likewise
  std::vector<const Anchor*> anchors;       // of all bodies
  std::vector<AnchorMotion> anchor_motion;  // of each; empty while none moved
  Vec3 gravity = Vec3::Zero();              // [m/s^2]
  double damping = 0;                       // [1/s]
  double wave_speed = 0;
  bool blew_up = false;

  template <class Archive>
  void each_field(Archive& archive);
  StateOrigin origin() const;
  void check(const FrameRequest& request) const;
  void take(const FrameRequest& request);
  void check_alive() const {
    if (blew_up) throw std::runtime_error("the simulation blew up and cannot go on: reset it");
  }
  FrameReport run(std::chrono::steady_clock::time_point start);
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
  state_->instruments.resize(scene.tools.size());
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

Pose Simulation::anchor(int anchor) const {
  const State& s = *state_;
  const Pose rest{s.anchors.at(anchor)->origin(), Quat::Identity()};
  return s.anchor_motion.empty() ? rest : s.anchor_motion[anchor].end;
}

double Simulation::damping() const { return state_->damping; }

void Simulation::State::check(const FrameRequest& request) const {
  check_count("tool", request.tools.size(), tools.size());
  check_count("anchor", request.anchors.size(), anchors.size());
  for (std::size_t i = 0; i < request.tools.size(); ++i) {
    if (!request.tools[i]) continue;
    check_pose(request.tools[i]->pose, "the pose of tool '" + scene.tools[i].name + "'");
    if (!std::isfinite(request.tools[i]->jaw.value_or(0))) {
      throw std::invalid_argument("the jaw angle is not finite");
    }
    check_grip(request.tools[i]->grip_pressure.value_or(0));
  }
  for (const BladePath& path : request.cuts) check_path(path);
  for (const FluidOrder& order : request.fluid) check_order(scene, order);
  for (std::size_t i = 0; i < request.anchors.size(); ++i) {
    if (!request.anchors[i]) continue;
    if (!tissue->moves_anchors()) {
      throw std::invalid_argument("anchors do not move with this method and its options");
    }
    check_pose(*request.anchors[i], "the pose of anchor '" + anchors[i]->name + "'");
  }
  if (request.gravity) check_gravity(*request.gravity);
  if (request.damping) check_damping(*request.damping);
}

void Simulation::State::take(const FrameRequest& request) {
  check(request);
  for (std::size_t i = 0; i < request.tools.size(); ++i) {
    if (request.tools[i]) instruments[i].ask(*request.tools[i]);
  }
  for (const BladePath& path : request.cuts) {
    cuts.push_back(path);
    for (Pose& pose : cuts.back().poses) normalise(pose);
  }
  fluid.insert(fluid.end(), request.fluid.begin(), request.fluid.end());
  for (std::size_t i = 0; i < request.anchors.size(); ++i) {
    if (!request.anchors[i]) continue;
    while (anchor_motion.size() < anchors.size()) {  // at rest: none ever moved
      const Pose rest{anchors[anchor_motion.size()]->origin(), Quat::Identity()};
      anchor_motion.push_back({rest, rest});
    }
    anchor_motion[i].end = *request.anchors[i];
    normalise(anchor_motion[i].end);
  }
  gravity = request.gravity.value_or(gravity);
  damping = request.damping.value_or(damping);
}

void Simulation::set_tool(int tool, const Pose& pose, double jaw) {
  FrameRequest request;
  at(request.tools, "tool", tool, state_->tools.size()) = ToolRequest{pose, jaw, false, {}};
  state_->take(request);
}

void Simulation::set_grip_pressure(int tool, double pressure) {
  std::vector<std::optional<ToolRequest>> tools;
  at(tools, "tool", tool, state_->tools.size());
  check_grip(pressure);
  state_->instruments[tool].set_grip_pressure(pressure);
}

void Simulation::cut(const BladePath& path) {
  FrameRequest request;
  request.cuts = {path};
  state_->take(request);
}

void Simulation::set_anchor(int anchor, const Pose& pose) {
  FrameRequest request;
  at(request.anchors, "anchor", anchor, state_->anchors.size()) = pose;
  state_->take(request);
}

void Simulation::fill(int body, double pressure) {
  FrameRequest request;
  request.fluid = {{body, pressure, 0}};
  state_->take(request);
}

void Simulation::drain(int body, double volume) {
  FrameRequest request;
  request.fluid = {{body, 0, volume}};
  state_->take(request);
}

void Simulation::set_gravity(const Vec3& gravity) {
  FrameRequest request;
  request.gravity = gravity;
  state_->take(request);
}

void Simulation::set_damping(double damping) {
  FrameRequest request;
  request.damping = damping;
  state_->take(request);
}

template <class Archive>
void Simulation::State::each_field(Archive& archive) {
  archive(frame, tools, cuts, fluid, instruments, anchor_motion, gravity, damping, blew_up);
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

FrameReport Simulation::advance_frame(const FrameRequest& request) {
  State& s = *state_;
  s.check_alive();
  const auto start = std::chrono::steady_clock::now();
  s.take(request);
  std::vector<std::string> notes;
  for (std::size_t i = 0; i < s.tools.size(); ++i) {
    std::string note = s.instruments[i].move(s.scene.tools[i], 1 / s.scene.frame_rate,
                                             s.scene.cell_size, *s.tissue, s.tools[i]);
    if (!note.empty()) notes.push_back(std::move(note));
  }
  FrameReport report = s.run(start);
  report.notes = std::move(notes);
  return report;
}

FrameReport Simulation::repeat_frame(const AppliedInput& input) {
  State& s = *state_;
  s.check_alive();
  const auto start = std::chrono::steady_clock::now();
  if (input.tools.size() != s.tools.size()) {
    throw std::invalid_argument("the input moves " + std::to_string(input.tools.size()) +
                                " tools, the scene has " + std::to_string(s.tools.size()));
  }
  check_count("grip_pressures of tool", input.grip_pressures.size(), input.tools.size());
  for (const ToolMotion& m : input.tools) {
    if (!m.present) continue;
    check_pose(m.begin, "a tool's pose");
    check_pose(m.end, "a tool's pose");
  }
  for (const double pressure : input.grip_pressures) check_grip(pressure);
  FrameRequest rest;
  rest.cuts = input.cuts;
  rest.fluid = input.fluid;
  for (const AnchorMotion& m : input.anchors) {
    check_pose(m.begin, "an anchor's pose");
    rest.anchors.emplace_back(m.end);
  }
  rest.gravity = input.gravity;
  rest.damping = input.damping;
  s.check(rest);
  s.tools = input.tools;
  for (std::size_t i = 0; i < s.tools.size(); ++i) {
    s.instruments[i].put(s.tools[i], input.grip_pressures.empty() ? 0 : input.grip_pressures[i]);
  }
  s.cuts = input.cuts;
  s.fluid = input.fluid;
  if (!input.anchors.empty()) s.anchor_motion = input.anchors;
  s.gravity = input.gravity.value_or(s.gravity);
  s.damping = input.damping.value_or(s.damping);
  return s.run(start);
}

FrameReport Simulation::State::run(std::chrono::steady_clock::time_point start) {
  FrameReport report;
  for (std::size_t i = 0; i < tools.size(); ++i) {
    report.input.grip_pressures.push_back(
        instruments[i].limit_jaws(scene.tools[i], 1 / scene.frame_rate, tools[i]));
  }
  report.input.frame = frame;
  report.input.tools = tools;
  report.input.cuts = std::exchange(cuts, {});
  report.input.fluid = std::exchange(fluid, {});
  report.input.anchors = anchor_motion;
  report.input.gravity = gravity;
  report.input.damping = damping;
  tissue->advance(1.0 / scene.frame_rate,
                  {report.input.tools, report.input.cuts, report.input.anchors,
                   &*report.input.gravity, &*report.input.damping, report.input.fluid});
  report.result = tissue->finish();
  sum_inside(report.result);
  report.cfl = report.result.substep * wave_speed / scene.cell_size;
  for (std::size_t i = 0; i < tools.size(); ++i) {
    instruments[i].follow(tools[i], report.result.loads[i]);
  }
  blew_up = report.result.blew_up;
  for (ToolMotion& m : tools) {
    m.begin = m.end;
    m.jaw_begin = m.jaw_end;
  }
  for (AnchorMotion& m : anchor_motion) m.begin = m.end;
  ++frame;
  report.compute_time =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

SettleReport Simulation::settle(const SettleLimits& limits) {
  Settling settling(*this, limits);
  try {
    while (!settling.is_over(advance_frame())) {
    }
  } catch (...) {
    settling.end(*this);
    throw;
  }
  return settling.end(*this);
}

Settling::Settling(Simulation& simulation, const SettleLimits& limits)
    : limits_(limits),
      damping_(simulation.damping()),
      frame_rate_(simulation.scene().frame_rate),
      speeds_(static_cast<std::size_t>(std::max(1.0, std::ceil(0.1 * frame_rate_))),
              std::numeric_limits<double>::infinity()) {
  if (limits.damping >= 0) simulation.set_damping(limits.damping);
}

int Settling::most_frames() const {
  return static_cast<int>(std::max(1.0, std::ceil(limits_.time * frame_rate_)));
}

bool Settling::is_over(const FrameReport& frame) {
  if (frame.result.blew_up) return true;
  speeds_[frames_++ % speeds_.size()] = frame.result.max_speed;
  return fastest() < limits_.speed || frames_ >= most_frames();
}

SettleReport Settling::end(Simulation& simulation) const {
  if (limits_.damping >= 0) simulation.set_damping(damping_);
  return {fastest() < limits_.speed, frames_ / frame_rate_, fastest()};
}

double Settling::fastest() const { return *std::max_element(speeds_.begin(), speeds_.end()); }

}  // namespace tissue_sim
