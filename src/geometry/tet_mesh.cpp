#include "geometry/tet_mesh.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

namespace tissue_sim {
namespace {

double volume_of(const std::vector<Vec3>& x, const std::array<int, 4>& t) {
  return (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).dot(x[t[3]] - x[t[0]]) / 6;
}

std::string numbers(const std::vector<int>& list) {
  std::string s;
  for (std::size_t i = 0; i < list.size() && i < 10; ++i) {
    s += (i > 0 ? ", " : "") + std::to_string(list[i]);
  }
  return s + (list.size() > 10 ? ", ..." : "");
}

}  // namespace

double volume(const TetMesh& mesh, int t) { return volume_of(mesh.vertices, mesh.tetrahedra[t]); }

double volume(const TetMesh& mesh) {
  double sum = 0;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) sum += volume(mesh, static_cast<int>(t));
  return sum;
}

double smallest_dihedral(const TetMesh& mesh, int t) {
  const auto& c = mesh.tetrahedra[t];
  Vec3 normal[4];  // of the face opposite to each corner, outwards
  for (int i = 0; i < 4; ++i) {
    const Vec3 &a = mesh.vertices[c[(i + 1) % 4]], &b = mesh.vertices[c[(i + 2) % 4]],
               &d = mesh.vertices[c[(i + 3) % 4]];
    normal[i] = (b - a).cross(d - a).stableNormalized();
    if (normal[i].dot(mesh.vertices[c[i]] - a) > 0) normal[i] = -normal[i];
  }
  double least = 4;
  for (int i = 0; i < 4; ++i) {
    for (int j = i + 1; j < 4; ++j) {
      least = std::min(least, std::acos(std::max(-1.0, std::min(1.0, -normal[i].dot(normal[j])))));
    }
  }
  return least;
}

void check_tets(TetMesh& mesh, std::vector<std::string>& notes) {
  std::vector<int> flat, inverted;
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    auto& c = mesh.tetrahedra[t];
    double longest = 0;
    for (int i = 0; i < 4; ++i) {
      for (int j = i + 1; j < 4; ++j) {
        longest = std::max(longest, (mesh.vertices[c[i]] - mesh.vertices[c[j]]).norm());
      }
    }
    const double v = volume_of(mesh.vertices, c);
    if (!(std::fabs(6 * v) > 1e-6 * longest * longest * longest)) {
      flat.push_back(static_cast<int>(t));
    } else if (v < 0) {
      std::swap(c[2], c[3]);
      inverted.push_back(static_cast<int>(t));
    }
  }
  if (!flat.empty()) {
    throw std::invalid_argument("has " + std::to_string(flat.size()) +
                                " tetrahedra without volume (" + numbers(flat) +
                                "): nothing says how they resist, mesh it again");
  }
  if (!inverted.empty()) {
    const bool all = inverted.size() == mesh.tetrahedra.size();
    notes.push_back(all ? "has all its tetrahedra inverted, and they are turned around"
                        : "had " + std::to_string(inverted.size()) + " inverted tetrahedra (" +
                              numbers(inverted) + "), now turned around");
  }
  std::vector<int> index(mesh.vertices.size(), -1);
  std::vector<Vec3> used;
  for (auto& t : mesh.tetrahedra) {
    for (int& v : t) {
      if (index[v] < 0) {
        index[v] = static_cast<int>(used.size());
        used.push_back(mesh.vertices[v]);
      }
      v = index[v];
    }
  }
  if (used.size() < mesh.vertices.size()) {
    notes.push_back("left out " + std::to_string(mesh.vertices.size() - used.size()) +
                    " vertices that no tetrahedron has");
  }
  mesh.vertices.swap(used);
}

std::vector<std::array<int, 3>> boundary(const TetMesh& mesh) {
  // Each face, seen from outside of its tetrahedron; what two have is within.
  constexpr int kFace[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
  std::map<std::array<int, 3>, std::pair<std::array<int, 3>, int>> faces;
  for (const auto& t : mesh.tetrahedra) {
    for (const auto& f : kFace) {
      const std::array<int, 3> face = {t[f[0]], t[f[1]], t[f[2]]};
      std::array<int, 3> key = face;
      std::sort(key.begin(), key.end());
      auto& of = faces[key];
      of.first = face;
      ++of.second;
    }
  }
  std::vector<std::array<int, 3>> triangles;
  for (const auto& [key, of] : faces) {
    if (of.second == 1) triangles.push_back(of.first);
  }
  return triangles;
}

}  // namespace tissue_sim
