#include <cstdio>
#include <filesystem>
#include <stdexcept>

#include "geometry/mesh.h"
#include "scene/scene_text.h"

namespace tissue_sim {
namespace {

// Three digits are enough to see that a size is absurd.
std::string rough(double value) {
  char digits[32];
  std::snprintf(digits, sizeof(digits), "%.3g", value);
  return digits;
}

// The usual unit that makes `length` units a size that organs have, or 0.
double plausible_scale(double length) {
  for (double scale : {1.0, 0.001, 0.01}) {
    if (length * scale >= 0.005 && length * scale <= 2) return scale;
  }
  return 0;
}

void check_size(const std::string& what, double length, double scale) {
  const double size = length * scale;
  if (size >= 1e-3 && size <= 10) return;
  const double better = plausible_scale(length);
  throw std::invalid_argument(
      what + " is " + rough(size) + " m long at scale " + text(scale) +
      " (a body must be between 1 mm and 10 m): " +
      (better > 0 ? "did you forget scale: " + text(better) + "?" : "set scale, in m per unit"));
}

}  // namespace

TriangleMesh load_solid(const Body& body, std::vector<std::string>* notes) {
  const std::string prefix = "body '" + body.name + "': ";
  std::string what = "mesh " + body.mesh;
  try {
    const std::string path = std::filesystem::absolute(resolve_mesh_path(body.mesh)).string();
    what = "mesh " + path;
    TriangleMesh mesh = read_mesh(path);
    Box box;
    for (const Vec3& v : mesh.vertices) {
      box.min = box.min.cwiseMin(v);
      box.max = box.max.cwiseMax(v);
    }
    check_size(what, (box.max - box.min).maxCoeff(), body.scale);
    const Eigen::Matrix3d rotation = body.pose.orientation.normalized().toRotationMatrix();
    for (Vec3& v : mesh.vertices) v = rotation * (body.scale * v) + body.pose.position;
    std::vector<std::string> found;
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
