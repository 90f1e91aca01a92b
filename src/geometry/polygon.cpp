#include "geometry/polygon.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>

#include "scene/scene_text.h"

namespace tissue_sim {
namespace polygon_corners {
namespace {

/// Twice the area of a triangle, seen against the normal of the face.
double turn(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& normal) {
  return (b - a).cross(c - a).dot(normal);
}

/// Whether the corner i can be cut off: it is convex, and no other corner lies within its triangle.
bool is_ear(const TriangleMesh& mesh, const std::vector<int>& ring, std::size_t i,
            const Vec3& normal) {
  const std::size_t n = ring.size();
  const int before = ring[(i + n - 1) % n], at = ring[i], after = ring[(i + 1) % n];
  const Vec3 &a = mesh.vertices[before], &b = mesh.vertices[at], &c = mesh.vertices[after];
  if (!(turn(a, b, c, normal) > 0)) return false;
  return std::none_of(ring.begin(), ring.end(), [&](int v) {
    if (v == before || v == at || v == after) return false;
    const Vec3& x = mesh.vertices[v];
    return turn(a, b, x, normal) >= 0 && turn(b, c, x, normal) >= 0 && turn(c, a, x, normal) >= 0;
  });
}

bool is_convex(const TriangleMesh& mesh, const std::vector<int>& ring, const Vec3& normal) {
  const std::size_t n = ring.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3 &a = mesh.vertices[ring[i]], &b = mesh.vertices[ring[(i + 1) % n]],
               &c = mesh.vertices[ring[(i + 2) % n]];
    if (!(turn(a, b, c, normal) >= 0)) return false;
  }
  return true;
}

void add_fan(TriangleMesh& mesh, const std::vector<int>& ring) {
  for (std::size_t i = 1; i + 1 < ring.size(); ++i) {
    mesh.triangles.push_back({ring[0], ring[i], ring[i + 1]});
  }
}

}  // namespace
}  // namespace polygon_corners

void add_polygon(TriangleMesh& mesh, const std::vector<double>& corners) {
  using namespace polygon_corners;
  const std::size_t n = corners.size();
  if (n > kMostCorners) {
    throw std::invalid_argument("has a face of " + std::to_string(n) + " corners, more than " +
                                std::to_string(kMostCorners) + ": export it with triangles");
  }
  std::vector<int> ring;
  for (const double corner : corners) {
    if (!(corner >= 0 && corner < static_cast<double>(mesh.vertices.size())) ||
        corner != static_cast<int>(corner)) {
      throw std::invalid_argument("has a face with the vertex " + text(corner) + ", and has " +
                                  std::to_string(mesh.vertices.size()) +
                                  " vertices: export or copy it again");
    }
    ring.push_back(static_cast<int>(corner));
  }
  if (n < 3) return;
  Vec3 normal = Vec3::Zero();  // Newell's: the area as a vector
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3& origin = mesh.vertices[ring[0]];
    normal += (mesh.vertices[ring[i]] - origin).cross(mesh.vertices[ring[(i + 1) % n]] - origin);
  }
  if (n == 3 || is_convex(mesh, ring, normal)) return add_fan(mesh, ring);
  while (ring.size() > 3) {
    std::size_t ear = 0;
    while (ear < ring.size() && !is_ear(mesh, ring, ear, normal)) ++ear;
    if (ear == ring.size()) break;  // it crosses itself
    const std::size_t m = ring.size();
    mesh.triangles.push_back({ring[(ear + m - 1) % m], ring[ear], ring[(ear + 1) % m]});
    ring.erase(ring.begin() + static_cast<std::ptrdiff_t>(ear));
  }
  add_fan(mesh, ring);
}

}  // namespace tissue_sim
