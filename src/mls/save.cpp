// The state of tissue as bytes. What follows from the scene alone (nodes, pairs and their whole
// weights) is not in it, nor what each substep writes before it reads it.
#include <algorithm>
#include <stdexcept>

#include "compute/archive.h"
#include "frame/state_fields.h"
#include "mls/face_substep.h"
#include "mls/faces.h"
#include "mls/node_contact.h"
#include "mls/own_rate.h"
#include "mls/tissue.h"

namespace tissue_sim {

template <class Archive>
void fields(Archive& archive, MlsTouch& t) {
  archive(t.node, t.collider, t.hold);
}

template <class Archive>
void fields(Archive& archive, MlsGroupContact& c) {
  archive(c.near, c.touching, c.loads);
}

template <class Archive>
void fields(Archive& archive, MlsSlip& s) {
  archive(s.low, s.high, s.apart, s.gap, s.begun);
}

template <class Archive>
void fields(Archive& archive, MlsNodeContacts& c) {
  archive(c.begin, c.other, c.rest, c.slip, c.u_found, c.skin, c.until_look);
}

template <class Archive>
void fields(Archive& archive, MlsState& s) {
  archive(s.pairs.crossed, s.pairs.weight, s.u, s.v, s.inverse_moment, s.kappa, s.outer, s.sprung,
          s.spring, s.contact, s.node_contacts, s.until_list, s.dt, s.time);
}

template <class Archive>
void fields(Archive& archive, MlsSubsteps& s) {
  archive(s.stiffness_, s.stiffened_, s.most_rate_, s.limit_, s.length_, s.acceptance_);
}

template <class Archive>
void MlsTissue::each_field(Archive& archive) {
  archive.part("state", *state_);
  archive.part("pieces", pieces_, pieces_measured_);
  archive.part("substeps", substeps_, stiffening_, may_touch_);
}

std::vector<std::uint8_t> MlsTissue::save() {
  return_slips(state_->node_contacts);
  ArchiveWriter out;
  each_field(out);
  return out.take();
}

void MlsTissue::restore(Span<const std::uint8_t> saved) {
  ArchiveReader in(saved);
  each_field(in);
  MlsState& s = *state_;
  put_weights(s.pairs, s.lanes);
  for (std::int32_t i = 0; i < s.count(); ++i) {
    const auto first = s.pairs.crossed.begin() + s.pairs.begin[i],
               last = s.pairs.crossed.begin() + s.pairs.begin[i + 1];
    s.cut[i] = std::any_of(first, last, [](std::uint8_t crossed) { return crossed != 0; }) ? 1 : 0;
    const bool exposed = s.outer[i] != 0 && s.nodes.surface[i] == 0;
    s.place[4 * i + 3] = exposed ? 0.5f * s.edge[i] : s.nodes.depth[i];
    put_strained_volume(s, i, strained_volume(s, i));
    if (touches_by_faces(s)) remake_face(s, i);
  }
  s.springs.begin.clear();
  number_node_contacts(s);
  if (in.left() > 0) throw std::runtime_error("the state has more to it than this version knows");
}

}  // namespace tissue_sim
