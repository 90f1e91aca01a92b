#include <cmath>
#include <cstdio>
#include <filesystem>
#include <stdexcept>
#include <utility>

#include "geometry/nearest_surface.h"
#include "geometry/surface.h"
#include "geometry/tet_mesh.h"
#include "scene/scene_text.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace {

constexpr double kSmallestOrgan = 0.005, kLargestOrgan = 2;  // [m]

// Three digits are enough to see that a size is absurd.
std::string rough(double value) {
  char digits[32];
  std::snprintf(digits, sizeof(digits), "%.3g", value);
  return digits;
}

// The unit that files come in, of those that make `length` units a size that organs have, by which
// it comes nearest to a tenth of a metre; 0 without one.
double plausible_scale(double length) {
  double best = 0, least = 1e300;
  for (double scale : {1.0, 0.001, 0.01}) {
    const double size = length * scale;
    if (size < kSmallestOrgan || size > kLargestOrgan) continue;
    const double off = std::abs(std::log(size / 0.1));
    if (off < least) best = scale, least = off;
  }
  return best;
}

}  // namespace

std::string scale_hint(double size, double scale) {
  if (size >= kSmallestOrgan && size <= kLargestOrgan) return "";
  const double better = plausible_scale(size / scale);
  return better > 0 && better != scale ? "did you forget scale: " + text(better) + "?" : "";
}

void check_size(const std::string& what, const std::vector<Vec3>& vertices, const Body& body,
                std::vector<std::string>& notes) {
  Box box;
  for (const Vec3& v : vertices) {
    box.min = box.min.cwiseMin(v);
    box.max = box.max.cwiseMax(v);
  }
  const double size = body.scale * (box.max - box.min).maxCoeff();
  const std::string hint = scale_hint(size, body.scale);
  const std::string length = rough(size) + " m long at scale " + text(body.scale);
  if (!(size >= 1e-3 && size <= 10)) {
    throw std::invalid_argument(what + " is " + length +
                                " (a body must be between 1 mm and 10 m): " +
                                (hint.empty() ? "set scale, in m per unit" : hint));
  }
  if (!hint.empty()) notes.push_back("is " + length + ": " + hint);
  constexpr double kFar = 3;  // sizes
  const Vec3 middle = body.scale * (box.min + box.max) / 2,
             at = body.pose.position + body.pose.orientation.normalized() * middle;
  if (middle.norm() < kFar * size || at.norm() < kFar * size) return;
  const Vec3 centring = body.pose.position - at;
  notes.push_back(
      "lies " + rough(at.norm()) + " m from the world's origin, " + rough(at.norm() / size) +
      " times its size, for it is as far from its file's: position [" + rough(centring.x()) + ", " +
      rough(centring.y()) + ", " + rough(centring.z()) + "] would centre it there");
}

namespace {

/// The surface of a body with a wall, without its hollow.
TriangleMesh outside_of(Body body, std::vector<std::string>* notes,
                        const std::function<void(const TriangleMesh&)>& look) {
  const double wall = std::exchange(body.wall, 0.0);
  if (body.shape == Shape::kMesh) return load_solid(body, notes, look);
  TriangleMesh mesh = triangulate(body, wall / 2);
  if (look) look(mesh);
  return mesh;
}

TriangleMesh load_shell(const Body& body, std::vector<std::string>* notes,
                        const std::function<void(const TriangleMesh&)>& look) {
  TriangleMesh mesh = outside_of(body, notes, look);
  const TriangleMesh hollow = hollow_of(body);
  const auto first = static_cast<int>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), hollow.vertices.begin(), hollow.vertices.end());
  for (const auto& t : hollow.triangles) {
    mesh.triangles.push_back({first + t[0], first + t[2], first + t[1]});
  }
  return mesh;
}

}  // namespace

TriangleMesh hollow_of(const Body& body) {
  Body inner = body;
  const double wall = body.wall;
  if (body.shape != Shape::kMesh) {
    inner.size -= Vec3::Constant(2 * wall);
    inner.radius -= wall;
    inner.radii -= Vec3::Constant(wall);
    inner.height -= 2 * wall;
    return triangulate(inner, wall / 2);
  }
  if (is_tet_file(body.mesh)) {
    throw std::invalid_argument(
        "body '" + body.name + "': mesh " + body.mesh +
        " has tetrahedra, which fill it: give its surface to make it hollow");
  }
  TriangleMesh mesh = outside_of(body, nullptr, {});
  std::vector<Vec3> normal(mesh.vertices.size(), Vec3::Zero());
  for (const auto& t : mesh.triangles) {
    const Vec3 area = (mesh.vertices[t[1]] - mesh.vertices[t[0]])
                          .cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]);
    for (const int v : t) normal[v] += area;
  }
  inner.wall = 0;
  const NearestSurface outside(inner, 1.1 * wall);
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    mesh.vertices[i] -= wall * normal[i].normalized();
    SurfacePoint nearest;
    if (outside.find(mesh.vertices[i], normal[i], nearest) &&
        (nearest.place - mesh.vertices[i]).norm() >= 0.8 * wall) {
      continue;
    }
    throw std::invalid_argument("body '" + body.name + "': a wall of " + text(wall) +
                                " m does not fit everywhere into mesh " + body.mesh +
                                ": make it thinner, or give a mesh with its hollow");
  }
  return mesh;
}

TriangleMesh load_solid(const Body& body, std::vector<std::string>* notes,
                        const std::function<void(const TriangleMesh&)>& look) {
  if (body.wall > 0) return load_shell(body, notes, look);
  const std::string prefix = "body '" + body.name + "': ";
  std::string what = "mesh " + body.mesh;
  try {
    const std::filesystem::path given = resolve_path(body.mesh, "mesh");
    const std::string path = std::filesystem::absolute(given).string();
    what = "mesh " + path;
    std::error_code error;
    if (given.is_relative() && !std::filesystem::exists(path, error)) {
      throw std::invalid_argument(what + " does not exist (" + given.string() +
                                  " is looked for in the folder that this program runs in): give "
                                  "the full path");
    }
    std::vector<std::string> found;
    TriangleMesh mesh;
    if (is_tet_file(path)) {
      const TetMesh tets = load_tet_file(path, notes != nullptr ? &found : nullptr);
      mesh = {tets.vertices, boundary(tets)};
      drop_unused_vertices(mesh);
      found.push_back("has " + std::to_string(tets.tetrahedra.size()) +
                      " tetrahedra, and what their surface encloses is filled");
    } else {
      mesh = read_mesh(path);
    }
    check_size(what, mesh.vertices, body, found);
    const Eigen::Matrix3d rotation = body.pose.orientation.normalized().toRotationMatrix();
    for (Vec3& v : mesh.vertices) v = rotation * (body.scale * v) + body.pose.position;
    if (look) look(mesh);
    try {
      make_solid(mesh, found);
    } catch (const std::invalid_argument& e) {
      throw std::invalid_argument(what + " " + e.what());
    }
    if (!(signed_volume(mesh) > 0)) {
      throw std::invalid_argument(what + " encloses no volume: export a solid");
    }
    for (const std::string& note : found) {
      if (notes) notes->push_back(prefix + what + " " + note);
    }
    return mesh;
  } catch (const TooLarge& e) {
    throw TooLarge(prefix + e.what());
  } catch (const std::invalid_argument& e) {
    throw std::invalid_argument(prefix + e.what());
  }
}

}  // namespace tissue_sim
