#include <cmath>
#include <cstdio>
#include <filesystem>
#include <stdexcept>

#include "geometry/mesh.h"
#include "scene/scene_text.h"

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

void check_size(const std::string& what, double length, double scale) {
  const double size = length * scale;
  if (size >= 1e-3 && size <= 10) return;
  const std::string hint = scale_hint(size, scale);
  throw std::invalid_argument(what + " is " + rough(size) + " m long at scale " + text(scale) +
                              " (a body must be between 1 mm and 10 m): " +
                              (hint.empty() ? "set scale, in m per unit" : hint));
}

}  // namespace

std::string scale_hint(double size, double scale) {
  if (size >= kSmallestOrgan && size <= kLargestOrgan) return "";
  const double better = plausible_scale(size / scale);
  return better > 0 && better != scale ? "did you forget scale: " + text(better) + "?" : "";
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
    TriangleMesh mesh = read_mesh(path);
    Box box;
    for (const Vec3& v : mesh.vertices) {
      box.min = box.min.cwiseMin(v);
      box.max = box.max.cwiseMax(v);
    }
    const double length = (box.max - box.min).maxCoeff();
    check_size(what, length, body.scale);
    const Eigen::Matrix3d rotation = body.pose.orientation.normalized().toRotationMatrix();
    for (Vec3& v : mesh.vertices) v = rotation * (body.scale * v) + body.pose.position;
    if (look) look(mesh);
    std::vector<std::string> found;
    if (const std::string hint = scale_hint(length * body.scale, body.scale); !hint.empty()) {
      found.push_back("is " + rough(length * body.scale) + " m long at scale " + text(body.scale) +
                      ": " + hint);
    }
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
  } catch (const std::invalid_argument& e) {
    throw std::invalid_argument(prefix + e.what());
  }
}

}  // namespace tissue_sim
