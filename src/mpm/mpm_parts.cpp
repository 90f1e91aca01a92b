// The steps of a frame: frame/run_frame.h says in which order.
#include <utility>

#include "mpm/contact/block_contact.h"
#include "mpm/mpm_tissue.h"
#include "mpm/tear/tear.h"

namespace tissue_sim {

void MpmTissue::advance(double duration, const FrameInput& input) {
  run_frame(*this, duration, input);
}

PartSubsteps MpmTissue::choose_substeps(const FrameInput& input, double time) {
  return substep_.part(*state_, input, time, substep_for(input));
}

double MpmTissue::run_part(const FramePart& part) {
  Frame& frame = *frame_;
  frame.watched = SubstepChoice::is_strained(*state_);
  work_ = 0;
  frame.done = run(part);
  return part.share_after(frame.done);
}

Verdict MpmTissue::judge_part(const FramePart& part) {
  Frame& frame = *frame_;
  PartEnergy energy;
  if (!frame.watched && (part.share_after(frame.done) < 1 || frame.blades)) {
    measure_stiffness();
  } else {
    measure_energies();
    energy = {result_.kinetic_energy, result_.elastic_energy, work_,
              part.substeps.until(frame.done)};
  }
  checkpoint_.substep = substep_;
  const float last = part.substeps.at(frame.done - 1);
  if (!substep_.is_borne(*state_, modulus_, stable_substep(), last, energy)) {
    return Verdict::kTooLong;
  }
  measure_motion(*state_);
  if (std::exchange(frame.again, false) || !came_unforeseen(*state_, frame.reach)) {
    return Verdict::kAccepted;
  }
  return Verdict::kUnforeseen;
}

void MpmTissue::reject_part(Verdict verdict) {
  restore_checkpoint();
  if (verdict != Verdict::kUnforeseen) return;
  Frame& frame = *frame_;
  frame.again = true;
  substep_ = checkpoint_.substep;
  // From where blocks went, whose motion still stands, and from where they began.
  find_near_colliders(*state_, frame.reach, frame.duration, checkpoint_.of_blocks);
}

bool MpmTissue::accept_part() {
  search_if_faster(*state_);
  substep_.follow(*state_, modulus_);
  return !result_.blew_up;
}

void MpmTissue::break_bonds(double share) {
  tear(share);
  if (share < 1 && settle_wild_debris()) measured_ = false;
  if (measured_) return;
  measure_stiffness();
  substep_.follow(*state_, modulus_);
}

void MpmTissue::save_checkpoint() {
  MpmState& s = *state_;
  checkpoint_.motion = motion_of(s);
  checkpoint_.faces = s.faces;
  checkpoint_.result = result_;
  checkpoint_.of_blocks = s.motion;
}

void MpmTissue::restore_checkpoint() {
  MpmState& s = *state_;
  for (const InertialNode& n : s.contacts.inertia.nodes) s.work.inertial_index[n.node] = -1;
  motion_of(s) = checkpoint_.motion;
  index_inertia(s);
  s.faces = checkpoint_.faces;
  result_ = checkpoint_.result;
  index_flights(s);
  measure_stiffness();
}

}  // namespace tissue_sim
