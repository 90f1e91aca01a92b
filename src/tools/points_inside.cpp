#include "tools/points_inside.h"

#include <algorithm>
#include <cstdio>

#include "tools/tool_motion.h"

namespace tissue_sim {

namespace {

/// Whether a tool that touches tissue is so thin that it passes between points without having any
/// of them in it: they are half a cell apart, and more where tissue is drawn.
bool may_pass_unseen(const Scene& scene, const Tool& tool, const ToolLoad& load) {
  constexpr double kSeen = 1 / 3.0;  // [cells]
  const double tip = thinnest(tool);
  return tip > 0 && tip < kSeen * scene.cell_size && load.mean.force.norm() > 0;
}

}  // namespace

void sum_inside(FrameResult& result) {
  result.points_inside = 0;
  result.inside_depth = 0;
  for (const ToolLoad& load : result.loads) {
    result.points_inside += load.points_inside;
    result.inside_depth = std::max(result.inside_depth, load.inside_depth);
  }
}

std::string inside_warning(const Scene& scene, const FrameResult& result) {
  std::string all;
  for (std::size_t i = 0; i < result.loads.size() && i < scene.tools.size(); ++i) {
    const ToolLoad& load = result.loads[i];
    const Tool& tool = scene.tools[i];
    if (load.points_inside == 0) {
      if (!may_pass_unseen(scene, tool, load)) continue;
      char text[320];
      std::snprintf(
          text, sizeof(text),
          "%stip of tool '%s' is thinner than a third of a cell: it may pass through tissue "
          "without any point in it; cell_size %.2g would hold it off",
          all.empty() ? "" : "; ", tool.name.c_str(), thinnest(tool));
      all += text;
      continue;
    }
    // Tissue holds from a cell of its own thickness and of the tool's radius on. Where the tool is
    // thick enough, the tissue is not, or is pressed together to less than a cell.
    const double tip = thinnest(tool);
    const bool is_thin = tip < scene.cell_size;
    const double holds = is_thin ? tip : 0.5 * scene.cell_size;
    char text[320];
    std::snprintf(
        text, sizeof(text),
        "%s%d points of tissue lie in tool '%s', up to %.2g mm deep: %s; cell_size %.2g "
        "would hold them off",
        all.empty() ? "" : "; ", load.points_inside, tool.name.c_str(), 1e3 * load.inside_depth,
        is_thin ? "its tip is thinner than a cell" : "what it presses is thinner than a cell",
        holds);
    all += text;
  }
  return all;
}

}  // namespace tissue_sim
