// The state of tissue as bytes.
#include <stdexcept>

#include "frame/state_check.h"
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
  archive(v.x, v.moved, v.v, v.reference, v.mass, v.volume, v.body, v.anchored, v.surface,
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
          s.starts, s.centres, s.left_whole, s.relieved_in);
}

namespace {

template <class Kind>
void check_set(const ConstraintSet<Kind>& set, int vertices) {
  check_sizes("constraints", set.vertices, set.numbers, set.colour);
  check_indices(set.vertices, 0, vertices, "constraints");
  check_indices(set.colour, -1, 30000, "colours");
  check_numbers(set.numbers, 1e37, "constraints");
  for (const auto& of : set.vertices) {
    for (std::size_t i = 1; i < of.size(); ++i) {
      check_state(std::find(of.begin(), of.begin() + i, of[i]) == of.begin() + i, "constraints");
    }
  }
}

/// Of a state that was read, but for its scene.
void check(const State& s) {
  const Vertices& v = s.vertices;
  const int count = v.size();
  const auto padded = static_cast<std::size_t>(4) * (count + kPadding);
  check_sizes("vertices", v.reference, v.mass, v.volume, v.body, v.anchored, v.surface, v.cut_links,
              v.whole_links, s.stroke, s.copy_of, s.blade_normal, s.blade_point);
  check_state(v.x.size() == padded && v.moved.size() == padded && v.v.size() == padded, "vertices");
  check_state(s.half_depth.empty() || s.half_depth.size() == v.reference.size(), "depths");
  const auto bodies = static_cast<std::int64_t>(s.scene.bodies.size());
  check_indices(v.body, 0, bodies, "bodies");
  check_state(static_cast<std::int64_t>(s.volume_of_body.size()) == bodies, "bodies");
  check_numbers(v.mass, 1e9, "masses");
  check_numbers(v.volume, 1e9, "volumes");
  check_numbers(s.half_depth, kFarthest, "depths");
  check_numbers(s.volume_of_body, 1e12, "volumes");
  for (int i = 0; i < count; ++i) {
    check_numbers(v.reference[i], kFarthest, "places");
    check_numbers(s.blade_normal[i], 1e9, "cuts");
    check_numbers(s.blade_point[i], 1e9, "cuts");
    for (int a = 0; a < 3; ++a) {
      check_state(
          std::abs(v.x[4 * i + a]) <= kFarthest && std::abs(v.moved[4 * i + a]) <= kFarthest,
          "places");
      check_state(std::abs(v.v[4 * i + a]) <= kFastestTissue, "speeds");
    }
    check_state(s.copy_of[i] >= -1 && s.copy_of[i] <= i, "copies");
  }
  check_indices(s.stroke, -1, std::int64_t{1} << 31, "strokes");
  check_indices(s.triangles, 0, count, "triangles");
  check_sizes("cut triangles", s.triangles, s.cut);
  check_indices(s.tetrahedra, 0, count, "tetrahedra");
  for (const InternalPair& p : s.internal) {
    check_state(p.a >= 0 && p.a < p.b && p.b < count && std::isfinite(p.area), "internal links");
  }
  check_set(s.links, count);
  check_set(s.bends, count);
  check_set(s.strains, count);
  check_set(s.elastics, count);
  check_state(s.edge_count >= 0 && s.edge_count <= s.links.size(), "edges");
  check_indices(s.cut_edges, 0, count, "cut edges");
  for (const auto* sets : {&s.fronts, &s.starts}) {
    check_state(sets->size() == s.scene.tools.size() + 1, "fronts");
    check_indices(*sets, 0, count, "fronts");
  }
  const auto tetrahedra = static_cast<std::int32_t>(s.tetrahedra.size());
  for (const InnerFace& f : s.faces) {
    for (int k = 0; k < 2; ++k) {
      check_state(f.tetrahedron[k] >= 0 && f.tetrahedron[k] < tetrahedra && f.opposite[k] >= 0 &&
                      f.opposite[k] < 4,
                  "faces");
    }
  }
  check_state(s.centres.empty() || s.centres.size() == s.tetrahedra.size(), "centres");
  check_numbers(s.centres, 1e6, "centres");
  check_state(std::isfinite(s.mean_edge), "edges");
  check_state(s.relieved_in.empty() || s.relieved_in.size() == s.scene.bodies.size(), "tears");
  check_numbers(s.relieved_in, 1e9, "tears");
  for (const auto& wound : s.wounds) {
    for (const Vec3& x : wound) check_numbers(x, 1e9, "wounds");
  }
  check_state(s.left_whole.size() == s.scene.tools.size(), "blades");
  for (const auto& of_tool : s.left_whole) {
    for (const LeftWhole& l : of_tool) {
      check_state(l.vertex >= 0 && l.vertex < count, "blades");
      try {
        check_path(l.path);
      } catch (const std::invalid_argument&) {
        check_state(false, "blades");
      }
    }
  }
}

}  // namespace
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
  pbd::check(*state_);
  const pbd::Vertices& vertices = state_->vertices;
  check_pieces(pieces_, vertices.reference.size(), state_->scene.bodies.size());
  if (in.left() > 0) throw std::runtime_error("the state has more to it than this version knows");
  pbd::pack(*state_);
  pieces_measured_ = false;
  state_changed();
}

}  // namespace tissue_sim
