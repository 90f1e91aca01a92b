// The state of tissue as bytes.
#include <stdexcept>

#include "mpm/contact/face_fields.h"
#include "mpm/mpm_fields.h"
#include "mpm/mpm_tissue.h"

namespace tissue_sim {

template <class Archive>
void MpmTissue::each_field(Archive& archive) {
  tissue_fields(archive, *state_);
  archive.begin_part("faces");
  fields(archive, state_->faces, state_->blocks);
  archive.end_part("faces");
  archive.part("pieces", pieces_, pieces_measured_);
  archive.part("substeps", stiffening_, modulus_, substep_);
  archive.part("measures", measured_, has_energies_, work_);
  archive.part("forecast", foresight_.said, foresight_.waiting, foresight_.flown);
}

std::vector<std::uint8_t> MpmTissue::save() {
  ArchiveWriter out;
  each_field(out);
  return out.take();
}

void MpmTissue::restore(Span<const std::uint8_t> saved) {
  ArchiveReader in(saved);
  each_field(in);
  if (in.left() > 0) throw std::runtime_error("the state has more to it than this version knows");
  check_state(*state_);
  check_pieces(pieces_, state_->points.site.size(), state_->scene.bodies.size());
  state_->work.inertial_index.assign(state_->nodes.size(), -1);
  index_inertia(*state_);
  index_flights(*state_);
  list_front_cells(*state_);
  mark_row_nodes(state_->nodes.size(), state_->anchors);
  state_->work.force.clear();
  state_->work.force.resize(state_->blocks.force_size);
}

}  // namespace tissue_sim
