#include "cutting/resisting_edge.h"

#include <algorithm>
#include <utility>

#include "cutting/edge_corners.h"
#include "tools/tool_motion.h"

namespace tissue_sim {

bool resists(const Scene& scene) {
  const auto is_tough = [&](const std::string& name) {
    return find_material(scene, name).toughness > 0;
  };
  return std::any_of(scene.bodies.begin(), scene.bodies.end(), [&](const Body& body) {
    return is_tough(body.material) ||
           std::any_of(body.inclusions.begin(), body.inclusions.end(),
                       [&](const Inclusion& part) { return is_tough(part.material); });
  });
}

bool ResistingEdges::any_holds() const {
  return std::any_of(holds.begin(), holds.end(),
                     [](const EdgeHold& h) { return h.place.body >= 0; });
}

void ResistingEdges::bring_held() const {
  if (distant == nullptr) return;
  std::vector<EdgePlace> places;
  for (const EdgeHold& h : holds) {
    if (h.place.body < 0) continue;
    places.push_back(h.place);
    places.push_back(h.swept);
  }
  if (!places.empty()) distant->bring_motion_around(places);
}

Pose ResistingEdges::blade_of(const EdgePiece& piece, const FrameInput& input, double s) const {
  return blade_at(tools[piece.tool], input.tools[piece.tool], s, piece.side);
}

bool ResistingEdges::seeks(const EdgePiece& piece, const FrameInput& input, double begin) const {
  return cuts(tools[piece.tool], input.tools[piece.tool]) && !is_past(piece, input, begin);
}

bool ResistingEdges::is_past(const EdgePiece& piece, const FrameInput& input, double s) const {
  const Tool& tool = tools[piece.tool];
  return tool.type == ToolType::kScissors &&
         piece.middle.z() + tool.jaw_length <= crossing_at(tool, input.tools[piece.tool], s);
}

bool may_cut(const Scene& scene, const ResistingEdges& edges, const FrameInput& input) {
  return edges.any_holds() || !blade_paths(scene, input, 0, 1).empty();
}

ResistingEdges resisting_edges(const Scene& scene) {
  constexpr double kPiece = 0.125;  // [cells]
  ResistingEdges edges;
  if (!resists(scene)) return edges;
  edges.tools = scene.tools;
  for (std::size_t i = 0; i < scene.tools.size(); ++i) {
    const Tool& tool = scene.tools[i];
    const double tip = tool.type == ToolType::kScalpel ? 0.5 * tool.blade_thickness : 0;
    const auto add = [&](int side, const Vec3& from, const Vec3& to, const Vec3& onward) {
      const Vec3 way = to - from;
      const double length = way.norm();
      const int count =
          std::max(1, static_cast<int>(std::ceil(length / (kPiece * scene.cell_size))));
      for (int k = 0; k < count; ++k) {
        edges.pieces.push_back({static_cast<int>(i), side, from + (k + 0.5) / count * way,
                                way / length, onward, length / count, tool.blade_edge_radius, tip});
      }
    };
    if (tool.type == ToolType::kScalpel) {
      const std::vector<Vec3> edge = blade_path(tool, {}).edge;
      add(0, edge[0], edge[1], Vec3::UnitX());
      add(0, edge[1], edge[2], Vec3::UnitZ());
    } else if (tool.type == ToolType::kScissors) {
      for (const int side : {0, 1}) {
        add(side, Vec3(0, 0, -tool.jaw_length), Vec3::Zero(), Vec3::UnitX());
      }
    }
  }
  edges.holds.resize(edges.pieces.size());
  return edges;
}

std::vector<std::size_t> corners_of(std::initializer_list<const std::vector<Vec3>*> lines,
                                    double by) {
  std::vector<std::size_t> kept(1, 0);
  // A stretch [a, b] is straight or is taken apart at what is farthest off.
  std::vector<std::pair<std::size_t, std::size_t>> left(1, {0, (*lines.begin())->size() - 1});
  while (!left.empty()) {
    const auto [a, b] = left.back();
    left.pop_back();
    double most = by * by;
    std::size_t at = b;
    for (std::size_t i = a + 1; i < b; ++i) {
      for (const std::vector<Vec3>* line : lines) {
        const Vec3 way = (*line)[b] - (*line)[a], off = (*line)[i] - (*line)[a];
        const double along = way.squaredNorm() > 0 ? way.dot(off) / way.squaredNorm() : 0;
        const double far = (off - std::clamp(along, 0.0, 1.0) * way).squaredNorm();
        if (far > most) most = far, at = i;
      }
    }
    if (at < b) {
      left.push_back({at, b});
      left.push_back({a, at});
    } else if (b > kept.back()) {
      kept.push_back(b);
    }
  }
  return kept;
}

/// What a scalpel's line so far behind its edges sweeps: tissue there went around them at a side of
/// a body, where little holds it, or came across their cut. It hangs through the blade.
static void add_behind(const Scene& scene, const FrameInput& input, double begin, double end,
                       std::vector<BladePath>& paths) {
  constexpr double kBehind = 2;  // cells
  for (std::size_t i = 0; i < scene.tools.size(); ++i) {
    const Tool& tool = scene.tools[i];
    if (tool.type != ToolType::kScalpel || !cuts(tool, input.tools[i])) continue;
    const double behind =
        std::min({kBehind * scene.cell_size, 0.5 * tool.blade_width, 0.5 * tool.blade_length});
    BladePath path{
        blade_path(tool, {}).edge,
        {blade_at(tool, input.tools[i], begin, 0), blade_at(tool, input.tools[i], end, 0)},
        {}};
    for (std::size_t k = 0; k < path.edge.size(); ++k) {
      path.edge[k] -= behind * Vec3(k < 2 ? 1 : 0, 0, k > 0 ? 1 : 0);
    }
    paths.push_back(std::move(path));
  }
}

std::vector<BladePath> free_paths(const Scene& scene, const ResistingEdges& edges,
                                  const FrameInput& input, double begin, double end) {
  if (edges.pieces.empty()) return blade_paths(scene, input, begin, end);
  std::vector<BladePath> parts;
  if (!edges.any_holds()) parts = blade_paths(scene, input, begin, end);
  add_behind(scene, input, begin, end, parts);
  if (!edges.any_holds()) return parts;
  for (std::size_t i = 0, last = 0; i < edges.pieces.size(); i = last) {
    const EdgePiece& first = edges.pieces[i];
    while (last < edges.pieces.size() && edges.pieces[last].tool == first.tool &&
           edges.pieces[last].side == first.side) {
      ++last;
    }
    if (!input.tools[first.tool].present) continue;
    BladePath part{
        {}, {edges.blade_of(first, input, begin), edges.blade_of(first, input, end)}, {}};
    std::size_t begun = i;  // the piece with which a straight stretch began
    for (; i < last; ++i) {
      const EdgePiece& piece = edges.pieces[i];
      const Vec3 half = 0.5 * piece.length * piece.along;
      const bool is_free = edges.seeks(piece, input, begin) &&
                           (edges.holds[i].place.body < 0 || edges.holds[i].lets_go == 2 ||
                            edges.is_past(piece, input, end));
      if (is_free) {
        if (part.edge.empty()) {
          part.edge.push_back(piece.middle - half);
          begun = i;
        } else if (piece.onward == edges.pieces[begun].onward) {
          part.edge.pop_back();
        } else {
          begun = i;
        }
        part.edge.push_back(piece.middle + half);
      }
      if (part.edge.empty() || (is_free && i + 1 < last)) continue;
      parts.push_back(part);
      part.edge.clear();
    }
  }
  return parts;
}

}  // namespace tissue_sim
