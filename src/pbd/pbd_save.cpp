// The state of tissue as bytes.
#include <stdexcept>

#include "frame/state_fields.h"
#include "pbd/pbd_tissue.h"

namespace tissue_sim {
namespace pbd {

template <class Archive, class Kind>
void fields(Archive& archive, ConstraintSet<Kind>& set) {
  archive(set.vertices, set.numbers, set.colour);
}

template <class Archive>
void fields(Archive& archive, Vertices& v) {
  archive(v.x, v.predicted, v.v, v.reference, v.mass, v.volume, v.body, v.anchored, v.surface,
          v.cut_links, v.whole_links);
}

template <class Archive>
void fields(Archive& archive, InternalPair& p) {
  archive(p.a, p.b, p.area, p.is_late);
}

template <class Archive>
void fields(Archive& archive, InnerFace& f) {
  archive(f.tetrahedron, f.opposite, f.is_cut);
}

template <class Archive>
void fields(Archive& archive, LeftWhole& l) {
  archive(l.path, l.vertex);
}

template <class Archive>
void fields(Archive& archive, State& s) {
  archive(s.vertices, s.triangles, s.cut, s.tetrahedra, s.internal, s.half_depth, s.links,
          s.edge_count, s.bends, s.strains, s.elastics, s.volume_of_body, s.stroke, s.copy_of,
          s.blade_normal, s.blade_point, s.cut_edges, s.faces, s.mean_edge, s.wounds, s.fronts,
          s.starts, s.centres, s.left_whole);
}

}  // namespace pbd

template <class Archive>
void PbdTissue::each_field(Archive& archive) {
  archive.part("state", *state_, next_stroke_);
  archive.part("pieces", pieces_);
}

std::vector<std::uint8_t> PbdTissue::save() {
  pull();
  ArchiveWriter out;
  each_field(out);
  return out.take();
}

void PbdTissue::restore(Span<const std::uint8_t> saved) {
  ArchiveReader in(saved);
  each_field(in);
  if (in.left() > 0) throw std::runtime_error("the state has more to it than this version knows");
  pbd::pack(*state_);
  pieces_measured_ = false;
  state_changed();
}

}  // namespace tissue_sim
