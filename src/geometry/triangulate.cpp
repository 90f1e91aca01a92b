// Triangles for a scene's shapes: grids on the faces of a cube, bent to what they are to be.
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "geometry/surface.h"
#include "scene/scene_text.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace {

constexpr double kPi = 3.14159265358979323846;

/// The surface of the cube from -1 to 1, n[a] grid cells along axis a, diagonals to and fro.
TriangleMesh cube(const std::array<int, 3>& n) {
  TriangleMesh mesh;
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (const int side : {-1, 1}) {
      const int first = static_cast<int>(mesh.vertices.size());
      for (int j = 0; j <= n[v]; ++j) {
        for (int i = 0; i <= n[u]; ++i) {
          Vec3 x;
          x[axis] = side;
          x[u] = 2.0 * i / n[u] - 1;
          x[v] = 2.0 * j / n[v] - 1;
          mesh.vertices.push_back(x);
        }
      }
      const auto at = [&](int i, int j) { return first + j * (n[u] + 1) + i; };
      const auto add = [&](int a, int b, int c) {
        if (side < 0) std::swap(b, c);
        mesh.triangles.push_back({a, b, c});
      };
      for (int j = 0; j < n[v]; ++j) {
        for (int i = 0; i < n[u]; ++i) {
          const int a = at(i, j), b = at(i + 1, j), c = at(i + 1, j + 1), d = at(i, j + 1);
          if ((i + j) % 2 == 0) {
            add(a, b, c);
            add(a, c, d);
          } else {
            add(a, b, d);
            add(b, c, d);
          }
        }
      }
    }
  }
  merge_vertices(mesh, 1e-9);
  return mesh;
}

double cells(double length, double edge) { return std::max(1.0, std::round(length / edge)); }

/// The surface of a cube with that many cells along each axis; throws for more than is sensible.
TriangleMesh cube(const Body& body, double x, double y, double z) {
  if (const double vertices = 2 * (x * y + y * z + z * x);
      !(vertices <= static_cast<double>(work_limits().max_points))) {
    throw TooLarge("body '" + body.name + "': it takes " + text(vertices) +
                   " vertices of its surface, more than " +
                   std::to_string(work_limits().max_points) + ": raise cell_size");
  }
  return cube({static_cast<int>(x), static_cast<int>(y), static_cast<int>(z)});
}

/// From the square to the disc, square rings to rings, evenly along them (Shirley and Chiu 1997).
void to_disc(double& x, double& y) {
  const double r = std::max(std::fabs(x), std::fabs(y));
  if (r == 0) return;
  const double angle = std::fabs(x) >= std::fabs(y)
                           ? (x < 0 ? kPi : 0) + kPi / 4 * (y / x)
                           : (y < 0 ? -kPi / 2 : kPi / 2) - kPi / 4 * (x / y);
  x = r * std::cos(angle);
  y = r * std::sin(angle);
}

}  // namespace

TriangleMesh triangulate(const Body& body, double edge) {
  TriangleMesh mesh;
  switch (body.shape) {
    case Shape::kBox:
      mesh = cube(body, cells(body.size.x(), edge), cells(body.size.y(), edge),
                  cells(body.size.z(), edge));
      for (Vec3& x : mesh.vertices) x = 0.5 * x.cwiseProduct(body.size);
      break;
    case Shape::kBall:
    case Shape::kEllipsoid: {
      const Vec3 radii = body.shape == Shape::kBall ? Vec3::Constant(body.radius) : body.radii;
      mesh = cube(body, cells(kPi / 2 * radii[0], edge), cells(kPi / 2 * radii[1], edge),
                  cells(kPi / 2 * radii[2], edge));
      for (Vec3& x : mesh.vertices) {
        for (int a = 0; a < 3; ++a) x[a] = std::tan(kPi / 4 * x[a]);  // evenly along the arcs
        x = x.normalized().cwiseProduct(radii);
      }
      break;
    }
    case Shape::kCylinder: {
      const double around = cells(kPi / 2 * body.radius, edge);
      mesh = cube(body, around, around, cells(body.height, edge));
      for (Vec3& x : mesh.vertices) {
        to_disc(x.x(), x.y());
        x = x.cwiseProduct(Vec3(body.radius, body.radius, body.height / 2));
      }
      break;
    }
    case Shape::kMesh:
      break;
  }
  const Eigen::Matrix3d rotation = body.pose.orientation.normalized().toRotationMatrix();
  for (Vec3& x : mesh.vertices) x = rotation * x + body.pose.position;
  return mesh;
}

}  // namespace tissue_sim
