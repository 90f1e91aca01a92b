#include "mpm/mpm_tissue.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "contact/block_contact.h"
#include "contact/frame_colliders.h"
#include "cutting/cut_tissue.h"
#include "cutting/tear.h"
#include "fragments/piece_motion.h"
#include "mpm/lanczos.h"
#include "mpm/linearised_motion.h"
#include "tools/tool_motion.h"

namespace tissue_sim {

MpmTissue::MpmTissue(const Scene& scene, std::vector<std::string> notes)
    : notes_(std::move(notes)),
      state_(make_mpm_state(scene, &notes_)),
      pieces_(whole_pieces(state_->bodies, state_->points)) {
  measure_motion(*state_);
  measure();
  measure_pieces(*state_, pieces_);
}

float MpmTissue::stable_substep() const { return tissue_sim::stable_substep(*state_, stiffening_); }

float MpmTissue::substep_for(const FrameInput& input) {
  const auto measure = [this](const std::vector<std::uint8_t>& blocks, int steps) {
    LinearisedMotion motion(*state_, blocks);
    return 2 / std::sqrt(largest_eigenvalue(motion, steps));
  };
  return static_cast<float>(substep_.longest(*state_, input, stiffening_, measure));
}

void MpmTissue::cut(const std::vector<BladePath>& paths, const Array<float>* u_before,
                    const std::vector<BlockMotion>& before, CutReport& report) {
  std::vector<std::int32_t> changed;
  for (const BladePath& path : paths) {
    sweep_bonds(*state_, path, u_before, state_->nodes.u, before, changed, report);
  }
  if (changed.empty()) return;
  take_apart(*state_, changed);
  for (const int id : update_pieces(state_->bodies, state_->points, pieces_)) {
    report.new_fragments.push_back(id);
  }
}

void MpmTissue::advance(int substeps, float dt, const FrameInput& input) {
  MpmState& s = *state_;
  result_ = {};
  result_.loads.resize(s.scene.tools.size());
  for (const BladePath& path : input.cuts) {
    result_.cut_reports.emplace_back();
    cut({path}, s.nodes.u, s.motion, result_.cut_reports.back());
  }
  const bool blades = !blade_paths(s.scene, input, 0, 1).empty();
  if (blades) {
    for (int a = 0; a < 3; ++a) s.u_before[a] = s.nodes.u[a];
  }
  const double duration = static_cast<double>(substeps) * dt;
  const std::vector<Box> reach = collider_reach(s.scene, input, duration);
  find_near_colliders(s, reach, duration);
  const int checks = can_tear(s) ? tear_checks(s, substeps, dt) : 0;
  std::vector<BlockMotion> before = s.motion;  // when the blades were last looked at
  double cut_to = 0;                           // share of the frame
  const auto cut_by_blades = [&](double share) {
    measure_motion(s);
    const std::vector<BladePath> paths = blade_paths(s.scene, input, cut_to, share);
    cut(paths, s.u_before, before, result_.blade_report);
    cut_to = share;
  };
  int check = 0;
  for (int i = 0; i < substeps; ++i) {
    s.colliders = colliders_at(s.scene, input, (i + 1.0) / substeps, duration);
    std::vector<ColliderLoad> loads(s.colliders.size());
    find_face_contacts(s, pieces_, dt);
    substep(s, dt, loads);
    s.time += dt;
    for (std::size_t c = 1; c < loads.size(); ++c) {
      ToolLoad& load = result_.loads[c - 1];
      const Vec3 force(loads[c].force[0], loads[c].force[1], loads[c].force[2]);
      load.mean.force += force / substeps;
      load.mean.torque +=
          Vec3(loads[c].torque[0], loads[c].torque[1], loads[c].torque[2]) / substeps;
      load.peak_force = std::max(load.peak_force, force.norm());
    }
    if (checks == 0 || i + 1 != tear_check_at(check, checks, substeps)) continue;
    ++check;
    const std::vector<TearingPoint> tearing = find_tearing(s);
    if (tearing.empty()) continue;
    if (blades) cut_by_blades((i + 1.0) / substeps);
    if (!tear(tearing) && !blades) continue;
    measure_motion(s);
    find_near_colliders(s, reach, duration);
    before = s.motion;
    for (int a = 0; blades && a < 3; ++a) s.u_before[a] = s.nodes.u[a];
  }
  cut_by_blades(1);
  if (result_.tear_report.bonds_broken > 0) {
    result_.tear_report.new_fragments = update_pieces(s.bodies, s.points, pieces_);
  }
}

bool MpmTissue::tear(const std::vector<TearingPoint>& tearing) {
  std::vector<std::int32_t> changed;
  tear_bonds(*state_, tearing, changed, result_.tear_report);
  take_apart(*state_, changed);
  return !changed.empty();
}

void MpmTissue::measure() {
  MpmState& s = *state_;
  const int count = static_cast<int>(s.blocks.all.size());
  std::vector<BlockState> states(count);
  s.cpu->for_each(count, [&](int i) {
    const Block& block = *s.blocks.all[i];
    states[i] = s.kernels->state(block, block_field(s, block), s.scratch.local(), nullptr);
  });
  stiffening_ = even_stiffening(s, 1);
  std::vector<float> modulus(count, 0.0f);
  result_.elastic_energy = result_.kinetic_energy = result_.max_speed = 0;
  for (int i = 0; i < count; ++i) {
    const BlockState& b = states[i];
    result_.elastic_energy += b.elastic_energy;
    result_.blew_up = result_.blew_up || !b.finite;
    std::vector<float>& of_body = stiffening_[s.blocks.all[i]->body];
    for (std::size_t m = 0; m < of_body.size(); ++m) {
      of_body[m] = std::max(of_body[m], b.stiffening[m]);
      result_.blew_up = result_.blew_up || of_body[m] > 1e6f;
      const Material& material = s.bodies[s.blocks.all[i]->body].materials[m];
      modulus[i] =
          std::max(modulus[i], static_cast<float>(wave_modulus(material, b.stiffening[m])));
    }
  }
  substep_.follow(s, modulus);
  for (std::size_t i = 0; i < s.nodes.size(); ++i) {
    const double v2 = Vec3(s.nodes.v[0][i], s.nodes.v[1][i], s.nodes.v[2][i]).squaredNorm();
    result_.kinetic_energy += 0.5 * s.nodes.mass[i] * v2;
  }
  for (const BlockMotion& m : s.motion) {
    if (!(m.speed <= result_.max_speed)) result_.max_speed = m.speed;
  }
  // Nothing that instruments do moves tissue at the speed of a bullet; what does is out of control.
  result_.blew_up = result_.blew_up || !(result_.max_speed < 300);
}

FrameResult MpmTissue::finish() {
  measure();
  measure_pieces(*state_, pieces_);
  return result_;
}

std::uint64_t MpmTissue::checksum() const { return tissue_sim::checksum(*state_, pieces_); }

std::string MpmTissue::device_name() const {
  return std::string("cpu (") + name(state_->instructions) + ", " +
         std::to_string(state_->cpu->threads()) + " threads)";
}

}  // namespace tissue_sim
