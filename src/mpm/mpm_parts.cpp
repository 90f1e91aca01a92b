// Parts of a frame: one that tissue could not bear is undone, and one in which it came to an
// instrument unforeseen.
#include <utility>

#include "mpm/contact/block_contact.h"
#include "mpm/mpm_tissue.h"
#include "mpm/tear/tear.h"

namespace tissue_sim {

void MpmTissue::advance(double duration, const FrameInput& input) {
  Frame frame = begin(duration, input);
  advance_in_parts(
      duration, input,
      [this](const FrameInput& rest, double time) {
        return substep_.part(*state_, rest, time, substep_for(rest));
      },
      [&](const PartSubsteps& substeps, double from, double to) {
        return run_part(frame, substeps, from, to);
      });
  end(frame);
}

PartRun MpmTissue::run_part(Frame& frame, const PartSubsteps& substeps, double from, double to) {
  save_checkpoint();
  const std::vector<BlockMotion> begun = state_->motion;
  std::vector<TearingPoint> tearing;
  const bool watched = SubstepChoice::is_strained(*state_);
  work_ = 0;
  const int done = run(frame, substeps, from, to, tearing);
  const double reached = done == substeps.count ? to : substeps.share(done, from, to);
  PartEnergy energy;
  if (!watched && (reached < 1 || frame.blades)) {
    measure_stiffness();
  } else {
    measure_energies();
    energy = {result_.kinetic_energy, result_.elastic_energy, work_, substeps.until(done)};
  }
  const SubstepChoice before = substep_;
  if (!substep_.is_borne(*state_, modulus_, stable_substep(), substeps.at(done - 1), energy)) {
    restore_checkpoint();
    return {PartEnd::kUndone, from};
  }
  measure_motion(*state_);
  if (!std::exchange(frame.again, false) && came_unforeseen(*state_, frame.reach)) {
    frame.again = true;
    restore_checkpoint();
    substep_ = before;
    // From where blocks went, whose motion still stands, and from where they began.
    find_near_colliders(*state_, frame.reach, frame.duration, begun);
    return {PartEnd::kUndone, from};
  }
  substep_.follow(*state_, modulus_);
  if (result_.blew_up) return {PartEnd::kBlewUp, reached};
  tear(frame, tearing, reached);
  if (reached < 1 && settle_wild_crumbs()) measured_ = false;
  if (!measured_) {
    measure_stiffness();
    substep_.follow(*state_, modulus_);
  }
  return {PartEnd::kBorne, reached};
}

void MpmTissue::save_checkpoint() {
  const MpmState& s = *state_;
  for (int a = 0; a < 3; ++a) {
    checkpoint_.u[a] = s.nodes.u[a];
    checkpoint_.v[a] = s.nodes.v[a];
  }
  checkpoint_.time = s.time;
  checkpoint_.dt = s.dt;
  checkpoint_.contacts = s.contacts;
  checkpoint_.faces = s.faces;
  checkpoint_.result = result_;
}

void MpmTissue::restore_checkpoint() {
  MpmState& s = *state_;
  for (int a = 0; a < 3; ++a) {
    s.nodes.u[a] = checkpoint_.u[a];
    s.nodes.v[a] = checkpoint_.v[a];
  }
  s.time = checkpoint_.time;
  s.dt = checkpoint_.dt;
  s.contacts = checkpoint_.contacts;
  s.faces = checkpoint_.faces;
  result_ = checkpoint_.result;
  measure_stiffness();
}

}  // namespace tissue_sim
