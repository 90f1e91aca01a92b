#include "ros/conversions.h"

#include <algorithm>
#include <cinttypes>
#include <cstddef>
#include <cstdio>

namespace tissue_sim {

Vec3 from_message(const geometry_msgs::Point& p) { return {p.x, p.y, p.z}; }

Pose from_message(const geometry_msgs::Pose& pose) {
  const geometry_msgs::Quaternion& q = pose.orientation;
  return {from_message(pose.position), Quat(q.w, q.x, q.y, q.z)};
}

Pose from_message(const geometry_msgs::Transform& transform) {
  const geometry_msgs::Vector3& t = transform.translation;
  const geometry_msgs::Quaternion& q = transform.rotation;
  return {Vec3(t.x, t.y, t.z), Quat(q.w, q.x, q.y, q.z)};
}

geometry_msgs::Point to_point(const Vec3& v) {
  geometry_msgs::Point p;
  p.x = v.x(), p.y = v.y(), p.z = v.z();
  return p;
}

geometry_msgs::Vector3 to_vector3(const Vec3& v) {
  geometry_msgs::Vector3 p;
  p.x = v.x(), p.y = v.y(), p.z = v.z();
  return p;
}

geometry_msgs::Quaternion to_quaternion(const Quat& q) {
  geometry_msgs::Quaternion m;
  m.x = q.x(), m.y = q.y(), m.z = q.z(), m.w = q.w();
  return m;
}

geometry_msgs::Pose to_pose(const Pose& pose) {
  geometry_msgs::Pose m;
  m.position = to_point(pose.position);
  m.orientation = to_quaternion(pose.orientation);
  return m;
}

geometry_msgs::Transform to_transform(const Pose& pose) {
  geometry_msgs::Transform m;
  m.translation = to_vector3(pose.position);
  m.rotation = to_quaternion(pose.orientation);
  return m;
}

geometry_msgs::Wrench to_wrench(const Wrench& wrench) {
  geometry_msgs::Wrench m;
  m.force = to_vector3(wrench.force);
  m.torque = to_vector3(wrench.torque);
  return m;
}

Wrench in_axes(const Wrench& world, const Quat& orientation) {
  const Quat inverse = orientation.conjugate();
  return {inverse * world.force, inverse * world.torque};
}

Pose operator*(const Pose& a, const Pose& b) {
  return {a * b.position, a.orientation * b.orientation};
}

BladeSweep to_message(const BladePath& path) {
  BladeSweep m;
  for (const Vec3& x : path.edge) m.edge.push_back(to_point(x));
  for (const Pose& pose : path.poses) m.poses.push_back(to_pose(pose));
  return m;
}

FrameInputMessage to_message(const AppliedInput& input, const Scene& scene) {
  FrameInputMessage m;
  m.frame = input.frame;
  m.tools.resize(input.tools.size());
  for (std::size_t i = 0; i < input.tools.size(); ++i) {
    const ToolMotion& motion = input.tools[i];
    m.tools[i].name = scene.tools[i].name;
    m.tools[i].present = motion.present;
    m.tools[i].begin = to_pose(motion.begin);
    m.tools[i].end = to_pose(motion.end);
    m.tools[i].jaw_begin = motion.jaw_begin;
    m.tools[i].jaw_end = motion.jaw_end;
    if (i < input.grip_pressures.size()) m.tools[i].grip_pressure = input.grip_pressures[i];
  }
  for (const BladePath& path : input.cuts) m.cuts.push_back(to_message(path));
  for (const FluidOrder& order : input.fluid) {
    HollowOrder told;
    told.body = order.body;
    told.pressure = order.pressure;
    told.drain = order.drain;
    m.fluid.push_back(told);
  }
  std::size_t anchor = 0;
  for (const Body& body : scene.bodies) {
    for (const Anchor& a : body.anchors) {
      if (anchor == input.anchors.size()) break;
      AnchorPath path;
      path.name = a.name;
      path.begin = to_pose(input.anchors[anchor].begin);
      path.end = to_pose(input.anchors[anchor++].end);
      m.anchors.push_back(path);
    }
  }
  if (input.gravity) m.gravity = to_vector3(*input.gravity);
  m.damping = input.damping.value_or(-1);
  return m;
}

AppliedInput from_message(const FrameInputMessage& message) {
  AppliedInput input;
  input.frame = message.frame;
  for (const InstrumentMotion& m : message.tools) {
    ToolMotion motion;
    motion.present = m.present;
    motion.begin = from_message(m.begin);
    motion.end = from_message(m.end);
    motion.jaw_begin = m.jaw_begin;
    motion.jaw_end = m.jaw_end;
    input.tools.push_back(motion);
    input.grip_pressures.push_back(m.grip_pressure);
  }
  for (const BladeSweep& m : message.cuts) {
    BladePath path;
    for (const geometry_msgs::Point& x : m.edge) path.edge.push_back(from_message(x));
    for (const geometry_msgs::Pose& pose : m.poses) path.poses.push_back(from_message(pose));
    input.cuts.push_back(path);
  }
  for (const HollowOrder& m : message.fluid) {
    input.fluid.push_back({m.body, m.pressure, m.drain});
  }
  for (const AnchorPath& m : message.anchors) {
    input.anchors.push_back({from_message(m.begin), from_message(m.end)});
  }
  if (message.damping >= 0) {
    input.damping = message.damping;
    input.gravity = Vec3(message.gravity.x, message.gravity.y, message.gravity.z);
  }
  return input;
}

JawGrip to_message(const ToolLoad& load, const ToolMotion& motion, double pressure_limit) {
  JawGrip m;
  m.jaw = motion.jaw_end;
  m.force = load.grip;
  m.area = load.grip_area;
  m.moment = load.jaw_moment;
  m.pressure = load.grip_area > 0 ? load.grip / load.grip_area : 0;
  m.pressure_limit = pressure_limit;
  return m;
}

TissueFragment to_message(const Fragment& fragment, const Scene& scene) {
  TissueFragment m;
  m.id = fragment.id;
  m.parent = fragment.parent;
  m.body = scene.bodies[fragment.body].name;
  m.loose = fragment.loose;
  m.point_count = fragment.point_count;
  m.volume = fragment.volume;
  m.centroid = to_point(fragment.centroid);
  m.velocity = to_vector3(fragment.velocity);
  m.box_min = to_point(fragment.box.min);
  m.box_max = to_point(fragment.box.max);
  return m;
}

std::string to_hex(std::uint64_t checksum) {
  char text[17];
  std::snprintf(text, sizeof text, "%016" PRIx64, checksum);
  return text;
}

std::string without_commas(std::string text) {
  std::replace(text.begin(), text.end(), ',', ';');
  return text;
}

void describe_points(int count, unsigned fields, sensor_msgs::PointCloud2& cloud) {
  using sensor_msgs::PointField;
  const auto add = [&](const char* name, std::size_t offset, std::uint8_t type) {
    PointField field;
    field.name = name;
    field.offset = static_cast<std::uint32_t>(offset);
    field.datatype = type;
    field.count = 1;
    cloud.fields.push_back(field);
  };
  cloud.fields.clear();
  add("x", offsetof(Point, x), PointField::FLOAT32);
  add("y", offsetof(Point, y), PointField::FLOAT32);
  add("z", offsetof(Point, z), PointField::FLOAT32);
  add("rgb", offsetof(Point, rgb), PointField::FLOAT32);  // the bits, as PCL and RViz read them
  add("id", offsetof(Point, id), PointField::UINT32);
  add("fragment", offsetof(Point, fragment), PointField::INT32);
  add("stress", offsetof(Point, stress), PointField::FLOAT32);
  add("damage", offsetof(Point, damage), PointField::FLOAT32);
  PointSelection carried;  // what comes behind the Point
  for (const CloudField& field : kCloudFields) {
    if ((fields & field.flag) == 0) continue;
    std::size_t offset = carried.point_size();
    for (const char* name : field.components) {
      if (name == nullptr) break;
      add(name, offset, PointField::FLOAT32);
      offset += sizeof(float);
    }
    carried.fields |= field.flag;
  }
  cloud.height = 1;
  cloud.width = static_cast<std::uint32_t>(count);
  cloud.point_step = static_cast<std::uint32_t>(carried.point_size());
  cloud.row_step = cloud.point_step * cloud.width;
  cloud.is_bigendian = false;
  cloud.is_dense = true;
}

}  // namespace tissue_sim
