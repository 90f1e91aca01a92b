// The steps of a frame: frame/run_frame.h says in which order.
#include <algorithm>
#include <utility>

#include "mpm/contact/face_contact.h"
#include "mpm/mpm_tissue.h"
#include "tools/tool_motion.h"

namespace tissue_sim {

void MpmTissue::begin_frame(double duration, const FrameInput& input, FrameColliders colliders) {
  MpmState& s = run_->state;
  FrameResult& result = run_->result;
  tissue_sim::follow(input, s.scene);
  result = {};
  result.loads.resize(s.scene.tools.size());
  AnchorFaces& faces = s.anchors;
  faces.impulse.assign(faces.rows.size(), {});
  const bool move = !faces.moves && !input.anchors.empty();
  if (move) {
    faces.moves = true;
    find_held_nodes(s, faces);
  }
  device_->begin_frame(input, move);
  for (const BladePath& path : input.cuts) {
    result.cut_reports.emplace_back();
    cut({path}, false, result.cut_reports.back());
  }
  run_->frame.emplace(MpmFrame{input, duration, std::move(colliders),
                               !blade_paths(s.scene, input, 0, 1).empty(), s.motion});
  device_->begin_rest();
}

PartSubsteps MpmTissue::choose_substeps(const FrameInput& input, double time) {
  run_->frame->watched = SubstepChoice::is_strained(run_->state);
  measured_ = followed_ = false;
  const FrameColliders& colliders = run_->frame->colliders;
  return substep_.part(run_->state, input, colliders, time, substep_for(input, colliders));
}

void MpmTissue::save_checkpoint() {
  device_->save_motion();
  checkpoint_.result = run_->result;
}

Verdict MpmTissue::judge_part(const FramePart& part) {
  const MpmFrame& frame = *run_->frame;
  FrameResult& result = run_->result;
  result.substep = std::max<double>(result.substep, part.substeps.longest());
  result.substeps += part.done;
  const bool goes_on = part.reached() < 1 || frame.blades;
  measured(device_->measure_part(goes_on && !frame.watched ? kMeasureStiffness : kMeasureEnergies));
  PartEnergy energy;
  if (has_energies_) {
    energy = {result.kinetic_energy, result.elastic_energy, run_->work,
              part.substeps.until(part.done)};
  }
  checkpoint_.substep = substep_;
  const float last = part.substeps.at(part.done - 1);
  const bool borne = substep_.is_borne(run_->state, run_->modulus, stable_substep(), last, energy);
  const bool may_go_back = device_->can_restore_motion();
  if (!borne && may_go_back) return Verdict::kTooLong;
  return device_->missed_contact() && may_go_back ? Verdict::kMissedContact : Verdict::kAccepted;
}

void MpmTissue::reject_part(Verdict verdict) {
  const bool missed = verdict == Verdict::kMissedContact;
  device_->restore_motion(missed);
  run_->result = checkpoint_.result;
  measured(device_->measure(kMeasureStiffness));
  if (missed) substep_ = checkpoint_.substep;
}

bool MpmTissue::accept_part() {
  search_if_faster(run_->state);
  follow();
  return !run_->result.blew_up;
}

void MpmTissue::break_bonds(double share) {
  const bool tore = tear(share);
  const bool settled = share < 1 && settle_ill_conditioned();
  if (!tore && !settled) return;
  if (settled || !measured_) measured(device_->measure(kMeasureStiffness));
  follow();
}

void MpmTissue::end_frame() {
  device_->end_frame();
  FrameResult& result = run_->result;
  result.anchor_loads = anchor_loads(run_->state.anchors, run_->frame->duration);
  cut_by_blades(1);
  if (result.tear_report.bonds_broken > 0) {
    result.tear_report.new_fragments = device_->label_pieces();
  }
}

}  // namespace tissue_sim
