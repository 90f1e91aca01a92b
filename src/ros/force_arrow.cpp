#include "ros/force_arrow.h"

#include <algorithm>
#include <cmath>

namespace tissue_sim {
namespace {

/// What an arrow stands beside: a cylinder along -z of the tool's frame.
struct Shaft {
  Vec3 axis = Vec3::Zero();    ///< a place on its middle line, in the tool's frame [m]
  double radius = 0;           ///< [m]
  double unit = 0;             ///< what sizes go by [m]
  double first = 0, last = 0;  ///< from where to where an arrow may stand, from the tip [m]
};

Shaft shaft_of(const Tool& tool) {
  constexpr double kHandle = 0.1;  // as it is drawn; for tools without one as far
  const double r = tool.radius;
  switch (tool.type) {
    case ToolType::kScalpel: {
      const double half = tool.blade_width / 2;
      return {Vec3(-half, 0, 0), half, half, 0, tool.blade_length + kHandle};
    }
    case ToolType::kGrasper: {  // above the jaws, which open
      const double half = tool.jaw_width / 2, l = tool.jaw_length;
      return {Vec3::Zero(), half, half, l, l + kHandle};
    }
    case ToolType::kScissors: {
      const double half = tool.blade_width / 2, l = tool.jaw_length;
      return {Vec3::Zero(), half, half, l, l + kHandle};
    }
    case ToolType::kBall:
      return {Vec3::Zero(), r, r, 0, 2 * r + kHandle};
    case ToolType::kPlate: {  // on its back
      const double thick = tool.size.z();
      return {Vec3::Zero(), 0, thick, 2 * thick, thick + kHandle};
    }
    case ToolType::kProbe:
    case ToolType::kPunch:
    case ToolType::kSuction:
    case ToolType::kIrrigation:
      break;
  }
  return {Vec3::Zero(), r, r, 0, std::max(tool.length, 2 * r)};
}

/// A direction across `axis`: to the right and a little to the front as RViz looks first.
Vec3 across(const Vec3& axis) {
  for (const Vec3& wanted : {Vec3(1, 0, 0), Vec3(0, 0, 1)}) {
    const Vec3 part = wanted - wanted.dot(axis) * axis;
    if (part.norm() > 0.3) return part.normalized();
  }
  return axis.unitOrthogonal();
}

/// Whether the line from `a` to `b` passes through the box, by the share of it within each slab.
bool meets(const Vec3& a, const Vec3& b, const Box& box) {
  double begin = 0, end = 1;
  for (int k = 0; k < 3; ++k) {
    const double way = b[k] - a[k], low = box.min[k] - a[k], high = box.max[k] - a[k];
    if (way == 0) {
      if (low > 0 || high < 0) return false;
      continue;
    }
    begin = std::max(begin, std::min(low / way, high / way));
    end = std::min(end, std::max(low / way, high / way));
  }
  return begin <= end;
}

}  // namespace

bool place_force_arrow(const Tool& tool, const Pose& pose, const Vec3& force, double scale,
                       Span<const Fragment> pieces, ForceArrow& arrow) {
  const double newtons = force.norm();
  if (!(newtons >= 0.005)) return false;
  const Shaft shaft = shaft_of(tool);
  arrow.unit = std::max(0.0005, std::min(0.005, shaft.unit));
  arrow.text_height = 2 * arrow.unit;
  const Vec3 back = pose.orientation * Vec3(0, 0, -1), side = across(back);
  const Vec3 foot = pose * shaft.axis + (shaft.radius + arrow.unit) * side;
  // Whichever way it points, it keeps on its side of the shaft.
  const Vec3 way = (4 * arrow.unit / newtons + scale) * force;
  const Vec3 first =
      foot + std::max(0.0, -way.dot(back)) * back + std::max(0.0, -way.dot(side)) * side;
  const auto in_tissue = [&](double along) {
    const Vec3 start = first + along * back;
    return std::any_of(pieces.begin(), pieces.end(), [&](const Fragment& piece) {
      return meets(start, start + way,
                   {piece.box.min.array() - arrow.unit, piece.box.max.array() + arrow.unit});
    });
  };
  double along = shaft.first;
  while (along < shaft.last && in_tissue(along)) along += 0.5 * arrow.unit;
  arrow.start = first + std::min(along, shaft.last) * back;
  arrow.end = arrow.start + way;
  // "0.00 N" is 4.4 times as wide as it is high.
  arrow.label = arrow.start + way / 2 +
                (std::abs(way.dot(side)) / 2 + 2.6 * arrow.text_height + arrow.unit) * side;
  return true;
}

}  // namespace tissue_sim
