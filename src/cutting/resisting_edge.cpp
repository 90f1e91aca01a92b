#include "cutting/resisting_edge.h"

#include <algorithm>

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

ResistingEdges resisting_edges(const Scene& scene) {
  constexpr double kPiece = 0.125;  // [cells]
  ResistingEdges edges;
  if (!resists(scene)) return edges;
  for (std::size_t i = 0; i < scene.tools.size(); ++i) {
    const Tool& tool = scene.tools[i];
    if (tool.type != ToolType::kScalpel) continue;
    const std::vector<Vec3> edge = blade_path(tool, {}).edge;
    const Vec3 onward[2] = {Vec3::UnitX(), Vec3::UnitZ()};
    for (int side = 0; side < 2; ++side) {
      const Vec3& from = edge[side];
      const Vec3 way = edge[side + 1] - from;
      const double length = way.norm();
      const int count =
          std::max(1, static_cast<int>(std::ceil(length / (kPiece * scene.cell_size))));
      for (int k = 0; k < count; ++k) {
        edges.pieces.push_back({static_cast<int>(i), from + (k + 0.5) / count * way, way / length,
                                onward[side], length / count, tool.blade_edge_radius});
      }
    }
  }
  edges.holds.resize(edges.pieces.size());
  return edges;
}

std::vector<BladePath> free_paths(const Scene& scene, const ResistingEdges& edges,
                                  const FrameInput& input, double begin, double end) {
  std::vector<BladePath> paths = blade_paths(scene, input, begin, end);
  if (std::none_of(edges.holds.begin(), edges.holds.end(),
                   [](const EdgeHold& h) { return h.place.body >= 0; })) {
    return paths;
  }
  std::vector<BladePath> parts;
  std::size_t path = 0;
  for (std::size_t i = 0, tool_end = 0; i < edges.pieces.size(); i = tool_end) {
    const int tool = edges.pieces[i].tool;
    while (tool_end < edges.pieces.size() && edges.pieces[tool_end].tool == tool) ++tool_end;
    if (!input.tools[tool].present) continue;
    const BladePath& whole = paths.at(path++);
    BladePath part{{}, whole.poses, {}};
    for (; i < tool_end; ++i) {
      const EdgePiece& piece = edges.pieces[i];
      const Vec3 half = 0.5 * piece.length * piece.along;
      if (edges.holds[i].place.body < 0) {
        if (part.edge.empty()) part.edge.push_back(piece.middle - half);
        part.edge.push_back(piece.middle + half);
      }
      if (part.edge.empty() || (edges.holds[i].place.body < 0 && i + 1 < tool_end)) continue;
      parts.push_back(part);
      part.edge.clear();
    }
  }
  return parts;
}

}  // namespace tissue_sim
