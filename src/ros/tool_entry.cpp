#include "ros/tool_entry.h"

#include <algorithm>
#include <cstdio>
#include <vector>

#include "tools/entry.h"

namespace tissue_sim {
namespace {

constexpr double kSpeed = 0.1;     // as hands are [m/s]
constexpr double kFarthest = 0.3;  // through any organ [m]

}  // namespace

std::string ToolEntry::place(const Tool& tool, const Pose& pose, double jaw, double cell_size,
                             Tissue& tissue) {
  std::vector<std::uint8_t> cloud;
  const int count = tissue.read_points({}, cloud);
  left_ = way_out(tool, pose, jaw,
                  {reinterpret_cast<const Point*>(cloud.data()), static_cast<std::size_t>(count)},
                  0.5 * cell_size, kFarthest);
  if (left_ == 0) return "";
  char text[200];
  if (left_ < 0) {
    left_ = 0;
    return tool.name +
           " is placed within tissue and finds no way out along its shaft: its forces "
           "are those of a tool with tissue on all sides";
  }
  std::snprintf(text, sizeof text,
                "%s is placed within tissue: it comes in along its shaft, %.0f mm at %g m/s",
                tool.name.c_str(), 1e3 * left_, kSpeed);
  return text;
}

Pose ToolEntry::next(const Pose& pose, double frame_time) {
  const Pose drawn_back = {pose * Vec3(0, 0, -left_), pose.orientation};
  left_ = std::max(0.0, left_ - kSpeed * frame_time);
  return drawn_back;
}

}  // namespace tissue_sim
