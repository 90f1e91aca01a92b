// Scenes and tables that several tests of scenes share.
#pragma once

#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "tissue_sim/scene.h"

namespace tissue_sim {

// A box on the ground, held at one end, a scalpel and a probe; one thread.
inline Scene operation_scene(const Vec3& size, const Vec3& place) {
  Scene s;
  s.threads = 1;
  s.cell_size = 0.004;
  s.bodies.resize(1);
  Body& b = s.bodies[0];
  b.size = size;
  b.pose.position = place;
  Region held;
  held.kind = Region::Kind::kBox;
  held.min = Vec3(-1, -1, -1);
  held.max = Vec3(-0.03, 1, 1);
  b.anchors = {held};
  s.tools.resize(2);
  s.tools[0].name = "scalpel";
  s.tools[0].type = ToolType::kScalpel;
  s.tools[1].name = "probe";
  s.tools[1].radius = 0.006;
  return s;
}

// One of everything.
inline Scene full_scene() {
  Scene s;
  s.materials.resize(2);
  s.materials[0].name = "phantom";
  s.materials[1].name = "stiff phantom: \"b\"";
  s.materials[1].law = Law::kNeoHookean;
  s.materials[1].young_modulus = 1.0 / 3 * 1e5;
  s.materials[1].viscosity = 0.1 + 0.2;
  s.materials[1].tear_stretch = 1.0 + 1.0 / 3;
  s.materials[1].tear_length = 0.004;
  s.materials[1].tear_scatter = 0.07;
  s.materials[1].toughness = 206.5;
  s.bodies.resize(5);
  const Shape shapes[] = {Shape::kBox, Shape::kBall, Shape::kEllipsoid, Shape::kCylinder,
                          Shape::kMesh};
  for (int i = 0; i < 5; ++i) {
    s.bodies[i].name = "body" + std::to_string(i);
    s.bodies[i].shape = shapes[i];
  }
  s.bodies[0].material = s.materials[1].name;
  s.bodies[0].size = Vec3(0.1, 1.0 / 7, 0.03);
  s.bodies[0].pose.position = Vec3(-0.1, 1e-17, 3);
  s.bodies[0].pose.orientation = Quat(0.3, -0.2, 0.7, 0.5).normalized();
  s.bodies[0].anchors.resize(3);
  s.bodies[0].anchors[0].z = -0.01;
  s.bodies[0].anchors[1].kind = Region::Kind::kBox;
  s.bodies[0].anchors[1].min = Vec3(-1, -2, -3);
  s.bodies[0].anchors[1].max = Vec3(1, 2, 0.1);
  s.bodies[0].anchors[2].kind = Region::Kind::kBall;
  s.bodies[0].anchors[2].center = Vec3(0.1, 0.2, 0.3);
  s.bodies[0].anchors[2].radius = 0.05;
  s.bodies[0].inclusions.resize(2);
  s.bodies[0].inclusions[0].material = "phantom";
  s.bodies[0].inclusions[0].region = s.bodies[0].anchors[1];
  s.bodies[0].inclusions[1].material = "skin";
  s.bodies[0].inclusions[1].region = s.bodies[0].anchors[2];
  s.bodies[4].mesh = "package://some pack/kidney #1.stl";
  s.bodies[4].scale = 0.001;
  s.tools.resize(4);
  s.tools[0].name = "PSM1";
  s.tools[0].type = ToolType::kScalpel;
  s.tools[0].blade_width = 0.007;
  s.tools[0].blade_edge_radius = 3e-6;
  s.tools[1].name = "probe_2";
  s.tools[1].radius = 0.002;
  s.tools[2].name = "PSM2";
  s.tools[2].type = ToolType::kGrasper;
  s.tools[2].jaw_length = 0.011;
  s.tools[2].grip_pressure = 1e5 / 3;
  s.tools[3].name = "scissors";
  s.tools[3].type = ToolType::kScissors;
  s.tools[3].blade_width = 0.0009;
  s.tools[3].blade_edge_radius = 4e-6;
  s.seed = 18446744073709551615ull;
  s.threads = 3;
  s.device = Device::kCuda;
  s.ground.enabled = false;
  s.ground.z = -0.5;
  return s;
}

inline std::string reason_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "nothing was thrown";
}

// A list of each numeric field with its range; the ends are allowed, beyond them is refused.
struct NumberCase {
  const char* field;
  std::function<double&(Scene&)> value;
  double low, high;
};

