// Parts of a frame of tissue that lives on a GPU: a part that tissue could not bear is undone, and
// one in which it came to an instrument unforeseen.
#include "mpm/cuda/on_device.h"

namespace tissue_sim {

void CudaMpmTissue::advance(double duration, const FrameInput& input) {
  begin(duration, input);
  advance_in_parts(
      duration, input,
      [this](const FrameInput& rest, double time) {
        return substep_.part(*state_, rest, time, substep_for(rest));
      },
      [&](const PartSubsteps& substeps, double from, double to) {
        return run_part(substeps, input, from, to);
      });
}

PartRun CudaMpmTissue::run_part(const PartSubsteps& substeps, const FrameInput& input, double from,
                                double to) {
  OnDevice& d = *device_;
  save_checkpoint();
  std::vector<TearingPoint> tearing;
  const int done = run(substeps, from, to, tearing);
  if (tearing.empty()) search_ahead();
  const double reached = done == substeps.count ? to : substeps.share(done, from, to);
  launch_measure();
  look_for_unforeseen();
  finish_measure();
  const bool unforeseen = d.went.empty() && came_unforeseen();
  d.went.clear();
  sum_loads();
  const PartEnergy energy{result_.kinetic_energy, result_.elastic_energy, work_,
                          substeps.until(done)};
  const OnDevice::Checkpoint& saved = d.checkpoint;
  const bool may_go_back = static_cast<std::size_t>(saved.host_held_count[0]) <= saved.held.size();
  const SubstepChoice before = substep_;
  if (!substep_.is_borne(*state_, modulus_, stable_substep(), substeps.at(done - 1), energy) &&
      may_go_back) {
    restore_checkpoint();
    return {PartEnd::kUndone, from};
  }
  if (unforeseen && may_go_back) {
    d.went = state_->motion;
    d.u_went.copy(d.u[d.current], d.stream);
    restore_checkpoint();
    substep_ = before;
    return {PartEnd::kUndone, from};
  }
  substep_.follow(*state_, modulus_);
  if (result_.blew_up) return {PartEnd::kBlewUp, reached};
  const bool tore = tear(tearing, input, reached);
  const bool settled = reached < 1 && settle_wild_crumbs();
  if (settled) {
    launch_measure();
    finish_measure();
  }
  if (tore || settled) substep_.follow(*state_, modulus_);
  return {PartEnd::kBorne, reached};
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
  search_anew();
  state_->time = saved.time;
  state_->dt = saved.dt;
  result_ = saved.result;
  substeps_ = 0;
  launch_measure();
  finish_measure();
}

}  // namespace tissue_sim
