// One cut of every kind, with what it parts as geometry says it: without bonds, without labels.
#pragma once

#include <algorithm>
#include <array>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "support/cut_paths.h"

namespace tissue_sim {

struct CutKind {
  std::string name;
  std::vector<BladePath> cuts;
  int pieces;
  /// Which of the parts 0 .. pieces - 1 the place belongs to, by the cut's true surface.
  std::function<int(const Vec3&)> part;
};

/// Whether the place lies within a closed polygon, seen along z (its winding by crossings).
inline bool inside(const std::vector<Vec3>& polygon, const Vec3& x) {
  bool in = false;
  for (std::size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
    const Vec3 &a = polygon[i], &b = polygon[j];
    if ((a.y() > x.y()) != (b.y() > x.y()) &&
        x.x() < a.x() + (x.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x())) {
      in = !in;
    }
  }
  return in;
}

/// All kinds, for a box of this size with its lowest corner at the origin. Surfaces lie aside of
/// the lattice's points.
inline std::vector<CutKind> cut_kinds(const Vec3& size) {
  const auto at = [size](double x, double y) { return Vec3(x * size.x(), y * size.y(), 0); };
  const auto blade = [at](const std::vector<std::array<double, 2>>& places) {
    std::vector<Vec3> path;
    for (const auto& p : places) path.push_back(at(p[0], p[1]));
    return upright_blade(path);
  };
  const Vec3 m = Vec3(0.487, 0.513, 0.461).cwiseProduct(size);
  const auto side = [m](const Vec3& n) {
    return [m, n](const Vec3& x) { return (x - m).dot(n) > 0 ? 1 : 0; };
  };
  const auto one = [](const Vec3&) { return 0; };
  const Vec3 a(1, 0.2, 0), b(-0.2, 1, 0.1), c(0, 0.1, 1);
  const auto above_a = side(a), above_b = side(b), above_c = side(c);

  std::vector<Vec3> wave, ring;
  for (int i = 0; i <= 40; ++i) {
    const double y = -0.2 + 1.4 * i / 40;
    wave.push_back(at(0.487 + 0.16 * std::sin(4 * y), y));
  }
  std::vector<Vec3> left_of_wave = wave;
  left_of_wave.push_back(at(-1, 1.2));
  left_of_wave.push_back(at(-1, -0.2));
  const double radius = 0.33 * size.y();
  for (int i = 0; i <= 24; ++i) {
    const double angle = 2 * M_PI * (i % 24) / 24 + 0.1;
    ring.push_back(Vec3(m.x(), m.y(), 0) + radius * Vec3(std::cos(angle), std::sin(angle), 0));
  }
  const std::vector<Vec3> disc(ring.begin(), ring.end() - 1);
  const std::vector<Vec3> hook = {at(0.287, 0.313), at(0.287, 0.787), at(0.713, 0.787),
                                  at(0.713, 0.313)};
  const BladePath first_half = blade({{0.487, -0.5}, {0.487, 0.541}});

  return {
      {"full", {plane_cut(m, Vec3(1, 0.4, 0.2))}, 2, side(Vec3(1, 0.4, 0.2))},
      {"partial", {blade({{0.487, -0.5}, {0.487, 0.52}})}, 1, one},
      {"T",
       {plane_cut(m, Vec3::UnitX()), upright_blade({m, at(1.5, 0.513)})},
       3,
       [m](const Vec3& x) { return x.x() < m.x()   ? 0
                                   : x.y() < m.y() ? 1
                                                   : 2; }},
      {"L",
       {blade({{-0.5, 0.513}, {0.487, 0.513}, {0.487, 1.5}})},
       2,
       [m](const Vec3& x) { return x.x() < m.x() && x.y() > m.y() ? 1 : 0; }},
      {"cross",
       {plane_cut(m, a), plane_cut(m, b)},
       4,
       [=](const Vec3& x) { return above_a(x) + 2 * above_b(x); }},
      {"three planes",
       {plane_cut(m, a), plane_cut(m, b), plane_cut(m, c)},
       8,
       [=](const Vec3& x) { return above_a(x) + 2 * above_b(x) + 4 * above_c(x); }},
      {"curved",
       {upright_blade(wave)},
       2,
       [=](const Vec3& x) { return inside(left_of_wave, x) ? 1 : 0; }},
      {"hooked",
       {blade({{0.287, -0.5}, {0.287, 0.787}, {0.713, 0.787}, {0.713, 0.313}, {0.5, 0.313}})},
       1,
       one},
      {"hooked onto itself",
       {blade({{0.287, -0.5}, {0.287, 0.787}, {0.713, 0.787}, {0.713, 0.313}, {0.19, 0.313}})},
       2,
       [=](const Vec3& x) { return inside(hook, x) ? 1 : 0; }},
      {"closed on itself",
       {upright_blade(ring)},
       2,
       [=](const Vec3& x) { return inside(disc, x) ? 1 : 0; }},
      {"starting and ending inside", {blade({{0.287, 0.513}, {0.713, 0.513}})}, 1, one},
      {"two strokes on one line",
       {first_half, blade({{0.487, 1.5}, {0.487, 0.539}})},
       2,
       side(Vec3::UnitX())},
      {"two strokes from one side",
       {first_half, blade({{0.487, 0.1}, {0.487, 1.5}})},
       2,
       side(Vec3::UnitX())},
      {"along an old cut",
       {plane_cut(m, b), plane_cut(m, b)},
       2,
       [=](const Vec3& x) { return above_b(x); }},
      {"partial, then across it",
       {first_half, plane_cut(m, b)},
       3,
       [=](const Vec3& x) { return above_b(x)      ? 2
                                   : x.x() < m.x() ? 0
                                                   : 1; }},
  };
}

/// The same parts whatever they are called: labels numbered in the order of their first points.
inline std::vector<int> in_order(const std::vector<int>& labels) {
  std::vector<int> result;
  std::vector<std::pair<int, int>> seen;
  for (const int label : labels) {
    auto it = std::find_if(seen.begin(), seen.end(), [&](auto& s) { return s.first == label; });
    if (it == seen.end()) {
      seen.emplace_back(label, static_cast<int>(seen.size()));
      it = seen.end() - 1;
    }
    result.push_back(it->second);
  }
  return result;
}

/// Where each point is now [m].
inline std::vector<Vec3> positions(Tissue& tissue) {
  std::vector<std::uint8_t> cloud;
  tissue.read_points({}, cloud);
  std::vector<Vec3> result(tissue.point_count());
  for (std::size_t i = 0; i < cloud.size(); i += sizeof(Point)) {
    Point p;
    std::memcpy(&p, &cloud[i], sizeof(Point));
    result[p.id] = Vec3(p.x, p.y, p.z);
  }
  return result;
}

/// The piece of each point, by the program's labels.
inline std::vector<int> labels(Tissue& tissue) {
  std::vector<std::uint8_t> cloud;
  tissue.read_points({}, cloud);
  std::vector<int> result(tissue.point_count());
  for (std::size_t i = 0; i < cloud.size(); i += sizeof(Point)) {
    Point p;
    std::memcpy(&p, &cloud[i], sizeof(Point));
    result[p.id] = p.fragment;
  }
  return in_order(result);
}

}  // namespace tissue_sim