inline const std::vector<NumberCase>& number_cases() {
#define AT(expression) [](Scene& s) -> double& { return s.expression; }
  static const std::vector<NumberCase> cases = {
      {"cell_size", AT(cell_size), 1e-5, 1},
      {"frame_rate", AT(frame_rate), 1, 2000},
      {"cfl", AT(cfl), 0.05, 0.9},
      {"damping", AT(damping), 0, 1000},
      {"gravity", AT(gravity.y()), -1000, 1000},
      {"ground.z", AT(ground.z), -100, 100},
      {"ground.friction", AT(ground.friction), 0, 2},
      {"materials[1].young_modulus", AT(materials[1].young_modulus), 1e-300, 1e8},
      {"materials[1].poisson_ratio", AT(materials[1].poisson_ratio), 0, 0.49},
      {"materials[1].density", AT(materials[1].density), 100, 20000},
      {"materials[1].viscosity", AT(materials[1].viscosity), 0, 1000},
      {"materials[1].tear_stretch", AT(materials[1].tear_stretch), 1.001, 100},
      {"materials[1].tear_length", AT(materials[1].tear_length), 0, 1},
      {"materials[1].tear_scatter", AT(materials[1].tear_scatter), 0, 0.9},
      {"materials[1].toughness", AT(materials[1].toughness), 0, 1e5},
      {"materials[1].friction", AT(materials[1].friction), 0, 2},
      {"bodies[0].size", AT(bodies[0].size.z()), 1e-4, 10},
      {"bodies[1].radius", AT(bodies[1].radius), 1e-4, 10},
      {"bodies[2].radii", AT(bodies[2].radii.x()), 1e-4, 10},
      {"bodies[3].radius", AT(bodies[3].radius), 1e-4, 10},
      {"bodies[3].height", AT(bodies[3].height), 1e-4, 10},
      {"bodies[4].scale", AT(bodies[4].scale), 1e-6, 1e3},
      {"bodies[2].pose.position", AT(bodies[2].pose.position.x()), -100, 100},
      {"bodies[0].anchors[0].below", AT(bodies[0].anchors[0].z), -100, 100},
      {"bodies[0].anchors[1].box.min", AT(bodies[0].anchors[1].min.x()), -100, 0.999},
      {"bodies[0].anchors[1].box.max", AT(bodies[0].anchors[1].max.x()), -0.999, 100},
      {"bodies[0].anchors[2].ball.center", AT(bodies[0].anchors[2].center.z()), -100, 100},
      {"bodies[0].anchors[2].ball.radius", AT(bodies[0].anchors[2].radius), 1e-4, 100},
      {"bodies[0].inclusions[0].region.box.max", AT(bodies[0].inclusions[0].region.max.x()), -0.999,
       100},
      {"bodies[0].inclusions[1].region.ball.radius", AT(bodies[0].inclusions[1].region.radius),
       1e-4, 100},
      {"tools[0].blade_length", AT(tools[0].blade_length), 1e-3, 0.2},
      {"tools[0].blade_width", AT(tools[0].blade_width), 2e-4, 0.1},
      {"tools[0].blade_thickness", AT(tools[0].blade_thickness), 1e-5, 0.01},
      {"tools[0].edge_radius", AT(tools[0].blade_edge_radius), 0, 0.0002},
      {"tools[0].friction", AT(tools[0].friction), 0, 2},
      {"tools[1].radius", AT(tools[1].radius), 1e-4, 0.1},
      {"tools[1].length", AT(tools[1].length), 1e-3, 1},
      {"tools[2].jaw_length", AT(tools[2].jaw_length), 1e-3, 0.2},
      {"tools[2].jaw_width", AT(tools[2].jaw_width), 2e-4, 0.1},
      {"tools[2].grip_pressure", AT(tools[2].grip_pressure), 1, 1e7},
      {"tools[3].jaw_length", AT(tools[3].jaw_length), 1e-3, 0.2},
      {"tools[3].blade_width", AT(tools[3].blade_width), 2e-4, 0.015},
      {"tools[3].blade_thickness", AT(tools[3].blade_thickness), 1e-5, 0.01},
      {"tools[3].edge_radius", AT(tools[3].blade_edge_radius), 0, 0.0002},
      {"tools[2].cohesion", AT(tools[2].cohesion), 0, 1e7},
  };
#undef AT
  return cases;
}

}  // namespace tissue_sim
