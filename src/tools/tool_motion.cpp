#include "tools/tool_motion.h"

#include <algorithm>
#include <cmath>

namespace tissue_sim {
namespace {

constexpr double kRim = 0.25;    // of a tube's radius: how round the edge of its mouth is
constexpr double kInside = 0.3;  // cells: springs at their limit give way by a quarter

void place(const Pose& pose, Collider& collider) {
  const Eigen::Matrix3d r = pose.orientation.toRotationMatrix();
  for (int i = 0; i < 3; ++i) {
    collider.position[i] = static_cast<float>(pose.position[i]);
    for (int k = 0; k < 3; ++k) collider.rotation[3 * i + k] = static_cast<float>(r(i, k));
  }
}

}  // namespace

Pose pose_at(const ToolMotion& m, double s) {
  if (s >= 1) return m.end;
  return {(1 - s) * m.begin.position + s * m.end.position,
          m.begin.orientation.slerp(s, m.end.orientation)};
}

double thinnest(const Tool& tool) {
  switch (tool.type) {
    case ToolType::kScalpel:
      break;  // its flats part what they touch
    case ToolType::kProbe:
    case ToolType::kBall:
    case ToolType::kPunch:
    case ToolType::kSuction:
    case ToolType::kIrrigation:
      return tool.radius;
    case ToolType::kGrasper:
      return 0.5 * tool.jaw_width;
    case ToolType::kPlate:
      return 0.5 * tool.size.minCoeff();
  }
  return 0;
}

int collider_count(ToolType type) { return type == ToolType::kGrasper ? 2 : 1; }

ToolPath::ToolPath(const Tool& tool, int index, const ToolMotion& motion, double duration,
                   double point_area)
    : tool_(&tool), motion_(&motion) {
  const Eigen::AngleAxisd turn(motion.end.orientation * motion.begin.orientation.conjugate());
  const double angle = turn.angle() > M_PI ? turn.angle() - 2 * M_PI : turn.angle();
  spin_ = turn.axis() * angle / duration;
  jaw_speed_ = (motion.jaw_end - motion.jaw_begin) / duration;
  const Vec3 velocity = (motion.end.position - motion.begin.position) / duration;
  for (int i = 0; i < 3; ++i) {
    shape_.velocity[i] = static_cast<float>(velocity[i]);
    shape_.spin[i] = static_cast<float>(spin_[i]);
  }
  switch (tool.type) {
    case ToolType::kScalpel:
      shape_.kind = Collider::kBlade;
      shape_.length = static_cast<float>(tool.blade_length);
      shape_.width = static_cast<float>(tool.blade_width);
      shape_.thickness = static_cast<float>(tool.blade_thickness);
      break;
    case ToolType::kProbe:
      shape_.kind = Collider::kCapsule;
      shape_.length = static_cast<float>(tool.length);
      shape_.radius = static_cast<float>(tool.radius);
      break;
    case ToolType::kGrasper:
      shape_.kind = Collider::kJaw;
      shape_.length = static_cast<float>(tool.jaw_length);
      shape_.radius = static_cast<float>(0.5 * tool.jaw_width);
      shape_.cohesion = static_cast<float>(tool.cohesion * point_area);
      break;
    case ToolType::kBall:
      shape_.kind = Collider::kCapsule;
      shape_.length = shape_.radius = static_cast<float>(tool.radius);
      break;
    case ToolType::kPunch:
      shape_.kind = Collider::kPunch;
      shape_.length = static_cast<float>(tool.length);
      shape_.radius = static_cast<float>(tool.radius);
      shape_.edge = static_cast<float>(tool.edge_radius);
      break;
    case ToolType::kSuction:
    case ToolType::kIrrigation:
      shape_.kind = Collider::kPunch;
      shape_.length = static_cast<float>(tool.length);
      shape_.radius = static_cast<float>(tool.radius);
      shape_.edge = static_cast<float>(kRim * std::min(tool.radius, tool.length));
      break;
    case ToolType::kPlate:
      shape_.kind = Collider::kPlate;
      shape_.width = static_cast<float>(tool.size.x());
      shape_.thickness = static_cast<float>(tool.size.y());
      shape_.length = static_cast<float>(tool.size.z());
      shape_.edge = static_cast<float>(tool.edge_radius);
      break;
  }
  shape_.friction = static_cast<float>(tool.friction);
  shape_.inside =
      static_cast<float>(std::min(kInside * 2 * std::sqrt(point_area), 0.5 * thinnest(tool)));
  shape_.tool = index;
}

Vec3 ToolPath::tip(double s) const {
  return (1 - s) * motion_->begin.position + s * motion_->end.position;
}

void ToolPath::at(double s, Collider* out) const {
  const Pose pose = pose_at(*motion_, s);
  if (tool_->type == ToolType::kGrasper) {
    place_jaws(pose, s, out);
    return;
  }
  *out = shape_;
  place(pose, *out);
}

void ToolPath::place_jaws(const Pose& pose, double s, Collider* out) const {
  const double half = 0.5 * ((1 - s) * motion_->jaw_begin + s * motion_->jaw_end);
  const Vec3 hinge(0, 0, -tool_->jaw_length);
  for (int side = 0; side < 2; ++side) {
    const double sign = side == 0 ? -1 : 1;
    const Quat swing(Eigen::AngleAxisd(sign * half, Vec3::UnitY()));
    const Quat facing = side == 0 ? Quat::Identity() : Quat(0, 0, 0, 1);  // half a turn about z
    const Vec3 tip = pose * (hinge - swing * hinge);
    out[side] = shape_;
    place({tip, pose.orientation * swing * facing}, out[side]);
    const Vec3 jaw_spin = pose.orientation * Vec3(0, 0.5 * sign * jaw_speed_, 0);
    const Vec3 more = spin_.cross(tip - pose.position) + jaw_spin.cross(tip - pose * hinge);
    for (int a = 0; a < 3; ++a) {
      out[side].velocity[a] += static_cast<float>(more[a]);
      out[side].spin[a] += static_cast<float>(jaw_spin[a]);
    }
  }
}

BladePath blade_path(const Tool& tool, const ToolMotion& motion) {
  return {{Vec3(0, 0, -tool.blade_length), Vec3::Zero(), Vec3(-tool.blade_width, 0, 0)},
          {motion.begin, motion.end}};
}

std::vector<BladePath> blade_paths(const Scene& scene, const FrameInput& input, double begin,
                                   double end) {
  std::vector<BladePath> paths;
  for (std::size_t i = 0; i < input.tools.size(); ++i) {
    ToolMotion m = input.tools[i];
    if (!m.present || scene.tools[i].type != ToolType::kScalpel) continue;
    if (end < 1) m.end = pose_at(input.tools[i], end);
    if (begin > 0) m.begin = pose_at(input.tools[i], begin);
    paths.push_back(blade_path(scene.tools[i], m));
  }
  return paths;
}

}  // namespace tissue_sim
