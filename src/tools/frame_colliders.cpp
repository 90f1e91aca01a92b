#include "tools/frame_colliders.h"

#include <algorithm>

namespace tissue_sim {

Box bounds(const Collider& c) {
  Box box;
  if (c.kind == Collider::kPlane) {
    box.min = Vec3::Constant(-1e6);
    box.max = Vec3(1e6, 1e6, c.position[2]);
    return box;
  }
  const bool is_plate = c.kind == Collider::kPlate, is_blade = c.kind == Collider::kBlade;
  const float x0 = is_plate ? -0.5f * c.width : is_blade ? -c.width : -c.radius;
  const float x1 = is_plate ? -x0 : c.kind == Collider::kJaw || is_blade ? 0 : c.radius;
  const float y = is_plate || is_blade ? 0.5f * c.thickness : c.radius;
  // A capsule whose shaft is shorter than its ball reaches beyond its length.
  const float low =
      c.kind == Collider::kCapsule ? -fmaxf(c.length, c.radius) - c.radius : -c.length;
  for (int i = 0; i < 8; ++i) {
    const float corner[3] = {i & 1 ? x1 : x0, i & 2 ? y : -y, i & 4 ? 0 : low};
    float world[3];
    to_world(c, corner, world);
    const Vec3 w(world[0], world[1], world[2]);
    box.min = box.min.cwiseMin(w);
    box.max = box.max.cwiseMax(w);
  }
  return box;
}

double speed(const Collider& c) {
  const Vec3 velocity(c.velocity[0], c.velocity[1], c.velocity[2]);
  const Vec3 spin(c.spin[0], c.spin[1], c.spin[2]);
  return velocity.norm() + spin.norm() * Vec3(c.length, c.width, c.radius).norm();
}

int collider_count(const Scene& scene) {
  int count = 1;
  for (const Tool& tool : scene.tools) count += collider_count(tool.type);
  return count;
}

FrameColliders::FrameColliders(const Scene& scene, const FrameInput& input, double duration)
    : point_area_(0.25 * scene.cell_size * scene.cell_size) {
  ground_.position[2] = static_cast<float>(scene.ground.enabled ? scene.ground.z : -1e6);
  ground_.friction = static_cast<float>(scene.ground.friction);
  tools_.reserve(input.tools.size());
  for (std::size_t i = 0; i < input.tools.size(); ++i) {
    tools_.emplace_back(scene.tools[i], static_cast<int>(i), input.tools[i], duration, point_area_);
    count_ += tools_.back().count();
  }
  reach_.resize(count_);
  for (const double share : {0.0, 0.5, 1.0}) {
    at(share, at_end_);
    for (int c = 0; c < count_; ++c) {
      if (c > 0 && !tools_[at_end_[c].tool].is_present()) continue;
      const Box box = bounds(at_end_[c]);
      reach_[c].min = reach_[c].min.cwiseMin(box.min);
      reach_[c].max = reach_[c].max.cwiseMax(box.max);
    }
  }
}

void FrameColliders::at(double share, Collider* out) const {
  *out++ = ground_;
  for (const ToolPath& tool : tools_) {
    tool.at(share, out);
    out += tool.count();
  }
}

void FrameColliders::at(double share, std::vector<Collider>& out) const {
  out.resize(count_);
  at(share, out.data());
}

void FrameColliders::add_loads(double share, const Collider* now, const ColliderLoad* on,
                               double weight, std::vector<ToolLoad>& loads) const {
  int c = 1;
  for (std::size_t i = 0; i < tools_.size(); ++i) {
    const Vec3 tip = tools_[i].tip(share);
    const int count = tools_[i].count();
    Vec3 force = Vec3::Zero(), torque = Vec3::Zero();
    double grip = 0, touching = 0, opening = 0;
    ColliderLoad inside;
    for (int side = 0; side < count; ++side, ++c) {
      const Collider& collider = now[c];
      const Vec3 pushed(on[c].force[0], on[c].force[1], on[c].force[2]);
      force += pushed;
      inside.add_inside(on[c]);
      torque += Vec3(on[c].torque[0], on[c].torque[1], on[c].torque[2]);
      if (count == 1) continue;
      // Its load's moment is about its own tip; it presses along its local x.
      const Vec3 at(collider.position[0], collider.position[1], collider.position[2]);
      const Vec3 facing(collider.rotation[0], collider.rotation[3], collider.rotation[6]);
      torque += (at - tip).cross(pushed);
      grip -= facing.dot(pushed) / count;
      touching += on[c].points / count;
      opening += tools_[i].opening(share, side, collider, on[c]) / count;
    }
    ToolLoad& load = loads[i];
    load.mean.force += weight * force;
    load.mean.torque += weight * torque;
    load.peak_force = std::max(load.peak_force, force.norm());
    load.grip += weight * grip;
    load.grip_area += weight * touching * point_area_;
    load.jaw_moment += weight * opening;
    load.points_inside = static_cast<int>(inside.inside);
    load.inside_depth = inside.deepest;
  }
}

double FrameColliders::power(const Collider* now, const ColliderLoad* on) const {
  double power = 0;
  for (int c = 0; c < count_; ++c) {
    for (int a = 0; a < 3; ++a) {
      power -= on[c].force[a] * now[c].velocity[a] + on[c].torque[a] * now[c].spin[a];
    }
  }
  return power;
}

}  // namespace tissue_sim
