#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <unordered_map>

#include "geometry/mesh.h"
#include "geometry/stl.h"

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

void append(const aiScene& scene, const aiNode& node, aiMatrix4x4 transform, TriangleMesh& mesh) {
  transform = transform * node.mTransformation;
  for (unsigned m = 0; m < node.mNumMeshes; ++m) {
    const aiMesh& part = *scene.mMeshes[node.mMeshes[m]];
    const int first = static_cast<int>(mesh.vertices.size());
    for (unsigned v = 0; v < part.mNumVertices; ++v) {
      const aiVector3D p = transform * part.mVertices[v];
      mesh.vertices.emplace_back(p.x, p.y, p.z);
    }
    for (unsigned f = 0; f < part.mNumFaces; ++f) {
      const aiFace& face = part.mFaces[f];
      if (face.mNumIndices != 3) continue;  // points and lines bound no volume
      mesh.triangles.push_back({first + static_cast<int>(face.mIndices[0]),
                                first + static_cast<int>(face.mIndices[1]),
                                first + static_cast<int>(face.mIndices[2])});
    }
  }
  for (unsigned c = 0; c < node.mNumChildren; ++c) {
    append(scene, *node.mChildren[c], transform, mesh);
  }
}

/// In small letters.
std::string extension_of(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

bool readable(const std::filesystem::path& path) {
  const std::string extension = extension_of(path);
  return extension == ".stl" || extension == ".obj" || extension == ".ply" || extension == ".off";
}

TriangleMesh read_by_assimp(const std::string& path) {
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile(path, aiProcess_Triangulate);
  if (!scene || !scene->mRootNode) {
    throw std::invalid_argument(std::string("cannot be read (") + importer.GetErrorString() +
                                "): export it again as a binary STL");
  }
  TriangleMesh mesh;
  append(*scene, *scene->mRootNode, aiMatrix4x4(), mesh);
  return mesh;
}

std::string bytes_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream bytes;
  if (!file || !(bytes << file.rdbuf())) {
    throw std::invalid_argument("cannot be read: check its permissions");
  }
  return bytes.str();
}

}  // namespace

void merge_vertices(TriangleMesh& mesh, double distance) {
  // Cells as large as the distance, so that what is near lies in the 27 cells around; without a
  // distance any size does, and only the own cell counts.
  const double cell = distance > 0 ? distance : 1e-9;
  const int reach = distance > 0 ? 1 : 0;
  std::unordered_multimap<Corner, int, CornerHash> kept_in;
  std::vector<Vec3> kept;
  std::vector<int> index(mesh.vertices.size());
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const Vec3& p = mesh.vertices[v];
    const auto along = [&](int axis) {  // clamped: coordinates may be absurd still
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
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    throw std::invalid_argument(what + " does not exist: check the path");
  }
  if (!std::filesystem::is_regular_file(path, error)) {
    throw std::invalid_argument(what + " is no file: give an STL, OBJ, PLY or OFF file");
  }
  if (!readable(path)) {
    throw std::invalid_argument(what + " is of no known format: give an STL, OBJ, PLY or OFF file");
  }
  if (std::filesystem::file_size(path, error) == 0) {
    throw std::invalid_argument(what + " is empty: export it again");
  }
  TriangleMesh mesh;
  try {
    mesh = extension_of(path) == ".stl" ? read_stl(bytes_of(path)) : read_by_assimp(path);
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
