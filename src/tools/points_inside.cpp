#include "tools/points_inside.h"

#include <algorithm>
#include <cstdio>

#include "tools/tool_motion.h"

namespace tissue_sim {

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
    if (load.points_inside == 0) continue;
    const Tool& tool = scene.tools[i];
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
