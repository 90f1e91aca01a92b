// Small meshes for tests, and their files.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <sstream>

#include "geometry/mesh.h"

namespace tissue_sim {

/// A box from `low` to `high`, facing outwards, 12 triangles.
inline TriangleMesh box_mesh(const Vec3& low, const Vec3& high) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.vertices.emplace_back(i & 1 ? high.x() : low.x(), i & 2 ? high.y() : low.y(),
                               i & 4 ? high.z() : low.z());
  }
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

/// An icosahedron, each triangle split in four `levels` times, all vertices on the sphere.
inline TriangleMesh icosphere(const Vec3& center, double radius, int levels) {
  const double g = (1 + std::sqrt(5.0)) / 2;
  TriangleMesh mesh;
  mesh.vertices = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                   {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  mesh.triangles = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                    {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                    {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                    {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<int, int>, int> middles;
    const auto middle = [&](int a, int b) {
      const auto found = middles.emplace(std::minmax(a, b), static_cast<int>(mesh.vertices.size()));
      const Vec3 m = (mesh.vertices[a].normalized() + mesh.vertices[b].normalized()) / 2;
      if (found.second) mesh.vertices.push_back(m);
      return found.first->second;
    };
    std::vector<std::array<int, 3>> finer;
    for (const auto& t : mesh.triangles) {
      const int ab = middle(t[0], t[1]), bc = middle(t[1], t[2]), ca = middle(t[2], t[0]);
      finer.insert(finer.end(), {{t[0], ab, ca}, {t[1], bc, ab}, {t[2], ca, bc}, {ab, bc, ca}});
    }
    mesh.triangles = finer;
  }
  for (Vec3& v : mesh.vertices) v = center + radius * v.normalized();
  return mesh;
}

/// A prism over an L: 2 x 2 without its upper right quarter, one high; volume 3.
inline TriangleMesh l_shape() {
  const double corners[6][2] = {{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}};
  TriangleMesh mesh;
  for (int z = 0; z < 2; ++z) {
    for (const auto& c : corners) mesh.vertices.emplace_back(c[0], c[1], z);
  }
  for (int i = 0; i < 6; ++i) {
    const int j = (i + 1) % 6;
    mesh.triangles.push_back({i, j, 6 + j});
    mesh.triangles.push_back({i, 6 + j, 6 + i});
  }
  const int top[4][3] = {{0, 1, 3}, {1, 2, 3}, {0, 3, 5}, {3, 4, 5}};
  for (const auto& t : top) {
    mesh.triangles.push_back({6 + t[0], 6 + t[1], 6 + t[2]});
    mesh.triangles.push_back({t[0], t[2], t[1]});
  }
  return mesh;
}

inline TriangleMesh inverted(TriangleMesh mesh) {
  for (auto& t : mesh.triangles) std::swap(t[0], t[1]);
  return mesh;
}

inline TriangleMesh both(TriangleMesh a, const TriangleMesh& b) {
  const int first = static_cast<int>(a.vertices.size());
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (const auto& t : b.triangles) {
    a.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  }
  return a;
}

inline std::string obj_text(const TriangleMesh& mesh) {
  std::ostringstream out;
  out.precision(9);
  for (const Vec3& v : mesh.vertices) out << "v " << v.x() << ' ' << v.y() << ' ' << v.z() << '\n';
  for (const auto& t : mesh.triangles) {
    out << "f " << t[0] + 1 << ' ' << t[1] + 1 << ' ' << t[2] + 1 << '\n';
  }
  return out.str();
}

inline std::string ply_text(const TriangleMesh& mesh) {
  std::ostringstream out;
  out.precision(9);
  out << "ply\nformat ascii 1.0\nelement vertex " << mesh.vertices.size()
      << "\nproperty float x\nproperty float y\nproperty float z\nelement face "
      << mesh.triangles.size() << "\nproperty list uchar int vertex_indices\nend_header\n";
  for (const Vec3& v : mesh.vertices) out << v.x() << ' ' << v.y() << ' ' << v.z() << '\n';
  for (const auto& t : mesh.triangles) out << "3 " << t[0] << ' ' << t[1] << ' ' << t[2] << '\n';
  return out.str();
}

/// Three vertices of its own for each triangle, as STL has it.
inline std::string stl_text(const TriangleMesh& mesh) {
  std::ostringstream out;
  out.precision(9);
  out << "solid test\n";
  for (const auto& t : mesh.triangles) {
    out << "facet normal 0 0 0\nouter loop\n";
    for (int v : t) {
      const Vec3& p = mesh.vertices[v];
      out << "vertex " << p.x() << ' ' << p.y() << ' ' << p.z() << '\n';
    }
    out << "endloop\nendfacet\n";
  }
  out << "endsolid test\n";
  return out.str();
}

inline std::string binary_stl(const TriangleMesh& mesh) {
  std::string out(80, ' ');
  const auto put = [&](const void* data, std::size_t size) {
    out.append(static_cast<const char*>(data), size);
  };
  const std::uint32_t count = static_cast<std::uint32_t>(mesh.triangles.size());
  put(&count, 4);
  for (const auto& t : mesh.triangles) {
    float numbers[12] = {};
    for (int k = 0; k < 3; ++k) {
      for (int axis = 0; axis < 3; ++axis) {
        numbers[3 + 3 * k + axis] = static_cast<float>(mesh.vertices[t[k]][axis]);
      }
    }
    put(numbers, sizeof(numbers));
    out.append(2, '\0');
  }
  return out;
}

}  // namespace tissue_sim
