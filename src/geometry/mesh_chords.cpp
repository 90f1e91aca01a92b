#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "geometry/chord.h"

namespace tissue_sim {
namespace {

struct Crossing {
  double x;
  int step;  ///< +1 into the solid, -1 out of it
};

// Moves a line off its strip's middle by an irrational share of at most a thousandth of the strip,
// more with each attempt: lattices and meshes are often aligned, and a line that runs through an
// edge or a corner counts wrongly.
double moved(const SampleLine& line, int attempt, double irrational) {
  const double share = std::fmod((attempt + 1) * irrational, 1.0) - 0.5;
  return line.at + share * 2e-3 * (attempt + 1) * line.width;
}

double moved_y(const SampleLine& line, int attempt) {
  return moved(line, attempt, 0.6180339887498949);
}
double moved_z(const SampleLine& line, int attempt) {
  return moved(line, attempt, 0.4142135623730951);
}

// On which side of the edge from a to b the line lies: the same value, negated, from b to a, so
// that exactly one of two triangles at an edge has the line, whatever the rounding.
double side(const TriangleMesh& mesh, int a, int b, double y, double z, bool& left) {
  const Vec3& low = mesh.vertices[std::min(a, b)];
  const Vec3& high = mesh.vertices[std::max(a, b)];
  const double area = (low.y() - y) * (high.z() - z) - (high.y() - y) * (low.z() - z);
  left = (area >= 0) == (a < b);
  return std::abs(area);
}

bool cross(const TriangleMesh& mesh, const std::array<int, 3>& t, double y, double z,
           Crossing& crossing) {
  bool left[3];
  double weight[3];  // each edge's area belongs to the corner opposite
  for (int k = 0; k < 3; ++k) {
    weight[(k + 2) % 3] = side(mesh, t[k], t[(k + 1) % 3], y, z, left[k]);
  }
  if (left[0] != left[1] || left[1] != left[2]) return false;
  const double sum = weight[0] + weight[1] + weight[2];
  if (!(sum > 0)) return false;
  crossing.x = 0;
  for (int k = 0; k < 3; ++k) crossing.x += weight[k] / sum * mesh.vertices[t[k]].x();
  crossing.step = left[0] ? -1 : 1;  // the normal's x is positive: a way out
  return true;
}

// Turns crossings into intervals; false when they do not close.
bool close(std::vector<Crossing>& crossings, std::vector<Interval>& intervals) {
  intervals.clear();
  std::sort(crossings.begin(), crossings.end(), [](const Crossing& a, const Crossing& b) {
    return a.x < b.x || (a.x == b.x && a.step > b.step);
  });
  int winding = 0;
  for (const Crossing& c : crossings) {
    const int before = winding;
    winding += c.step;
    if (before <= 0 && winding > 0) intervals.push_back({c.x, c.x});
    if (before > 0 && winding <= 0) intervals.back().end = c.x;
  }
  return winding == 0;
}

bool line_by_line(const TriangleMesh& mesh, const std::vector<int>& triangles, double y, double z,
                  std::vector<Interval>& intervals) {
  std::vector<Crossing> crossings;
  Crossing crossing;
  for (int t : triangles) {
    if (cross(mesh, mesh.triangles[t], y, z, crossing)) crossings.push_back(crossing);
  }
  return close(crossings, intervals);
}

}  // namespace

void mesh_chords(const TriangleMesh& mesh, const std::vector<int>& triangles,
                 const std::vector<SampleLine>& ys, const std::vector<SampleLine>& zs,
                 std::vector<std::vector<Interval>>& chords) {
  std::vector<double> y_at, z_at;
  for (const SampleLine& line : ys) y_at.push_back(moved_y(line, 0));
  for (const SampleLine& line : zs) z_at.push_back(moved_z(line, 0));
  std::vector<std::vector<Crossing>> crossings(ys.size() * zs.size());
  chords.resize(crossings.size());

  Crossing crossing;
  for (int t : triangles) {
    const std::array<int, 3>& triangle = mesh.triangles[t];
    const Vec3 &a = mesh.vertices[triangle[0]], &b = mesh.vertices[triangle[1]],
               &c = mesh.vertices[triangle[2]];
    const Vec3 low = a.cwiseMin(b).cwiseMin(c), high = a.cwiseMax(b).cwiseMax(c);
    const auto y0 = std::lower_bound(y_at.begin(), y_at.end(), low.y()) - y_at.begin();
    const auto y1 = std::upper_bound(y_at.begin(), y_at.end(), high.y()) - y_at.begin();
    for (std::size_t iz = 0; iz < z_at.size(); ++iz) {
      if (z_at[iz] < low.z() || z_at[iz] > high.z()) continue;
      for (auto iy = y0; iy < y1; ++iy) {
        if (!cross(mesh, triangle, y_at[iy], z_at[iz], crossing)) continue;
        crossings[iz * ys.size() + iy].push_back(crossing);
      }
    }
  }

  for (std::size_t iz = 0; iz < zs.size(); ++iz) {
    for (std::size_t iy = 0; iy < ys.size(); ++iy) {
      const std::size_t i = iz * ys.size() + iy;
      bool closed = close(crossings[i], chords[i]);
      for (int attempt = 1; !closed && attempt < 32; ++attempt) {
        closed = line_by_line(mesh, triangles, moved_y(ys[iy], attempt), moved_z(zs[iz], attempt),
                              chords[i]);
      }
      if (closed) continue;
      throw std::invalid_argument(
          "has triangles so thin that no line through them counts in and out alike: remesh it");
    }
  }
}

}  // namespace tissue_sim
