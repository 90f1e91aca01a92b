// The surface of what stands in cubes of a lattice, closed around all that holds together.
//
// Each side of a cube beyond which nothing holds on to it is a face, with a vertex at each of its
// corners. Faces share a vertex where cubes hold together around that corner, so each edge joins
// two faces, whatever was cut, and pieces share none. A vertex lies where its faces' planes meet
// (dual contouring: Ju et al., Dual Contouring of Hermite Data, 2002).
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "tissue_sim/types.h"

namespace tissue_sim {

/// A side of a cube: 0 to 5 for -z, -y, -x, +x, +y, +z; side 5 - k looks the other way.
struct CubeSide {
  int axis, sign;
  explicit constexpr CubeSide(int k) : axis(k < 3 ? 2 - k : k - 3), sign(k < 3 ? -1 : 1) {}
};
inline constexpr int kCubeSides = 6;

/// Places are in cubes: that with indices (x, y, z) reaches from there to (x + 1, y + 1, z + 1).
struct Contour {
  struct Plane {
    Vec3 place, normal;
  };
  struct Vertex {
    Vec3 place;
    std::int32_t cube[8];  ///< of those around its corner all that hold together there, then -1
  };
  struct Face {
    std::int32_t vertex[4];  ///< counter-clockwise seen from outside; 0 and 2 are joined
    std::int32_t cube;
    int side;
  };
  std::vector<Vertex> vertices;
  std::vector<Face> faces;  ///< by cube, then side
};

namespace contour {

/// The cubes around a corner that hold on to one another there.
template <class Cubes>
struct Corner {
  int at[3];             ///< between the cubes at - 1 and at of each axis
  std::int32_t of[8];    ///< by place (x + 2 y + 4 z), -1 for none
  unsigned members = 0;  ///< places of those that hold on to one another, a bit each

  Corner(const Cubes& cubes, const std::array<int, 3>& corner, std::int32_t cube)
      : at{corner[0], corner[1], corner[2]} {
    for (int s = 0; s < 8; ++s) {
      of[s] = cubes.find(cube, at[0] - 1 + (s & 1), at[1] - 1 + (s >> 1 & 1), at[2] - 1 + (s >> 2));
      if (of[s] == cube) members = 1u << s;
    }
    for (unsigned before = 0; before != members;) {
      before = members;
      for (int s = 0; s < 8; ++s) {
        if ((members >> s & 1) == 0) continue;
        for (int axis = 0; axis < 3; ++axis) {
          const int side = (s >> axis & 1) == 0 ? 3 + axis : 2 - axis;
          if ((cubes.held(of[s]) >> side & 1) != 0) members |= 1u << (s ^ 1 << axis);
        }
      }
    }
  }
  /// Another number for all other such cubes.
  std::int64_t key() const {
    const int lowest = __builtin_ctz(members);
    return std::int64_t{8} * of[lowest] + lowest;
  }
  /// What key() stands for.
  static Corner of_key(const Cubes& cubes, std::int64_t key) {
    const auto cube = static_cast<std::int32_t>(key / 8);
    std::array<int, 3> at = cubes.at(cube);
    for (int a = 0; a < 3; ++a) at[a] += 1 - static_cast<int>(key >> a & 1);
    return {cubes, at, cube};
  }
};

/// Sums over the planes of the faces around a vertex.
struct PlaneSums {
  Eigen::Matrix3d normals = Eigen::Matrix3d::Zero();  ///< n n^T
  Vec3 heights = Vec3::Zero();                        ///< n (n . p)
  Vec3 places = Vec3::Zero();
  int count = 0;

  void add(const Contour::Plane& f) {
    normals += f.normal * f.normal.transpose();
    heights += f.normal * f.normal.dot(f.place);
    places += f.place;
    ++count;
  }
  /// Where the planes meet: of all such places the nearest to the middle of theirs, at most a
  /// cube from its corner.
  Vec3 meeting(const Vec3& corner) const {
    constexpr double kTowardsMiddle = 1e-2;  // share
    const Vec3 middle = places / count;
    const Eigen::Matrix3d m = normals + kTowardsMiddle * count * Eigen::Matrix3d::Identity();
    const Vec3 x = middle + m.ldlt().solve(heights - normals * middle);
    return x.cwiseMax(corner - Vec3::Ones()).cwiseMin(corner + Vec3::Ones());
  }
};

}  // namespace contour

/// `Cubes` tells of cubes 0 .. size() - 1: at(cube), its indices; find(cube, x, y, z), another one
/// of the same lattice or -1; held(cube), the sides beyond which a neighbour holds on to it, a bit
/// each; plane(cube, side), of a side without one, in order.
template <class Cubes>
Contour make_contour(Cubes& cubes) {
  Contour made;
  std::vector<Contour::Plane> planes;
  std::vector<std::array<std::int64_t, 4>> keys;
  for (std::int32_t c = 0; c < cubes.size(); ++c) {
    if (cubes.held(c) == (1u << kCubeSides) - 1) continue;
    for (int k = 0; k < kCubeSides; ++k) {
      if ((cubes.held(c) >> k & 1) != 0) continue;
      planes.push_back(cubes.plane(c, k));
      const CubeSide side(k);
      keys.emplace_back();
      for (int i = 0; i < 4; ++i) {
        std::array<int, 3> corner = cubes.at(c);
        corner[side.axis] += side.sign > 0 ? 1 : 0;
        corner[(side.axis + 1) % 3] += i == 1 || i == 2 ? 1 : 0;
        corner[(side.axis + 2) % 3] += i >= 2 ? 1 : 0;
        keys.back()[side.sign > 0 ? i : 3 - i] = contour::Corner<Cubes>(cubes, corner, c).key();
      }
      made.faces.push_back({{}, c, k});
    }
  }
  std::vector<std::int64_t> all;
  for (const auto& of_face : keys) all.insert(all.end(), of_face.begin(), of_face.end());
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end()), all.end());
  std::vector<contour::PlaneSums> sums(all.size());
  for (std::size_t f = 0; f < keys.size(); ++f) {
    for (int i = 0; i < 4; ++i) {
      const auto v = std::lower_bound(all.begin(), all.end(), keys[f][i]) - all.begin();
      made.faces[f].vertex[i] = static_cast<std::int32_t>(v);
      sums[v].add(planes[f]);
    }
  }
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto around = contour::Corner<Cubes>::of_key(cubes, all[i]);
    Contour::Vertex v{
        sums[i].meeting({double(around.at[0]), double(around.at[1]), double(around.at[2])}), {}};
    int n = 0;
    for (int s = 0; s < 8; ++s) {
      if ((around.members >> s & 1) != 0) v.cube[n++] = around.of[s];
    }
    std::fill(v.cube + n, v.cube + 8, -1);
    made.vertices.push_back(v);
  }
  for (Contour::Face& f : made.faces) {  // along the shorter diagonal
    const auto apart = [&](int i, int j) {
      return (made.vertices[f.vertex[i]].place - made.vertices[f.vertex[j]].place).norm();
    };
    if (apart(1, 3) < apart(0, 2)) std::rotate(f.vertex, f.vertex + 1, f.vertex + 4);
  }
  return made;
}

}  // namespace tissue_sim
