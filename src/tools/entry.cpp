#include "tools/entry.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "tools/tool_motion.h"

namespace tissue_sim {

double way_out(const Tool& tool, const Pose& pose, double jaw, Span<const Point> points,
               double step, double farthest) {
  if (tool.type == ToolType::kScalpel) return 0;
  ToolMotion motion;  // in the tool's own axes: the points move instead
  motion.present = true;
  motion.jaw_begin = motion.jaw_end = static_cast<float>(std::clamp(jaw, 0.0, M_PI));
  const ToolPath path(tool, 0, motion, 1, 0);
  Collider colliders[2];
  path.at(1, colliders);
  double wide = tool.radius;  // beside the shaft [m]
  if (has_jaws(tool.type)) wide = 2 * tool.jaw_length;
  if (tool.type == ToolType::kPlate) wide = 0.5 * std::hypot(tool.size.x(), tool.size.y());
  const int steps = static_cast<int>(std::ceil(farthest / step));
  std::vector<char> inside(static_cast<std::size_t>(steps) + 1, 0);
  const Quat inverse = pose.orientation.conjugate();
  const auto look = [&](int first, int last) {
    for (const Point& point : points) {
      const Vec3 local = inverse * (Vec3(point.x, point.y, point.z) - pose.position);
      if (std::hypot(local.x(), local.y()) > wide) continue;
      for (int k = first; k <= last && local.z() + k * step < wide; ++k) {
        const float x[3] = {static_cast<float>(local.x()), static_cast<float>(local.y()),
                            static_cast<float>(local.z() + k * step)};
        for (int c = 0; c < path.count(); ++c) inside[k] |= gap(colliders[c], x).distance < 0;
      }
    }
  };
  look(0, 0);
  if (inside[0]) look(1, steps);
  const auto free = std::find(inside.begin(), inside.end(), 0);
  return free == inside.end() ? -1 : step * static_cast<double>(free - inside.begin());
}

}  // namespace tissue_sim
