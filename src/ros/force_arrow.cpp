#include "ros/force_arrow.h"

#include <algorithm>
#include <cmath>

namespace tissue_sim {
namespace {

/// A tool's shaft: a cylinder along -z of its frame.
struct Shaft {
  Vec3 axis = Vec3::Zero();    ///< a place on its middle line, in the tool's frame [m]
  double radius = 0;           ///< [m]
  double first = 0, last = 0;  ///< from where to where it is free for an arrow, from the tip [m]
};

Shaft shaft_of(const Tool& tool) {
  constexpr double kHandle = 0.1;  // as it is drawn
  switch (tool.type) {
    case ToolType::kScalpel:
      return {Vec3(-tool.blade_width / 2, 0, 0), tool.blade_width / 2, 0,
              tool.blade_length + kHandle};
    case ToolType::kGrasper:  // above the jaws, which open
      return {Vec3::Zero(), tool.jaw_width / 2, tool.jaw_length, tool.jaw_length + kHandle};
    case ToolType::kProbe:
      break;
  }
  return {Vec3::Zero(), tool.radius, 0, tool.length};
}

/// A direction across `axis`: to the right and to the front as RViz looks first.
Vec3 across(const Vec3& axis) {
  for (const Vec3& wanted : {Vec3(1, -1, 0), Vec3(0, 0, 1)}) {
    const Vec3 part = wanted.normalized() - wanted.normalized().dot(axis) * axis;
    if (part.norm() > 0.3) return part.normalized();
  }
  return axis.unitOrthogonal();
}

/// How far one must go from `x` along `direction` to be out of the box; 0 outside [m].
double way_out(const Vec3& x, const Vec3& direction, const Box& box) {
  double way = 1e300;
  for (int a = 0; a < 3; ++a) {
    if (x[a] <= box.min[a] || x[a] >= box.max[a]) return 0;
    if (direction[a] == 0) continue;
    const double side = direction[a] > 0 ? box.max[a] : box.min[a];
    way = std::min(way, (side - x[a]) / direction[a]);
  }
  return way;
}

}  // namespace

bool place_force_arrow(const Tool& tool, const Pose& pose, const Vec3& force, double scale,
                       Span<const Fragment> pieces, ForceArrow& arrow) {
  const double newtons = force.norm();
  if (!(newtons >= 0.005)) return false;
  const Shaft shaft = shaft_of(tool);
  arrow.unit = std::max(0.0005, std::min(0.02, shaft.radius));
  arrow.text_height = 2 * arrow.unit;
  const Vec3 back = pose.orientation * Vec3(0, 0, -1), side = across(back);
  const Vec3 foot = pose * shaft.axis + (shaft.radius + arrow.unit) * side;
  double along = shaft.first;
  for (std::size_t i = 0; i <= pieces.size(); ++i) {  // out of one may be into another
    double further = 0;
    for (const Fragment& piece : pieces) {
      const Box around = {piece.box.min.array() - arrow.unit, piece.box.max.array() + arrow.unit};
      further = std::max(further, way_out(foot + along * back, back, around));
    }
    if (further == 0) break;
    along += further + 1e-9;
    if (along > shaft.last) break;
  }
  along = std::min(along, shaft.last);

  // Whichever way it points, it keeps on its side of the shaft and comes no nearer to the tissue.
  const double length = 4 * arrow.unit + scale * newtons;
  const Vec3 way = length / newtons * force;
  arrow.start =
      foot + (along + std::max(0.0, -way.dot(back))) * back + std::max(0.0, -way.dot(side)) * side;
  arrow.end = arrow.start + way;
  // Beside an arrow along the shaft, above one across it; "0.00 N" is 3.6 times as wide as high.
  const double sideways = std::abs(way.dot(side)) / length;
  arrow.label = (arrow.start + arrow.end) / 2 +
                (1 - sideways) * (1.8 * arrow.text_height + 1.5 * arrow.unit) * side +
                sideways * (0.5 * arrow.text_height + 1.5 * arrow.unit) * back;
  return true;
}

}  // namespace tissue_sim
