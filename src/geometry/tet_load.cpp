#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <stdexcept>

#include "geometry/mesh_parts.h"
#include "geometry/ray_tree.h"
#include "geometry/surface.h"
#include "geometry/tet_mesh.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace {

/// Those that a file gives in several groups.
void drop_repeated(TetMesh& mesh, std::vector<std::string>& notes) {
  std::set<std::array<int, 4>> seen;
  std::vector<std::array<int, 4>> kept;
  for (const auto& t : mesh.tetrahedra) {
    std::array<int, 4> sorted = t;
    std::sort(sorted.begin(), sorted.end());
    if (seen.insert(sorted).second) kept.push_back(t);
  }
  const std::size_t repeated = mesh.tetrahedra.size() - kept.size();
  if (repeated > 0) {
    notes.push_back("left out " + std::to_string(repeated) + " tetrahedra given twice");
  }
  mesh.tetrahedra.swap(kept);
}

/// Notes how many faces neighbours do not share as they should.
void check_faces(const TetMesh& mesh, std::vector<std::string>& notes) {
  std::vector<std::array<int, 4>> faces;  // corners in order, and from which side they are seen
  for (const auto& t : mesh.tetrahedra) {
    for (int without = 0; without < 4; ++without) {
      std::array<int, 4> f;
      int side = without % 2;
      for (int i = 0, k = 0; i < 4; ++i) {
        if (i != without) f[k++] = t[i];
      }
      for (const auto& [a, b] : {std::pair(0, 1), std::pair(1, 2), std::pair(0, 1)}) {
        if (f[a] < f[b]) continue;
        std::swap(f[a], f[b]);
        side ^= 1;
      }
      f[3] = side;
      faces.push_back(f);
    }
  }
  std::sort(faces.begin(), faces.end());
  int overlapping = 0;
  for (std::size_t i = 0, end; i < faces.size(); i = end) {
    int sides = 0;
    for (end = i; end < faces.size() && std::equal(&faces[i][0], &faces[i][3], &faces[end][0]);
         ++end) {
      sides += faces[end][3];
    }
    overlapping += end - i > 2 || (end - i == 2 && sides != 1);
  }
  if (overlapping > 0) {
    notes.push_back("has " + std::to_string(overlapping) +
                    " faces with two tetrahedra on one side: they overlap");
  }
  const TriangleMesh surface{mesh.vertices, boundary(mesh)};
  const RayTree tree(surface);
  int mismatched = 0;
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    if (i % 4096 == 0) stop_if_asked();
    const auto& t = surface.triangles[i];
    const Vec3 &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
    const Vec3 normal = (b - a).cross(c - a);
    const double outwards = 1e-3 / std::sqrt(normal.norm());
    mismatched +=
        tree.winding((a + b + c) / 3 + outwards * normal, Vec3(0.5774, 0.3107, 0.7553)) > 0;
  }
  if (mismatched > 0) {
    notes.push_back("has " + std::to_string(mismatched) +
                    " faces behind which it goes on, but by tetrahedra that do not share them: it "
                    "is open there (vertices given twice, or faces halved in two ways)");
  }
}

}  // namespace

TetMesh load_tet_file(const std::string& path, std::vector<std::string>* notes) {
  std::vector<std::string> found;
  TetMesh mesh = read_tets(path, &found);
  drop_repeated(mesh, found);
  try {
    check_tets(mesh, found);
  } catch (const std::invalid_argument& e) {
    throw std::invalid_argument("mesh " + path + " " + e.what());
  }
  if (notes == nullptr) return mesh;
  check_faces(mesh, found);
  notes->insert(notes->end(), found.begin(), found.end());
  return mesh;
}

TetMesh load_tets(const Body& body, double edge, std::vector<std::string>* notes) {
  TetMesh mesh;
  const bool is_file = body.shape == Shape::kMesh && is_tet_file(body.mesh);
  if (body.shape == Shape::kBox && !is_meshed(body)) {
    mesh = tetrahedralize_box(body.size, edge);
  } else if (!is_file) {
    const TriangleMesh surface =
        is_meshed(body) ? load_solid(body, notes) : triangulate(body, 0.5 * edge);
    try {
      TetMesh all;
      for (const TriangleMesh& solid : separate_solids(surface)) {
        const TetMesh mesh = stuff_surface(solid, edge);
        const auto first = static_cast<int>(all.vertices.size());
        all.vertices.insert(all.vertices.end(), mesh.vertices.begin(), mesh.vertices.end());
        for (std::array<int, 4> t : mesh.tetrahedra) {
          for (int& v : t) v += first;
          all.tetrahedra.push_back(t);
        }
      }
      return all;
    } catch (const TooLarge& e) {
      throw TooLarge("body '" + body.name + "': " + e.what());
    } catch (const std::invalid_argument& e) {
      throw std::invalid_argument("body '" + body.name + "': " + e.what());
    }
  } else {
    const std::string prefix = "body '" + body.name + "': ";
    try {
      const std::string path = std::filesystem::absolute(resolve_path(body.mesh, "mesh")).string();
      std::vector<std::string> found;
      mesh = load_tet_file(path, notes != nullptr ? &found : nullptr);
      check_size("mesh " + path, mesh.vertices, body, found);
      for (const std::string& note : found) {
        if (notes != nullptr) notes->push_back(prefix + "mesh " + path + " " + note);
      }
      for (Vec3& x : mesh.vertices) x *= body.scale;
    } catch (const std::invalid_argument& e) {
      throw std::invalid_argument(prefix + e.what());
    }
  }
  const Eigen::Matrix3d rotation = body.pose.orientation.normalized().toRotationMatrix();
  for (Vec3& x : mesh.vertices) x = rotation * x + body.pose.position;
  return mesh;
}

}  // namespace tissue_sim
