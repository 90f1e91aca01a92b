// The first triangle that a ray meets, by a tree of boxes.
#pragma once

#include <cstdint>
#include <vector>

#include "geometry/mesh.h"

namespace tissue_sim {

struct RayHit {
  int triangle = -1;  ///< -1 for none
  double along = 0;   ///< of the ray's direction: the place is origin + along * direction
};

class RayTree {
 public:
  explicit RayTree(const TriangleMesh& mesh);
  /// The nearest triangle beyond `least` along the ray that the ray leaves the body through (its
  /// normal has a share in the direction: what a ray against the inward normals meets) and that
  /// has none of its corners at `from` (-1: any). Of equals the lowest.
  RayHit first_exit(const Vec3& origin, const Vec3& direction, int from, double least) const;
  /// Whether void lies between two places of the solid, walls of which look at each other there.
  bool is_gap_between(const Vec3& a, const Vec3& b) const;
  /// How often a ray crosses the surface outwards minus inwards: above 0 inside of a solid whose
  /// parts may overlap. Meets edges and corners by chance only where `direction` is irrational.
  int winding(const Vec3& origin, const Vec3& direction) const;

 private:
  struct Node {
    Box box;
    std::int32_t left, right;   // children; left is -1 in a leaf
    std::int32_t begin, count;  // of order_
  };
  int build(int begin, int end);
  template <class F>
  void walk(const Vec3& origin, const Vec3& direction, const F& meet) const;

  std::vector<Vec3> corners_;  // three for each triangle
  std::vector<std::array<int, 3>> triangles_;
  std::vector<std::int32_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace tissue_sim
