#include "geometry/ray_tree.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tissue_sim {
namespace {

/// Moeller and Trumbore. Where the line meets the triangle's plane within it.
bool meets(const Vec3& origin, const Vec3& direction, const Vec3* corner, double& along,
           double& facing) {
  const Vec3 e1 = corner[1] - corner[0], e2 = corner[2] - corner[0];
  const Vec3 p = direction.cross(e2);
  const double det = e1.dot(p);
  facing = -det;  // direction . (e1 x e2)
  if (det == 0) return false;
  const Vec3 s = origin - corner[0];
  const double u = s.dot(p) / det;
  if (!(u >= 0 && u <= 1)) return false;
  const Vec3 q = s.cross(e1);
  const double v = direction.dot(q) / det;
  if (!(v >= 0 && u + v <= 1)) return false;
  along = e2.dot(q) / det;
  return true;
}

}  // namespace

RayTree::RayTree(const TriangleMesh& mesh)
    : triangles_(mesh.triangles), order_(mesh.triangles.size()) {
  corners_.reserve(3 * triangles_.size());
  for (const auto& t : triangles_) {
    for (const int v : t) corners_.push_back(mesh.vertices[v]);
  }
  std::iota(order_.begin(), order_.end(), 0);
  if (!order_.empty()) build(0, static_cast<int>(order_.size()));
}

int RayTree::build(int begin, int end) {
  const int index = static_cast<int>(nodes_.size());
  nodes_.push_back({Box(), -1, -1, begin, end - begin});
  Box box, centres;
  for (int i = begin; i < end; ++i) {
    const Vec3* c = &corners_[3 * static_cast<std::size_t>(order_[i])];
    for (int k = 0; k < 3; ++k) {
      box.min = box.min.cwiseMin(c[k]);
      box.max = box.max.cwiseMax(c[k]);
    }
    const Vec3 centre = c[0] + c[1] + c[2];
    centres.min = centres.min.cwiseMin(centre);
    centres.max = centres.max.cwiseMax(centre);
  }
  nodes_[index].box = box;
  if (end - begin <= 4) return index;
  int axis = 0;
  (centres.max - centres.min).maxCoeff(&axis);
  const int middle = (begin + end) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                   [&](std::int32_t a, std::int32_t b) {
                     const Vec3 *p = &corners_[3 * static_cast<std::size_t>(a)],
                                *q = &corners_[3 * static_cast<std::size_t>(b)];
                     const double x = p[0][axis] + p[1][axis] + p[2][axis];
                     const double y = q[0][axis] + q[1][axis] + q[2][axis];
                     return x != y ? x < y : a < b;
                   });
  const int left = build(begin, middle);
  const int right = build(middle, end);
  nodes_[index].left = left;
  nodes_[index].right = right;
  return index;
}

template <class F>
void RayTree::walk(const Vec3& origin, const Vec3& direction, const F& meet) const {
  if (nodes_.empty()) return;
  std::vector<std::int32_t> stack = {0};
  double limit = 1e300;
  while (!stack.empty()) {
    const Node& node = nodes_[stack.back()];
    stack.pop_back();
    double near = 0, far = limit;
    for (int a = 0; a < 3 && near <= far; ++a) {
      const double pad = 1e-9 * (1 + std::fabs(node.box.max[a]) + std::fabs(node.box.min[a]));
      const double lo = node.box.min[a] - pad - origin[a], hi = node.box.max[a] + pad - origin[a];
      if (direction[a] == 0) {
        if (lo > 0 || hi < 0) far = -1;
        continue;
      }
      const double one = lo / direction[a], other = hi / direction[a];
      near = std::max(near, std::min(one, other));
      far = std::min(far, std::max(one, other));
    }
    if (near > far) continue;
    if (node.left >= 0) {
      stack.push_back(node.left);
      stack.push_back(node.right);
      continue;
    }
    for (int i = node.begin; i < node.begin + node.count; ++i) {
      double along = 0, facing = 0;
      const Vec3* c = &corners_[3 * static_cast<std::size_t>(order_[i])];
      if (meets(origin, direction, c, along, facing)) meet(order_[i], along, facing, limit);
    }
  }
}

RayHit RayTree::first_exit(const Vec3& origin, const Vec3& direction, int from,
                           double least) const {
  RayHit hit;
  walk(origin, direction, [&](int t, double along, double facing, double& limit) {
    if (!(facing > 0) || along <= least) return;
    if (along > limit || (along == limit && t > hit.triangle)) return;
    const auto& corner = triangles_[t];
    if (from >= 0 && (corner[0] == from || corner[1] == from || corner[2] == from)) return;
    hit = {t, along};
    limit = along;
  });
  return hit;
}

bool RayTree::is_gap_between(const Vec3& a, const Vec3& b) const {
  constexpr double kFacing = -0.3;  // as geometry/gaps.cpp
  const Vec3 way = b - a;
  const RayHit out = first_exit(a, way, -1, 1e-6);
  if (out.triangle < 0 || out.along >= 1 - 1e-6) return false;
  const RayHit in = first_exit(b, -way, -1, 1e-6);
  if (in.triangle < 0 || out.along + in.along > 1 - 1e-4) {
    return false;  // parts that overlap, or walls of a cut, which lie on one another
  }
  const auto normal = [this](int t) {
    const Vec3* c = &corners_[3 * static_cast<std::size_t>(t)];
    return (c[1] - c[0]).cross(c[2] - c[0]).normalized().eval();
  };
  return normal(out.triangle).dot(normal(in.triangle)) < kFacing;
}

int RayTree::winding(const Vec3& origin, const Vec3& direction) const {
  int winding = 0;
  walk(origin, direction, [&](int, double along, double facing, double&) {
    if (along > 0) winding += facing > 0 ? 1 : -1;
  });
  return winding;
}

}  // namespace tissue_sim
