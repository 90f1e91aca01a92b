#include "tools/tool_shapes.h"

#include <algorithm>
#include <cmath>

#include "tools/tool_motion.h"

namespace tissue_sim {
namespace {

constexpr double kThinnestBlade = 0.0005;  // [m]
constexpr double kHandle = 0.1;            // long [m]

/// The larger of the two, or the smaller, as the interval of a ray within a slab needs them.
struct Interval {
  double in, out;
  Vec3 normal;  ///< where it comes in

  /// Cuts off what lies outside of low <= origin + t * step <= high along this axis.
  bool clip(double origin, double step, double low, double high, const Vec3& axis) {
    if (std::fabs(step) < 1e-300) return origin >= low && origin <= high;
    const double a = ((step > 0 ? low : high) - origin) / step;
    const double b = ((step > 0 ? high : low) - origin) / step;
    if (a > in) in = a, normal = step > 0 ? Vec3(-axis) : axis;
    out = std::min(out, b);
    return in <= out;
  }
};

}  // namespace

std::vector<ToolShape> tool_shapes(const Tool& tool, const ToolMotion& motion) {
  std::vector<ToolShape> shapes;
  const auto add = [&shapes](ToolShape::Kind kind, const Pose& pose, const Vec3& center,
                             const Vec3& size, bool is_handle = false) {
    shapes.push_back({kind, {pose * center, pose.orientation}, size, is_handle});
  };
  const Pose& pose = motion.end;
  switch (tool.type) {
    case ToolType::kScalpel: {
      const double w = tool.blade_width, l = tool.blade_length;
      add(ToolShape::kBox, pose, Vec3(-w / 2, 0, -l / 2),
          Vec3(w, std::max(tool.blade_thickness, kThinnestBlade), l));
      add(ToolShape::kCylinder, pose, Vec3(-w / 2, 0, -l - kHandle / 2), Vec3(w, w, kHandle), true);
      break;
    }
    case ToolType::kGrasper: {
      const double l = tool.jaw_length, w = tool.jaw_width;
      for (const double sign : {-1.0, 1.0}) {
        const Quat swing(Eigen::AngleAxisd(0.5 * sign * motion.jaw_end, Vec3::UnitY()));
        add(ToolShape::kBox, {pose * Vec3(0, 0, -l), pose.orientation * swing},
            Vec3(0.25 * sign * w, 0, l / 2), Vec3(w / 2, w, l));
      }
      add(ToolShape::kCylinder, pose, Vec3(0, 0, -l - kHandle / 2), Vec3(w, w, kHandle), true);
      break;
    }
    case ToolType::kScissors: {
      const double l = tool.jaw_length, w = tool.blade_width;
      for (const int side : {0, 1}) {
        add(ToolShape::kBox, blade_at(tool, motion, 1, side), Vec3(-w / 2, 0, -l / 2),
            Vec3(w, std::max(tool.blade_thickness, kThinnestBlade), l));
      }
      add(ToolShape::kCylinder, pose, Vec3(0, 0, -l - kHandle / 2), Vec3(w, w, kHandle), true);
      break;
    }
    case ToolType::kBall:
      add(ToolShape::kBall, pose, Vec3(0, 0, -tool.radius), Vec3::Constant(2 * tool.radius));
      break;
    case ToolType::kPunch:
    case ToolType::kSuction:
    case ToolType::kIrrigation:
      add(ToolShape::kCylinder, pose, Vec3(0, 0, -tool.length / 2),
          Vec3(2 * tool.radius, 2 * tool.radius, tool.length));
      break;
    case ToolType::kPlate:
      add(ToolShape::kBox, pose, Vec3(0, 0, -tool.size.z() / 2), tool.size);
      break;
    case ToolType::kProbe: {  // the capsule that touches: its tip is the tool's origin
      const double r = tool.radius, l = std::max(tool.length, 2 * r);
      add(ToolShape::kBall, pose, Vec3(0, 0, -r), Vec3::Constant(2 * r));
      add(ToolShape::kCylinder, pose, Vec3(0, 0, -(r + l) / 2), Vec3(2 * r, 2 * r, l - r));
      add(ToolShape::kBall, pose, Vec3(0, 0, -l), Vec3::Constant(2 * r));
      break;
    }
  }
  return shapes;
}

bool meet(const ToolShape& shape, const Vec3& from, const Vec3& along, double near, double far,
          double& t, Vec3& normal) {
  const Vec3 to = from - shape.pose.position;
  const double reach = 0.5 * shape.size.norm(), square = along.squaredNorm();
  const double side = to.dot(along);
  if (to.squaredNorm() - side * side / square > reach * reach) return false;
  const Quat back = shape.pose.orientation.conjugate();
  const Vec3 o = back * to, d = back * along, half = 0.5 * shape.size;
  Interval ray{-1e300, 1e300, Vec3::UnitZ()};
  if (shape.kind == ToolShape::kBox) {
    for (int a = 0; a < 3; ++a) {
      if (!ray.clip(o[a], d[a], -half[a], half[a], Vec3::Unit(a))) return false;
    }
  } else {
    // A round shape: the ball, or the cylinder about z between its ends.
    const bool is_ball = shape.kind == ToolShape::kBall;
    const int axes = is_ball ? 3 : 2;
    double a = 0, b = 0, c = -half.x() * half.x();
    for (int i = 0; i < axes; ++i) a += d[i] * d[i], b += o[i] * d[i], c += o[i] * o[i];
    if (a > 1e-300) {
      const double root = b * b - a * c;
      if (root < 0) return false;
      ray.in = (-b - std::sqrt(root)) / a;
      ray.out = (-b + std::sqrt(root)) / a;
      ray.normal = o + ray.in * d;
      if (!is_ball) ray.normal.z() = 0;
      ray.normal.normalize();
    } else if (c > 0) {
      return false;
    }
    if (!is_ball && !ray.clip(o.z(), d.z(), -half.z(), half.z(), Vec3::UnitZ())) return false;
  }
  if (!(ray.in >= near && ray.in <= far)) return false;
  t = ray.in;
  normal = shape.pose.orientation * ray.normal;
  return true;
}

}  // namespace tissue_sim
