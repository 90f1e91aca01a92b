// The state of tissue as bytes. What follows from the scene alone (nodes, pairs and their whole
// weights) is not in it, nor what each substep writes before it reads it.
#include <algorithm>
#include <stdexcept>

#include "compute/archive.h"
#include "frame/state_check.h"
#include "frame/state_fields.h"
#include "mls/face_substep.h"
#include "mls/faces.h"
#include "mls/node_contact.h"
#include "mls/own_rate.h"
#include "mls/tissue.h"
#include "tools/frame_colliders.h"

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
          s.spring, s.contact, s.node_contacts, s.edges.holds, s.until_list, s.dt, s.time);
}

template <class Archive>
void fields(Archive& archive, MlsSubsteps& s) {
  archive(s.stiffness_, s.stretched_, s.most_rate_, s.limit_, s.length_, s.acceptance_);
}

template <class Archive>
void MlsTissue::each_field(Archive& archive) {
  archive.part("state", *state_);
  archive.part("pieces", pieces_, pieces_measured_);
  archive.part("substeps", substeps_, stiffening_, may_touch_);
}

namespace {

/// Of a state that was read into one of the same scene, which had these sizes.
struct MlsSizes {
  explicit MlsSizes(const MlsState& s)
      : pairs(s.pairs.other.size()),
        node(s.kappa.size()),
        vector(s.u.size()),
        groups(s.contact.size()) {}
  std::size_t pairs, node, vector, groups;

  void check(const MlsState& s) const {
    check_state(s.pairs.crossed.size() == pairs && s.pairs.weight.size() == pairs &&
                    (s.spring.empty() || s.spring.size() == pairs),
                "pairs");
    check_state(s.u.size() == vector && s.v.size() == vector && s.kappa.size() == node &&
                    s.outer.size() == node && s.sprung.size() == node && s.contact.size() == groups,
                "nodes");
    for (const auto& moment : s.inverse_moment) check_state(moment.size() == node, "moments");
    if (s.spring.empty()) check_indices(s.sprung, 0, 1, "springs");
    check_numbers(s.pairs.weight, 1e30, "weights");
    check_numbers(s.u, kFarthest, "places");
    check_numbers(s.v, kFastestTissue, "speeds");
    const int colliders = collider_count(s.scene), nodes = s.count();
    for (std::size_t g = 0; g < groups; ++g) {
      const MlsGroupContact& c = s.contact[g];
      const auto first = static_cast<std::int32_t>(g) * kMlsGroup;
      check_indices(c.near, 0, colliders, "contacts");
      check_state(c.loads.empty() || static_cast<int>(c.loads.size()) == colliders, "loads");
      for (const MlsTouch& t : c.touching) {
        check_state(t.node >= first && t.node < std::min(nodes, first + kMlsGroup) &&
                        t.collider >= 0 && t.collider < colliders,
                    "contacts");
      }
    }
    const MlsNodeContacts& c = s.node_contacts;
    if (!c.begin.empty()) {
      check_begins(c.begin, static_cast<std::size_t>(nodes), c.other.size(), "contacts");
      const bool faces = s.scene.mls.contact == MlsContact::kFaces;
      check_state(faces ? c.slip.size() == c.other.size() : c.rest.size() == c.other.size(),
                  "contacts");
      check_indices(c.other, 0, nodes, "contacts");
      // Each pair stands at both of its nodes.
      for (std::int32_t i = 0; i < nodes; ++i) {
        for (std::int32_t e = c.begin[i]; e < c.begin[i + 1]; ++e) {
          const auto begin = c.other.begin() + c.begin[c.other[e]],
                     end = c.other.begin() + c.begin[c.other[e] + 1];
          check_state(c.other[e] != i && std::find(begin, end, i) != end, "contacts");
        }
      }
    }
    check_sizes("edges", s.edges.pieces, s.edges.holds);
    for (const EdgeHold& h : s.edges.holds) {
      check_numbers(h.ahead, 2, "edges");
      check_numbers(h.slides, 2, "edges");
      check_state(h.stiffness >= 0 && h.stiffness < 1e30, "edges");
      check_state(h.place.body == h.swept.body && h.lets_go == 0, "edges");
      for (const EdgePlace* p : {&h.place, &h.swept}) {
        check_numbers(p->at, 1e3, "edges");
        check_state(p->body == -1 || (p->site[0] >= 0 && p->site[0] < nodes), "edges");
      }
    }
    check_state(std::isfinite(s.dt) && s.dt >= 0 && std::isfinite(s.time), "time");
  }
};

}  // namespace

std::vector<std::uint8_t> MlsTissue::save() {
  return_slips(state_->node_contacts);
  ArchiveWriter out;
  each_field(out);
  return out.take();
}

void MlsTissue::restore(Span<const std::uint8_t> saved) {
  ArchiveReader in(saved);
  MlsState& s = *state_;
  const MlsSizes sizes(s);
  each_field(in);
  sizes.check(s);
  check_pieces(pieces_, static_cast<std::size_t>(s.count()), s.scene.bodies.size());
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
