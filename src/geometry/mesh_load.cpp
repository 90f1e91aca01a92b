#include <cmath>
#include <cstdio>
#include <filesystem>
#include <stdexcept>

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

TriangleMesh load_solid(const Body& body, std::vector<std::string>* notes,
                        const std::function<void(const TriangleMesh&)>& look) {
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
