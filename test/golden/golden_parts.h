// What the golden scenes are put together from.
#pragma once

#include <random>
#include <string>
#include <vector>

#include "tissue_sim/scene.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace golden {

/// Of a tool that points downwards: the shaft up, a scalpel's edge to +x.
inline Quat down() { return Quat(Eigen::AngleAxisd(EIGEN_PI, Vec3::UnitX())); }

inline Region box(const Vec3& min, const Vec3& max) {
  Region r;
  r.kind = Region::Kind::kBox;
  r.min = min;
  r.max = max;
  return r;
}

/// A material of its own for a body, by the values of liver.
inline Material& add_material(Scene& s, const std::string& name) {
  s.materials.emplace_back().name = name;
  return s.materials.back();
}

inline Body& add_box(Scene& s, const Vec3& size, const Vec3& center) {
  Body& b = s.bodies.emplace_back();
  b.name = "body" + std::to_string(s.bodies.size() - 1);
  b.size = size;
  b.pose.position = center;
  return b;
}

inline Tool& add_tool(Scene& s, ToolType type) {
  Tool& t = s.tools.emplace_back();
  t.name = "tool" + std::to_string(s.tools.size() - 1);
  t.type = type;
  return t;
}

/// An edge between two places that sweeps by these steps.
inline BladePath sweep(const Vec3& a, const Vec3& b, const std::vector<Vec3>& steps) {
  BladePath path;
  path.edge = {a, b};
  for (const Vec3& step : steps) path.poses.push_back({step, Quat::Identity()});
  return path;
}

/// A straight cut with an edge that stands upright, from one place to another.
inline BladePath upright(const Vec3& from, const Vec3& to) {
  return sweep(Vec3(0, 0, -0.1), Vec3(0, 0, 0.1), {from, to});
}

/// Plane cuts at random within a box around `middle`, `half` in half their width and length.
inline std::vector<BladePath> random_cuts(int count, const Vec3& middle, const Vec3& within,
                                          double half) {
  std::mt19937 random(11);
  const auto number = [&random] { return random() / 2147483648.0 - 1; };  // the same everywhere
  std::vector<BladePath> paths;
  for (int i = 0; i < count; ++i) {
    const Vec3 place = middle + within.cwiseProduct(Vec3(number(), number(), number()));
    const Quat turn = Quat(number(), number(), number(), number() + 1.5).normalized();
    BladePath path = sweep(Vec3(0, 0, -half), Vec3(0, 0, half), {});
    for (const double x : {-half, half}) path.poses.push_back({place + turn * Vec3(x, 0, 0), turn});
    paths.push_back(path);
  }
  return paths;
}

/// The OBJ text of a U that stands on its bend, 20 x 10 x 30 mm, in millimetres.
inline std::string u_shape() {
  const double profile[8][2] = {{0, 0},         {0.020, 0},     {0.020, 0.030}, {0.012, 0.030},
                                {0.012, 0.008}, {0.008, 0.008}, {0.008, 0.030}, {0, 0.030}};
  const int caps[6][3] = {{0, 1, 4}, {0, 4, 5}, {1, 2, 3}, {1, 3, 4}, {0, 5, 6}, {0, 6, 7}};
  std::string obj;
  const auto line = [&obj](char kind, auto a, auto b, auto c) {
    obj += kind;
    for (const auto v : {a, b, c}) obj += ' ' + std::to_string(v);
    obj += '\n';
  };
  for (const double y : {0.0, 0.010}) {
    for (const auto& p : profile) line('v', p[0] * 1000, y * 1000, p[1] * 1000);
  }
  for (int i = 0; i < 8; ++i) {
    const int j = (i + 1) % 8;
    line('f', j + 1, i + 1, j + 9);
    line('f', i + 1, i + 9, j + 9);
  }
  for (const auto& c : caps) {
    line('f', c[0] + 1, c[1] + 1, c[2] + 1);
    line('f', c[0] + 9, c[2] + 9, c[1] + 9);
  }
  return obj;
}

}  // namespace golden
}  // namespace tissue_sim
