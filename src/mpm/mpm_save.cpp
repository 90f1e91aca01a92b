// The state of tissue as bytes.
#include <stdexcept>

#include "mpm/mpm_fields.h"
#include "mpm/mpm_tissue.h"

namespace tissue_sim {

template <class Archive>
void MpmTissue::each_field(Archive& archive) {
  archive(*state_, pieces_, stiffening_, modulus_, measured_, has_energies_, work_,
          pieces_measured_, substep_, said_, flown_);
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
  state_->inertial_index.assign(state_->nodes.size(), -1);
  index_inertia(*state_);
  index_flights(*state_);
  state_->force.clear();
  state_->force.resize(state_->blocks.force_size);
}

}  // namespace tissue_sim
