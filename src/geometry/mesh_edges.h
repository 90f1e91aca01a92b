// The edges of a triangle mesh, by the sides of triangles that lie at each.
#pragma once

#include <algorithm>
#include <tuple>
#include <utility>
#include <vector>

#include "geometry/mesh.h"

namespace tissue_sim {

/// One side of a triangle.
struct Side {
  int low, high;  ///< vertices, the lower first
  int triangle;
  bool forward;  ///< goes from low to high
};

/// Makes a triangle face the other way.
inline void flip(std::array<int, 3>& triangle) { std::swap(triangle[1], triangle[2]); }

/// Sides by edge, then triangle.
inline std::vector<Side> sorted_sides(const TriangleMesh& mesh) {
  std::vector<Side> sides;
  sides.reserve(3 * mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const int a = mesh.triangles[t][k], b = mesh.triangles[t][(k + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), static_cast<int>(t), a < b});
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return std::tie(a.low, a.high, a.triangle) < std::tie(b.low, b.high, b.triangle);
  });
  return sides;
}

/// Calls visit(first, last) for the sides of each edge.
template <class Visit>
void for_each_edge(const std::vector<Side>& sides, Visit visit) {
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t j = i;
    while (j < sides.size() && sides[j].low == sides[i].low && sides[j].high == sides[i].high) ++j;
    visit(&sides[i], &sides[i] + (j - i));
    i = j;
  }
}

}  // namespace tissue_sim
