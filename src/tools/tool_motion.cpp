#include "tools/tool_motion.h"

#include <algorithm>
#include <cmath>

namespace tissue_sim {
namespace {

constexpr double kRim = 0.25;    // of a tube's radius: how round the edge of its mouth is
constexpr double kInside = 0.3;  // cells: springs at their limit give way by a quarter

/// How far the edges of closed scissors are past the middle [m].
double past_middle(const Tool& tool) { return 0.25 * tool.blade_width; }

double side_sign(int side) { return side == 0 ? -1 : 1; }

double jaw_at(const ToolMotion& m, double s) { return (1 - s) * m.jaw_begin + s * m.jaw_end; }
double half_angle(const ToolMotion& m, double s) { return 0.5 * jaw_at(m, s); }

/// As blade_at(), in the tool's frame, of jaws that are open by twice the angle.
Pose jaw_in_tool(const Tool& tool, double half, int side) {
  const Vec3 hinge(0, 0, -tool.jaw_length);
  const Quat swing(Eigen::AngleAxisd(side_sign(side) * half, Vec3::UnitY()));
  const Quat facing = side == 0 ? Quat::Identity() : Quat(0, 0, 0, 1);  // half a turn about z
  Vec3 tip = hinge - swing * hinge;
  if (tool.type == ToolType::kScissors) tip += swing * (facing * Vec3(past_middle(tool), 0, 0));
  return {tip, swing * facing};
}

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
    case ToolType::kScissors:
      return 0.5 * tool.blade_thickness;
  }
  return 0;
}

int collider_count(ToolType type) { return has_jaws(type) ? 2 : 1; }

ToolPath::ToolPath(const Tool& tool, int index, const ToolMotion& motion, double duration,
                   double point_area)
    : tool_(&tool), motion_(&motion), cuts_(cuts(tool, motion)) {
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
    case ToolType::kScissors:  // edges that cut do not push
      shape_.kind = cuts_ ? Collider::kBlade : Collider::kPlate;
      shape_.length = static_cast<float>(tool.jaw_length);
      shape_.width = static_cast<float>(tool.blade_width);
      shape_.thickness = static_cast<float>(tool.blade_thickness);
      shape_.edge = static_cast<float>(0.5 * tool.blade_thickness);
      break;
  }
  shape_.friction = static_cast<float>(tool.friction);
  if (shape_.kind != Collider::kBlade) {
    shape_.inside =
        static_cast<float>(std::min(kInside * 2 * std::sqrt(point_area), 0.5 * thinnest(tool)));
  }
  shape_.tool = index;
}

Vec3 ToolPath::tip(double s) const {
  return (1 - s) * motion_->begin.position + s * motion_->end.position;
}

void ToolPath::at(double s, Collider* out) const {
  const Pose pose = pose_at(*motion_, s);
  if (has_jaws(tool_->type)) {
    place_jaws(pose, s, out);
    return;
  }
  *out = shape_;
  place(pose, *out);
}

void ToolPath::place_jaws(const Pose& pose, double s, Collider* out) const {
  const Vec3 hinge = pose * Vec3(0, 0, -tool_->jaw_length);
  for (int side = 0; side < 2; ++side) {
    Pose jaw = blade_at(*tool_, *motion_, s, side);
    // A plate's origin is the middle of its face.
    if (shape_.kind == Collider::kPlate) jaw.position = jaw * Vec3(-0.5 * tool_->blade_width, 0, 0);
    out[side] = shape_;
    place(jaw, out[side]);
    const Vec3 jaw_spin = pose.orientation * Vec3(0, 0.5 * side_sign(side) * jaw_speed_, 0);
    const Vec3 more =
        spin_.cross(jaw.position - pose.position) + jaw_spin.cross(jaw.position - hinge);
    for (int a = 0; a < 3; ++a) {
      out[side].velocity[a] += static_cast<float>(more[a]);
      out[side].spin[a] += static_cast<float>(jaw_spin[a]);
    }
  }
}

double ToolPath::opening(double s, int side, const Collider& jaw, const ColliderLoad& on) const {
  const Pose pose = pose_at(*motion_, s);
  const Vec3 hinge = pose * Vec3(0, 0, -tool_->jaw_length);
  const Vec3 at(jaw.position[0], jaw.position[1], jaw.position[2]);
  const Vec3 moment = Vec3(on.torque[0], on.torque[1], on.torque[2]) +
                      (at - hinge).cross(Vec3(on.force[0], on.force[1], on.force[2]));
  return side_sign(side) * moment.dot(pose.orientation * Vec3::UnitY());
}

Pose blade_at(const Tool& tool, const ToolMotion& motion, double s, int side) {
  const Pose pose = pose_at(motion, s);
  if (!has_jaws(tool.type)) return pose;
  const Pose jaw = jaw_in_tool(tool, half_angle(motion, s), side);
  return {pose * jaw.position, pose.orientation * jaw.orientation};
}

double crossing_at(const Tool& tool, const ToolMotion& motion, double s) {
  const double past = past_middle(tool), sine = std::sin(half_angle(motion, s));
  const double farthest = std::hypot(tool.jaw_length, past);  // that of the tips
  return past < farthest * sine ? past / sine : farthest;
}

bool cuts(const Tool& tool, const ToolMotion& motion) {
  if (!motion.present) return false;
  if (tool.type != ToolType::kScissors) return tool.type == ToolType::kScalpel;
  return motion.jaw_end < motion.jaw_begin &&
         crossing_at(tool, motion, 0) < std::hypot(tool.jaw_length, past_middle(tool));
}

BladePath blade_path(const Tool& tool, const ToolMotion& motion) {
  if (tool.type == ToolType::kScissors) {
    const auto edge_at = [&](double s) {
      std::vector<Vec3> edge(3, Vec3(0, 0, crossing_at(tool, motion, s) - tool.jaw_length));
      edge[0] = jaw_in_tool(tool, half_angle(motion, s), 0).position;
      edge[2] = jaw_in_tool(tool, half_angle(motion, s), 1).position;
      return edge;
    };
    return {edge_at(0), {motion.begin, motion.end}, edge_at(1)};
  }
  return {{Vec3(0, 0, -tool.blade_length), Vec3::Zero(), Vec3(-tool.blade_width, 0, 0)},
          {motion.begin, motion.end}};
}

std::vector<BladePath> blade_paths(const Scene& scene, const FrameInput& input, double begin,
                                   double end, std::vector<int>* tools) {
  std::vector<BladePath> paths;
  for (std::size_t i = 0; i < input.tools.size(); ++i) {
    ToolMotion m = input.tools[i];
    if (!cuts(scene.tools[i], m)) continue;
    if (end < 1) m.end = pose_at(input.tools[i], end);
    if (begin > 0) m.begin = pose_at(input.tools[i], begin);
    m.jaw_begin = static_cast<float>(jaw_at(input.tools[i], begin));
    m.jaw_end = static_cast<float>(jaw_at(input.tools[i], end));
    paths.push_back(blade_path(scene.tools[i], m));
    if (tools != nullptr) tools->push_back(static_cast<int>(i));
  }
  return paths;
}

}  // namespace tissue_sim
