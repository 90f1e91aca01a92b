// Tissue that is cut, tears, or is calmed where it is ill-conditioned.
#include <algorithm>

#include "mpm/contact/cutting_edges.h"
#include "mpm/cut_tissue.h"
#include "mpm/lattice_pieces.h"
#include "mpm/mpm_tissue.h"
#include "mpm/tear/debris.h"
#include "mpm/tear/tear.h"
#include "tools/tool_motion.h"

namespace tissue_sim {

void MpmTissue::take_apart(const std::vector<std::int32_t>& changed,
                           const std::vector<std::int32_t>& touched, std::vector<int>* fresh) {
  MpmState& s = run_->state;
  measured_ = followed_ = false;
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
  if (s.debris.empty() || !may_be_ill_conditioned(s)) return false;
  device_->bring_nodes({s.debris.begin(), s.debris.end()});
  std::vector<std::int32_t> settled = tissue_sim::settle_ill_conditioned(s, s.debris);
  if (settled.empty()) return false;
  device_->send_nodes();
  std::sort(settled.begin(), settled.end());
  device_->settled(settled);
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
