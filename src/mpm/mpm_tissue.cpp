#include "mpm/mpm_tissue.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "frame/out_of_control.h"
#include "math/lanczos.h"
#include "mpm/contact/block_contact.h"
#include "mpm/lattice_pieces.h"
#include "mpm/linearised_motion.h"
#include "mpm/piece_motion.h"
#include "mpm/split/cut_tissue.h"
#include "mpm/tear/bond_bridges.h"
#include "mpm/tear/debris.h"
#include "mpm/tear/tear.h"
#include "tissue_sim/limits.h"
#include "tools/frame_colliders.h"
#include "tools/tool_motion.h"

namespace tissue_sim {
namespace {

constexpr float kInfinite = std::numeric_limits<float>::infinity();

}  // namespace

MpmTissue::MpmTissue(const Scene& scene, std::vector<std::string> notes)
    : notes_(std::move(notes)),
      state_(make_mpm_state(scene, &notes_)),
      pieces_(whole_pieces(*state_)) {
  measure_motion(*state_);
  measure_stiffness();
  substep_.follow(*state_, modulus_);
  measured_ = false;  // who holds the state may change it
  foresight_ = make_foresight(scene);
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
  std::vector<std::int32_t> changed, touched;
  for (const BladePath& path : paths) {
    sweep_bonds(*state_, path, u_before, state_->nodes.u, before, changed, touched, report);
  }
  if (changed.empty() && touched.empty()) return;
  measured_ = false;
  if (!touched.empty()) follow_front(*state_, touched, state_->anchors.at_row);
  if (changed.empty()) return list_front_cells(*state_);
  const MpmState& s = *state_;
  take_apart(*state_, changed, [&] {
    if (!may_have_parted(s, changed)) return;
    for (const int id : update_pieces(s, pieces_)) {
      report.new_fragments.push_back(id);
    }
  });
}

void MpmTissue::begin_frame(double duration, const FrameInput& input) {
  MpmState& s = *state_;
  result_ = {};
  result_.loads.resize(s.scene.tools.size());
  follow(input, s.scene);
  s.anchors.impulse.assign(s.anchors.rows.size(), {});
  if (!input.anchors.empty() && s.anchors.origin.empty()) {
    throw std::runtime_error(
        "anchors do not move where the boundary is the lattice's: set mpm.boundary to surface");
  }
  if (!s.anchors.moves && !input.anchors.empty()) {
    s.anchors.moves = true;
    find_held_nodes(s, s.anchors);
  }
  for (const BladePath& path : input.cuts) {
    result_.cut_reports.emplace_back();
    cut({path}, s.nodes.u, s.motion, result_.cut_reports.back());
  }
  const bool blades = !blade_paths(s.scene, input, 0, 1).empty();
  if (blades) {
    for (int a = 0; a < 3; ++a) s.work.u_before[a] = s.nodes.u[a];
  }
  const FrameColliders colliders(s.scene, input, duration);
  frame_ = Frame{input, duration, colliders, colliders.reach(), blades, 0, s.motion};
  find_near_colliders(s, frame_->reach, duration);
}

int MpmTissue::run(const FramePart& part) {
  MpmState& s = *state_;
  Frame& frame = *frame_;
  const PartSubsteps& substeps = part.substeps;
  const int checks = can_tear(s) ? tear_checks(s, substeps.count, substeps.longest()) : 0;
  measured_ = false;
  frame.tearing.clear();
  result_.substep = std::max<double>(result_.substep, substeps.longest());
  int done = 0;
  for (int check = 0; done < substeps.count && frame.tearing.empty(); ++done) {
    stop_if_asked();
    const double share = substeps.share(done + 1, part.from, part.to);
    const float dt = substeps.at(done);
    s.colliders = frame.colliders.at(share);
    std::vector<ColliderLoad> loads(s.colliders.size());
    find_face_contacts(s, pieces_, dt);
    const float acted = substep(s, dt, loads, anchors_at(s.anchors, frame.input, share));
    s.time += dt;
    frame.colliders.add_loads(share, s.colliders.data(), loads.data(), acted / frame.duration,
                              result_.loads);
    work_ += frame.colliders.power(s.colliders.data(), loads.data()) * acted;
    if (checks == 0 || done + 1 != tear_check_at(check, checks, substeps.count)) continue;
    ++check;
    frame.tearing = find_tearing(s);
  }
  result_.substeps += done;
  return done;
}

void MpmTissue::tear(double share) {
  MpmState& s = *state_;
  Frame& frame = *frame_;
  const bool bridges =
      share < 1 && may_be_wild(s) && !s.bridge_ends.empty();  // at 1, finish() does
  if (frame.tearing.empty() && !bridges) return;
  if (frame.blades) {
    measure_motion(s);
    cut_by_blades(share);
  }
  std::vector<std::int32_t> changed;
  tear_bonds(s, frame.tearing, changed, result_.tear_report);
  if (bridges) tear_bridges(s, changed, result_.tear_report);
  if (changed.empty() && !frame.blades) return;
  take_apart(s, changed);
  measured_ = false;
  measure_motion(s);
  find_near_colliders(s, frame.reach, frame.duration);
  frame.before = s.motion;
  for (int a = 0; frame.blades && a < 3; ++a) s.work.u_before[a] = s.nodes.u[a];
}

void MpmTissue::cut_by_blades(double share) {
  Frame& frame = *frame_;
  const std::vector<BladePath> paths = blade_paths(state_->scene, frame.input, frame.cut_to, share);
  cut(paths, state_->work.u_before, frame.before, result_.blade_report);
  frame.cut_to = share;
}

void MpmTissue::end_frame() {
  result_.anchor_loads = anchor_loads(state_->anchors, frame_->duration);
  cut_by_blades(1);
  if (result_.tear_report.bonds_broken > 0) {
    result_.tear_report.new_fragments = update_pieces(*state_, pieces_);
  }
}

void MpmTissue::advance(int substeps, float dt, const FrameInput& input) {
  begin_frame(static_cast<double>(substeps) * dt, input);
  for (int done = 0; done < substeps;) {
    done += run({even_substeps(substeps - done, dt), static_cast<double>(done) / substeps, 1});
    tear(static_cast<double>(done) / substeps);
  }
  measure_motion(*state_);
  end_frame();
}

bool MpmTissue::settle_wild_debris() {
  MpmState& s = *state_;
  if (!may_be_wild(s)) return false;
  std::vector<std::int32_t> settled = tissue_sim::settle_wild_debris(s, s.debris);
  std::sort(settled.begin(), settled.end());
  begin_anew(s.contacts, settled);
  return !settled.empty();
}

bool MpmTissue::tame() {
  if (result_.blew_up || !may_be_wild(*state_)) return false;
  MpmState& s = *state_;
  const bool settled = settle_wild_debris();
  std::vector<std::int32_t> changed;
  tear_bridges(s, changed, result_.tear_report);
  if (changed.empty()) return settled;
  take_apart(*state_, changed);
  for (const int id : update_pieces(*state_, pieces_)) {
    result_.tear_report.new_fragments.push_back(id);
  }
  return true;
}

template <class Read>
void MpmTissue::measure(const Read& read) {
  MpmState& s = *state_;
  const int count = static_cast<int>(s.blocks.all.size());
  std::vector<BlockState> states(count);
  s.cpu->for_each(count, [&](int i) {
    const Block& block = *s.blocks.all[i];
    const BlockField field = block_field(s, block);
    states[i] = read(block, field, s.work.scratch.local());
  });
  stiffening_ = even_stiffening(s, 1);
  modulus_.assign(count, 0.0f);
  s.wildest = 1;
  result_.elastic_energy = 0;
  for (int i = 0; i < count; ++i) {
    const BlockState& b = states[i];
    result_.elastic_energy += b.elastic_energy;
    s.wildest = std::max(s.wildest, b.wildest);
    result_.blew_up = result_.blew_up || !b.finite;
    std::vector<float>& of_body = stiffening_[s.blocks.all[i]->body];
    for (std::size_t m = 0; m < of_body.size(); ++m) {
      const float stiffening = b.finite ? b.stiffening[m] : kInfinite;
      of_body[m] = std::max(of_body[m], stiffening);
      if (m + 1 == of_body.size()) break;  // that is no material's
      result_.blew_up = result_.blew_up || of_body[m] > 1e6f;
      const Material& material = s.bodies[s.blocks.all[i]->body].materials[m];
      modulus_[i] = std::max(modulus_[i], static_cast<float>(wave_modulus(material, stiffening)));
    }
  }
  measured_ = true;
  has_energies_ = false;
}

void MpmTissue::measure_stiffness() {
  const BlockKernels& kernels = *state_->kernels;
  measure([&](auto&... block) { return kernels.stiffness(block...); });
}

void MpmTissue::measure_energies() {
  const BlockKernels& kernels = *state_->kernels;
  measure([&](auto&... block) { return kernels.state(block..., nullptr); });
  const Nodes& n = state_->nodes;
  result_.kinetic_energy = 0;
  for (std::size_t i = 0; i < n.size(); ++i) {
    const double v2 = Vec3(n.v[0][i], n.v[1][i], n.v[2][i]).squaredNorm();
    result_.kinetic_energy += 0.5 * n.mass[i] * v2;
  }
  result_.kinetic_energy += front_kinetic_energy(state_->front);
  result_.elastic_energy += front_elastic_energy(*state_);
  has_energies_ = true;
}

FrameResult MpmTissue::finish() {
  const auto measure_and_follow = [this] {
    measure_energies();
    substep_.follow(*state_, modulus_);
  };
  if (!measured_) {
    measure_and_follow();
  } else if (!has_energies_) {
    measure_energies();
  }
  result_.max_speed = 0;
  for (const BlockMotion& m : state_->motion) {
    if (!(m.speed <= result_.max_speed)) result_.max_speed = m.speed;
  }
  result_.blew_up = result_.blew_up || is_out_of_control(result_);
  if (tame()) measure_and_follow();
  if (foresight_.network != nullptr && !result_.blew_up) {
    const double duration = frame_ ? frame_->duration : 0.0;
    if (!let_fly(*state_, pieces_, result_, duration, foresight_).empty()) {
      measure_motion(*state_);
      measure_and_follow();
    }
    look_ahead(*state_, pieces_, find_strained(*state_, kRegionLevels[0]), duration, foresight_,
               result_);
  }
  measured_ = pieces_measured_ = false;
  return result_;
}

Span<const Fragment> MpmTissue::fragments() {
  if (!pieces_measured_) measure_pieces(*state_, pieces_);
  pieces_measured_ = true;
  return pieces_.all;
}

std::uint64_t MpmTissue::checksum() { return tissue_sim::checksum(*state_, pieces_); }

Momentum MpmTissue::momentum() { return tissue_sim::momentum(*state_); }

std::string MpmTissue::device_name() const {
  return std::string("cpu (") + name(state_->instructions) + ", " +
         std::to_string(state_->cpu->threads()) + " threads)";
}

}  // namespace tissue_sim
