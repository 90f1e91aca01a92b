// What instruments look like: the shapes that push, and the handles behind them.
#pragma once

#include <vector>

#include "tissue_sim/tool.h"

namespace tissue_sim {

struct ToolShape {
  enum Kind { kBox, kCylinder, kBall } kind = kBox;
  Pose pose;                 ///< of its centre; a cylinder lies along its z
  Vec3 size = Vec3::Zero();  ///< along its own axes [m]
  bool is_handle = false;    ///< nothing but seen
};

/// At the end of the motion. A blade is drawn half a millimetre thick at least.
std::vector<ToolShape> tool_shapes(const Tool& tool, const ToolMotion& motion);

/// Where the ray `from` + t `along` first meets it from outside, between t's bounds, and the
/// outward normal there. False where it does not.
bool meet(const ToolShape& shape, const Vec3& from, const Vec3& along, double near, double far,
          double& t, Vec3& normal);

}  // namespace tissue_sim
