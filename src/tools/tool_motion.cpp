#include "tools/tool_motion.h"

namespace tissue_sim {

Pose pose_at(const ToolMotion& m, double s) {
  if (s >= 1) return m.end;
  return {(1 - s) * m.begin.position + s * m.end.position,
          m.begin.orientation.slerp(s, m.end.orientation)};
}

Collider tool_collider(const Tool& tool, int index, const ToolMotion& motion, double s,
                       double duration) {
  const Pose pose = pose_at(motion, s);
  const Eigen::Matrix3d r = pose.orientation.toRotationMatrix();
  const Eigen::AngleAxisd turn(motion.end.orientation * motion.begin.orientation.conjugate());
  const double angle = turn.angle() > M_PI ? turn.angle() - 2 * M_PI : turn.angle();
  const Vec3 spin = turn.axis() * angle / duration;
  Collider c;
  c.kind = tool.type == ToolType::kScalpel ? Collider::kBlade : Collider::kCapsule;
  for (int i = 0; i < 3; ++i) {
    c.position[i] = static_cast<float>(pose.position[i]);
    c.velocity[i] =
        static_cast<float>((motion.end.position[i] - motion.begin.position[i]) / duration);
    c.spin[i] = static_cast<float>(spin[i]);
    for (int k = 0; k < 3; ++k) c.rotation[3 * i + k] = static_cast<float>(r(i, k));
  }
  c.length = static_cast<float>(tool.type == ToolType::kScalpel ? tool.blade_length : tool.length);
  c.radius = static_cast<float>(tool.radius);
  c.width = static_cast<float>(tool.blade_width);
  c.thickness = static_cast<float>(tool.blade_thickness);
  c.friction = static_cast<float>(tool.friction);
  c.tool = index;
  return c;
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
