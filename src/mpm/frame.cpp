// The steps of a frame, in the order that frame/run_frame.h says; cuts and tears among them.
#include <algorithm>
#include <cmath>
#include <utility>

#include "mpm/contact/face_contact.h"
#include "mpm/contact/touching_tissue.h"
#include "mpm/cut_tissue.h"
#include "mpm/mpm_tissue.h"
#include "mpm/tear/debris.h"
#include "mpm/tear/tear.h"
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
  run_->frame.emplace(
      MpmFrame{input, duration, std::move(colliders), may_cut(s.scene, s.edges, input), s.motion});
  device_->begin_rest();
}

PartSubsteps MpmTissue::choose_substeps(const FrameInput& input, double time) {
  const FrameResult& result = run_->result;
  run_->frame->watched = SubstepChoice::is_watched(run_->state);
  if (run_->frame->watched && !substep_.acceptance().knows_energy()) {
    measured(device_->measure(kMeasureEnergies));
    substep_.acceptance().begin_with(result.kinetic_energy + result.elastic_energy);
  }
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

void MpmTissue::take_apart(const std::vector<std::int32_t>& changed,
                           const std::vector<std::int32_t>& touched, std::vector<int>* fresh) {
  MpmState& s = run_->state;
  measured_ = followed_ = false;
  substep_.acceptance().begin_with(NAN);
  device_->before_parting(changed);
  if (!touched.empty()) follow_front(s, touched, s.anchors.at_row);
  Apart apart;
  bool may_part = false;
  const auto label = [&] {
    for (const int id : device_->label_pieces()) fresh->push_back(id);
  };
  if (changed.empty()) {
    list_front_cells(s);
  } else {
    apart = tissue_sim::take_apart(s, changed, [&] {
      may_part = fresh != nullptr && may_have_parted(s, changed);
      if (may_part && device_->labels_by_bonds_alone()) label();
    });
  }
  device_->parted(changed, apart);
  if (may_part && !device_->labels_by_bonds_alone()) label();
}

void MpmTissue::cut(const std::vector<BladePath>& paths, bool moves, CutReport& report) {
  std::vector<std::int32_t> changed, touched;
  device_->sweep(paths, moves, changed, touched, report);
  if (changed.empty() && touched.empty()) return;
  take_apart(changed, touched, &report.new_fragments);
  measured(device_->measure(0));  // of blocks that are new, their bounds are known
}

void MpmTissue::cut_by_blades(double share) {
  MpmFrame& frame = *run_->frame;
  MpmState& s = run_->state;
  const auto free = free_paths(s.scene, s.edges, frame.input, frame.cut_to, share);
  const auto held = held_paths(s, frame.input, share);
  cut(free, true, run_->result.blade_report);
  if (!held.empty()) cut(held, false, run_->result.blade_report);
  frame.cut_to = share;
}

bool MpmTissue::tear(double share) {
  MpmState& s = run_->state;
  MpmFrame& frame = *run_->frame;
  CutReport& report = run_->result.tear_report;
  const bool bridges =
      share < 1 && may_be_ill_conditioned(s) && !s.bridge_ends.empty();  // at 1, finish() does
  if (frame.tearing.empty() && !bridges) return false;
  if (frame.blades) {  // what they have passed so far
    measured(device_->measure(kMeasureMotion));
    cut_by_blades(share);
  }
  std::vector<std::int32_t> changed;
  tear_bonds(s, s, frame.tearing, changed, report);
  if (bridges) {
    device_->bring_nodes(s.bridge_ends);
    tear_bridges(s, s, changed, report);
  }
  if (changed.empty() && !frame.blades) return false;
  if (!changed.empty()) take_apart(changed);
  measured_ = false;
  measured(device_->measure(kMeasureMotion));
  frame.before = s.motion;
  device_->begin_rest();
  return true;
}

bool MpmTissue::settle_ill_conditioned() {
  MpmState& s = run_->state;
  if ((s.debris.empty() && s.bridge_ends.empty()) || !may_be_ill_conditioned(s)) return false;
  std::vector<std::int32_t> may_be(s.debris.begin(), s.debris.end());
  may_be.insert(may_be.end(), s.bridge_ends.begin(), s.bridge_ends.end());
  device_->bring_nodes(may_be);
  std::vector<std::int32_t> settled =
      tissue_sim::settle_ill_conditioned(s, s.debris, s.bridge_ends, s.anchors);
  if (settled.empty()) return false;
  device_->send_nodes();
  std::sort(settled.begin(), settled.end());
  device_->settled(settled);
  substep_.acceptance().begin_with(NAN);
  return true;
}

bool MpmTissue::tame() {
  MpmState& s = run_->state;
  CutReport& report = run_->result.tear_report;
  if (run_->result.blew_up || !may_be_ill_conditioned(s)) return false;
  const bool settled = settle_ill_conditioned();
  std::vector<std::int32_t> changed;
  if (!s.bridge_ends.empty()) {
    device_->bring_nodes(s.bridge_ends);
    tear_bridges(s, s, changed, report);
  }
  if (changed.empty()) return settled;
  take_apart(changed);
  for (const int id : device_->label_pieces()) report.new_fragments.push_back(id);
  return true;
}

}  // namespace tissue_sim
