#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <unordered_map>

#include "geometry/mesh.h"
#include "geometry/obj.h"
#include "geometry/off.h"
#include "geometry/ply.h"
#include "geometry/stl.h"
#include "scene/read_file.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace {

struct Corner {
  std::int64_t x, y, z;
  bool operator==(const Corner& o) const { return x == o.x && y == o.y && z == o.z; }
};

struct CornerHash {
  std::size_t operator()(const Corner& c) const {
    std::uint64_t h = 0;
    for (std::int64_t v : {c.x, c.y, c.z}) {
      h = (h ^ static_cast<std::uint64_t>(v)) * 0x9E3779B97F4A7C15ull;
      h ^= h >> 29;
    }
    return h;
  }
};

/// The same for equal numbers.
std::int64_t bits_of(double value) {
  const double same = value == 0 ? 0 : value;  // of either sign
  std::int64_t bits;
  std::memcpy(&bits, &same, sizeof bits);
  return bits;
}

/// In small letters.
std::string extension_of(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

using Read = TriangleMesh (*)(const std::string& bytes);

/// What reads files of that extension; nullptr for none.
Read reader_of(const std::string& extension) {
  return extension == ".stl"   ? read_stl
         : extension == ".obj" ? read_obj
         : extension == ".ply" ? read_ply
         : extension == ".off" ? read_off
                               : nullptr;
}

}  // namespace

void merge_vertices(TriangleMesh& mesh, double distance) {
  // Cells as large as the distance, so that what is near lies in the 27 cells around; without a
  // distance each place has a cell of its own.
  const double cell = distance > 0 ? distance : 1e-9;
  const int reach = distance > 0 ? 1 : 0;
  std::unordered_multimap<Corner, int, CornerHash> kept_in;
  std::vector<Vec3> kept;
  std::vector<int> index(mesh.vertices.size());
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (v % 4096 == 0) stop_if_asked();
    const Vec3& p = mesh.vertices[v];
    const auto along = [&](int axis) {          // clamped: coordinates may be absurd still
      if (reach == 0) return bits_of(p[axis]);  // else many may share a cell, which takes for ever
      return static_cast<std::int64_t>(std::max(-9e18, std::min(9e18, std::floor(p[axis] / cell))));
    };
    const Corner c{along(0), along(1), along(2)};
    int found = -1;
    for (int dz = -reach; dz <= reach; ++dz) {
      for (int dy = -reach; dy <= reach; ++dy) {
        for (int dx = -reach; dx <= reach; ++dx) {
          const auto range = kept_in.equal_range({c.x + dx, c.y + dy, c.z + dz});
          for (auto it = range.first; it != range.second; ++it) {
            if ((kept[it->second] - p).squaredNorm() > distance * distance) continue;
            if (found < 0 || it->second < found) found = it->second;  // whatever the hash's order
          }
        }
      }
    }
    if (found < 0) {
      found = static_cast<int>(kept.size());
      kept.push_back(p);
      kept_in.emplace(c, found);
    }
    index[v] = found;
  }
  mesh.vertices.swap(kept);
  std::vector<std::array<int, 3>> triangles;
  for (const auto& t : mesh.triangles) {
    const std::array<int, 3> m = {index[t[0]], index[t[1]], index[t[2]]};
    if (m[0] != m[1] && m[1] != m[2] && m[2] != m[0]) triangles.push_back(m);
  }
  mesh.triangles.swap(triangles);
}

void drop_unused_vertices(TriangleMesh& mesh) {
  std::vector<int> index(mesh.vertices.size(), -1);
  for (const auto& t : mesh.triangles) {
    for (int v : t) index[v] = 0;
  }
  int kept = 0;
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (index[v] < 0) continue;
    mesh.vertices[kept] = mesh.vertices[v];
    index[v] = kept++;
  }
  mesh.vertices.resize(kept);
  for (auto& t : mesh.triangles) {
    for (int& v : t) v = index[v];
  }
}

TriangleMesh read_mesh(const std::string& path) {
  const std::string what = "mesh " + path;
  TriangleMesh mesh;
  try {
    const std::string bytes = read_file(path, kLargestMesh);
    const Read read = reader_of(extension_of(path));
    if (read == nullptr) {
      throw std::invalid_argument(
          "is of no known format: give a surface as STL, OBJ, PLY or OFF, or tetrahedra as .msh, "
          ".vtk, .vtu, .mesh, or .node and .ele");
    }
    if (bytes.empty()) throw std::invalid_argument("is empty: export it again");
    mesh = read(bytes);
  } catch (const std::invalid_argument& e) {
    throw std::invalid_argument(what + " " + e.what());
  }
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (mesh.vertices[v].allFinite()) continue;
    throw std::invalid_argument(what + " has coordinates that are not finite (vertex " +
                                std::to_string(v) + "): repair it");
  }
  merge_vertices(mesh, 0);
  drop_unused_vertices(mesh);
  if (mesh.triangles.empty()) {
    throw std::invalid_argument(what + " has no triangles: export a surface");
  }
  return mesh;
}

}  // namespace tissue_sim
