#include "pbd/pbd_tissue.h"

#include <algorithm>
#include <cmath>

#include "frame/checksum.h"
#include "frame/out_of_control.h"
#include "pbd/cut.h"
#include "pbd/find_touches.h"
#include "pbd/free_flight.h"
#include "pbd/model.h"
#include "pbd/sound_cut.h"
#include "pbd/tear.h"
#include "pbd/viscosity.h"
#include "tissue_sim/limits.h"
#include "tools/frame_colliders.h"
#include "tools/tool_motion.h"

namespace tissue_sim {

PbdTissue::PbdTissue(const Scene& scene, std::vector<std::string> notes)
    : notes_(std::move(notes)), state_(pbd::make_state(scene, &notes_)) {
  pieces_ = pbd::whole_pieces(*state_);
  next_stroke_ = static_cast<int>(scene.tools.size());
}

std::vector<Vec3> PbdTissue::places() const {
  const pbd::Vertices& v = state_->vertices;
  std::vector<Vec3> x;
  for (int i = 0; i < v.size(); ++i) x.push_back(v.position(i));
  return x;
}

bool PbdTissue::cut(const BladePath& path, int stroke, const std::vector<Vec3>& before,
                    CutReport& report) {
  pbd::State& s = *state_;
  std::vector<std::int32_t> origin;
  const bool is_whole = stroke >= static_cast<int>(s.scene.tools.size());  // no instrument's
  if (s.tetrahedra.empty()) {
    if (!pbd::cut_soundly(s, path, before, stroke, origin, report)) return false;
  } else {
    if (!pbd::cut_tetrahedra(s, path, before, is_whole, origin, report)) return false;
    pbd::after_cut(s, origin);
  }
  for (const int id : pbd::update_pieces(s, origin, pieces_)) report.new_fragments.push_back(id);
  return true;
}

void PbdTissue::advance(double duration, const FrameInput& input) {
  pbd::State& s = *state_;
  follow(input, s.scene);
  const int substeps = pbd::steps_of(s, duration);
  const float dt = static_cast<float>(duration / substeps);
  result_ = {};
  result_.loads.resize(s.scene.tools.size());
  bool changed = false;
  std::vector<pbd::Motion> motions;
  if (!input.cuts.empty()) {
    pull();
    motions = pbd::motions(s);
  }
  for (const BladePath& path : input.cuts) {
    result_.cut_reports.emplace_back();
    const std::vector<Vec3> still = places();
    changed = cut(path, next_stroke_++, still, result_.cut_reports.back()) || changed;
  }
  if (changed) {
    pbd::after_cuts(s, motions);
    state_changed();
  }
  const FrameColliders colliders(s.scene, input, duration);
  std::vector<int> strokes;  // by tool
  const std::vector<BladePath> blades = blade_paths(s.scene, input, 0, 1, &strokes);
  std::vector<Vec3> before;
  if (!blades.empty()) {
    pull();
    before = places();
  }
  if (!input.anchors.empty() && !s.held.empty()) {
    pull();
    if (pbd::follow_anchors(s, input.anchors, duration)) push();
  }
  const bool tears = pbd::can_tear(s);
  int together = steps_between_searches(colliders, substeps, dt);
  if (tears) {
    const int checks = std::min(substeps, pbd::tear_checks(s, duration));
    together = std::min(together, (substeps + checks - 1) / checks);
  }
  for (int first = 0; first < substeps; first += together) {
    const int steps = std::min(together, substeps - first);
    run_steps(colliders, {first, steps, substeps}, dt);
    if (tears) tear(steps * dt);
  }
  if (!s.held.empty()) pull();
  result_.anchor_loads = pbd::anchor_loads(s, input.anchors, dt);
  result_.substeps = substeps;
  result_.substep = dt;
  if (blades.empty()) return;
  pull();
  motions = pbd::motions(s);
  changed = false;
  for (std::size_t i = 0; i < blades.size(); ++i) {
    changed = cut(blades[i], strokes[i], before, result_.blade_report) || changed;
  }
  if (changed) {
    pbd::after_cuts(s, motions);
    state_changed();
  }
}

void PbdTissue::tear(double since) {
  pbd::State& s = *state_;
  pull();
  const std::vector<pbd::Motion> motions = pbd::motions(s);
  std::vector<std::int32_t> origin;
  if (!pbd::tear_tetrahedra(s, since, origin, result_.tear_report)) return;
  pbd::after_cut(s, origin);
  for (const int id : pbd::update_pieces(s, origin, pieces_)) {
    result_.tear_report.new_fragments.push_back(id);
  }
  pbd::after_cuts(s, motions);
  state_changed();
}

int PbdTissue::steps_between_searches(const FrameColliders& colliders, int steps, float h) {
  if (state_->components < 2) return steps;
  pull();
  double struck = 0;
  for (const Collider& c : colliders.at_end()) {
    if (c.tool >= 0 && c.kind != Collider::kBlade) struck = std::max(struck, speed(c));
  }
  const double searches = pbd::searches_of(*state_, struck, steps * h);
  return searches < steps ? static_cast<int>(std::ceil(steps / searches)) : 1;
}

std::vector<pbd::TipSweep> PbdTissue::sweeps_of_tips(const FrameColliders& colliders,
                                                     const Part& part) {
  std::vector<Collider> begin, end;
  colliders.at(part.share(-1), begin);
  colliders.at(part.share(part.count - 1), end);
  return pbd::sweeps_of_tips(begin, end);
}

void PbdTissue::run_steps(const FrameColliders& colliders, const Part& part, float h) {
  pbd::State& s = *state_;
  pbd::find_touches(s, part.count * h);
  const std::vector<pbd::Flight> flights = pbd::flights(s);
  std::fill(s.pushed.begin(), s.pushed.end(), std::uint8_t{0});
  pbd::find_at_tips(s, sweeps_of_tips(colliders, part), part.count * h);
  for (int i = 0; i < part.count; ++i) {
    stop_if_asked();
    colliders.at(part.share(i), s.colliders);
    std::vector<ColliderLoad> loads(s.colliders.size());
    pbd::step(s, h, loads);
    colliders.add_loads(part.share(i), s.colliders.data(), loads.data(), 1.0 / part.of,
                        result_.loads);
  }
  pbd::keep_momentum(s, flights, part.count, h);
  pbd::damp_neighbours(s, part.count * h);
}

PbdTissue::Figures PbdTissue::measure() {
  const pbd::Vertices& v = state_->vertices;
  Figures sum;
  for (int i = 0; i < v.size(); ++i) {
    const double speed2 = v.velocity(i).squaredNorm();
    if (!(speed2 <= sum.speed2)) sum.speed2 = speed2;
    sum.kinetic += 0.5 * v.mass[i] * speed2;
    sum.finite = sum.finite && v.position(i).allFinite();
  }
  sum.elastic = pbd::elastic_energy(*state_);
  return sum;
}

FrameResult PbdTissue::finish() {
  const Figures sum = measure();
  result_.kinetic_energy = sum.kinetic;
  result_.elastic_energy = sum.elastic;
  result_.max_speed = std::sqrt(sum.speed2);
  result_.blew_up = result_.blew_up || !sum.finite || is_out_of_control(result_);
  pieces_measured_ = false;
  return result_;
}

Span<const Fragment> PbdTissue::fragments() {
  if (!pieces_measured_) {
    pull();
    pbd::measure_pieces(*state_, pieces_);
    pieces_measured_ = true;
  }
  return pieces_.all;
}

Momentum PbdTissue::momentum() {
  pull();
  const pbd::Vertices& v = state_->vertices;
  Momentum m;
  for (int i = 0; i < v.size(); ++i) {
    m.mass += v.mass[i];
    m.centre += v.mass[i] * v.position(i);
    m.linear += v.mass[i] * v.velocity(i);
  }
  m.centre /= m.mass;
  for (int i = 0; i < v.size(); ++i) {
    m.angular += v.mass[i] * (v.position(i) - m.centre).cross(v.velocity(i));
  }
  return m;
}

std::uint64_t PbdTissue::checksum() {
  pull();
  const pbd::State& s = *state_;
  Checksum sum;
  sum.add(s.vertices.x);
  sum.add(s.vertices.v);
  sum.add(pieces_.of_point);
  std::vector<std::int32_t> joined;
  for (const pbd::InternalPair& p : s.internal) joined.insert(joined.end(), {p.a, p.b});
  for (const pbd::Triangle& t : s.triangles) joined.insert(joined.end(), t.begin(), t.end());
  for (const pbd::Tetrahedron& t : s.tetrahedra) joined.insert(joined.end(), t.begin(), t.end());
  sum.add(joined);
  return sum.value();
}

std::string PbdTissue::device_name() const {
  return std::string("cpu (") + name(state_->instructions) + ", " +
         std::to_string(state_->cpu.threads()) + " threads)";
}

}  // namespace tissue_sim
