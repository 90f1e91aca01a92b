// The steps of a frame of tissue that lives on a GPU: frame/run_frame.h says in which order.
#include "mpm/cuda/on_device.h"

namespace tissue_sim {

void CudaMpmTissue::advance(double duration, const FrameInput& input) {
  run_frame(*this, duration, input);
}

PartSubsteps CudaMpmTissue::choose_substeps(const FrameInput& input, double time) {
  return substep_.part(*state_, input, time, substep_for(input));
}

double CudaMpmTissue::run_part(const FramePart& part) {
  done_ = run(part);
  if (tearing_.empty()) search_ahead();
  return part.share_after(done_);
}

Verdict CudaMpmTissue::judge_part(const FramePart& part) {
  OnDevice& d = *device_;
  launch_measure();
  look_for_unforeseen();
  finish_measure();
  const bool unforeseen = d.went.empty() && came_unforeseen();
  d.went.clear();
  sum_loads();
  const PartEnergy energy{result_.kinetic_energy, result_.elastic_energy, work_,
                          part.substeps.until(done_)};
  OnDevice::Checkpoint& saved = d.checkpoint;
  const bool may_go_back = static_cast<std::size_t>(saved.host_held_count[0]) <= saved.held.size();
  saved.substep = substep_;
  const float last = part.substeps.at(done_ - 1);
  if (!substep_.is_borne(*state_, modulus_, stable_substep(), last, energy) && may_go_back) {
    return Verdict::kTooLong;
  }
  return unforeseen && may_go_back ? Verdict::kUnforeseen : Verdict::kAccepted;
}

void CudaMpmTissue::reject_part(Verdict verdict) {
  OnDevice& d = *device_;
  const bool unforeseen = verdict == Verdict::kUnforeseen;
  if (unforeseen) {
    d.went = state_->motion;
    d.u_went.copy(d.u[d.current], d.stream);
  }
  restore_checkpoint();
  if (unforeseen) substep_ = d.checkpoint.substep;
}

bool CudaMpmTissue::accept_part() {
  search_if_faster(*state_);
  substep_.follow(*state_, modulus_);
  return !result_.blew_up;
}

void CudaMpmTissue::break_bonds(double share) {
  const bool tore = tear(share);
  const bool settled = share < 1 && settle_wild_debris();
  if (settled) {
    launch_measure();
    finish_measure();
  }
  if (tore || settled) substep_.follow(*state_, modulus_);
}

void CudaMpmTissue::end_frame() {
  pull_impulses();
  result_.anchor_loads = anchor_loads(state_->anchors, duration_);
  if (!blades_.empty()) cut_by_blades();
  blades_.clear();
  if (result_.tear_report.bonds_broken > 0) {
    result_.tear_report.new_fragments = label_pieces();
  }
}

void CudaMpmTissue::save_checkpoint() {
  OnDevice& d = *device_;
  OnDevice::Checkpoint& saved = d.checkpoint;
  const FacesOnDevice& f = d.faces;
  saved.u.copy(d.u[d.current], d.stream);
  saved.v.copy(d.v[d.current], d.stream);
  launch_list_held(d.with.data(), d.hold.data(), static_cast<int>(d.with.size()), saved.held.data(),
                   static_cast<int>(saved.held.size()), saved.held_count.data(), d.stream);
  saved.held_count.download(saved.host_held_count.data(), 1, d.stream);
  saved.new_facets = f.version != state_->faces.version || f.springs.size() == 0;
  if (!saved.new_facets) {
    saved.springs.copy(f.springs, d.stream);
    saved.figures.copy(f.figures, d.stream);
  }
  saved.kept = state_->faces.kept;
  saved.impulse.copy(d.anchors.impulse, d.stream);
  saved.anchors = state_->anchors.now;
  saved.time = state_->time;
  saved.dt = state_->dt;
  saved.result = result_;
}

void CudaMpmTissue::restore_checkpoint() {
  OnDevice& d = *device_;
  const OnDevice::Checkpoint& saved = d.checkpoint;
  FacesOnDevice& f = d.faces;
  d.u[d.current].copy(saved.u, d.stream);
  d.v[d.current].copy(saved.v, d.stream);
  d.with.clear(d.stream);
  launch_hold_again(saved.held.data(), saved.host_held_count[0], d.with.data(), d.hold.data(),
                    d.stream);
  if (saved.new_facets) {
    f.version = -1;  // they go up again
  } else {
    f.springs.copy(saved.springs, d.stream);
    f.figures.copy(saved.figures, d.stream);
  }
  state_->faces.kept = saved.kept;
  d.anchors.impulse.copy(saved.impulse, d.stream);
  state_->anchors.now = saved.anchors;
  search_anew();
  state_->time = saved.time;
  state_->dt = saved.dt;
  result_ = saved.result;
  substeps_ = 0;
  launch_measure();
  finish_measure();
}

}  // namespace tissue_sim
