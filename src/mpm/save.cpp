// The state of tissue as bytes.
#include <stdexcept>

#include "mpm/mpm_fields.h"
#include "mpm/mpm_tissue.h"

namespace tissue_sim {

template <class Archive>
void MpmTissue::each_field(Archive& archive) {
  tissue_fields(archive, run_->state);
  if constexpr (Archive::kReads) {
    device_->restore(archive);
  } else {
    device_->save(archive);
  }
  archive.part("pieces", run_->pieces, pieces_measured_);
  archive.part("substeps", run_->stiffening, run_->modulus, substep_);
  archive.part("measures", measured_, has_energies_, run_->work);
  archive.part("forecast", foresight_.said, foresight_.waiting, foresight_.flown);
}

std::vector<std::uint8_t> MpmTissue::save() {
  device_->bring_all_nodes();
  ArchiveWriter out;
  each_field(out);
  return out.take();
}

void MpmTissue::restore(Span<const std::uint8_t> saved) {
  ArchiveReader in(saved);
  each_field(in);
  if (in.left() > 0) throw std::runtime_error("the state has more to it than this version knows");
  followed_ = measured_;
  check_pieces(run_->pieces, state().points.site.size(), state().scene.bodies.size());
  device_->restored();
}

}  // namespace tissue_sim
