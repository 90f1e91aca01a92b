// Faces of four vertices as the triangles that a tissue shows.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "compute/for_each.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// Replaces `out` with two triangles for each of `faces`, whose `vertex` name entries of `place`
/// (now) and `rest` [m], whose `point` is tissue there and whose `cut` says whether a cut or a tear
/// made it; `piece` is the Fragment::id of each point.
template <class Faces>
void put_faces(const Faces& faces, const std::vector<std::array<float, 3>>& place,
               const std::vector<std::array<float, 3>>& rest,
               const std::vector<std::int32_t>& piece, Cpu& cpu, SurfaceTriangles& out) {
  out.corners.resize(18 * faces.size());
  out.rest.resize(18 * faces.size());
  out.fragment.resize(2 * faces.size());
  out.point.resize(2 * faces.size());
  out.cut.resize(2 * faces.size());
  cpu.for_each(
      static_cast<int>(faces.size()),
      [&](int i) {
        const auto& f = faces[i];
        float* corner = out.corners.data() + std::size_t{18} * i;
        float* at_rest = out.rest.data() + std::size_t{18} * i;
        for (const int k : {0, 1, 2, 0, 2, 3}) {
          corner = std::copy_n(place[f.vertex[k]].data(), 3, corner);
          at_rest = std::copy_n(rest[f.vertex[k]].data(), 3, at_rest);
        }
        for (int t = 2 * i; t < 2 * i + 2; ++t) {
          out.fragment[t] = piece[f.point];
          out.point[t] = f.point;
          out.cut[t] = f.cut;
        }
      },
      256);
}

/// Calls f(vertex, impulse) for the vertices of `faces` that impulses act on: of the corners of the
/// triangles that put_faces() made of them. One after the other, by number.
template <class Faces, class F>
void for_pushed_vertices(const Faces& faces, std::size_t vertices, Span<const float> impulses,
                         const F& f) {
  std::vector<std::array<float, 3>> sum(vertices, {0, 0, 0});
  const float* impulse = impulses.data();
  for (const auto& face : faces) {
    for (const int k : {0, 1, 2, 0, 2, 3}) {
      for (float& to : sum[face.vertex[k]]) to += *impulse++;
    }
  }
  for (std::size_t i = 0; i < vertices; ++i) {
    if (sum[i][0] != 0 || sum[i][1] != 0 || sum[i][2] != 0) f(static_cast<int>(i), sum[i].data());
  }
}

}  // namespace tissue_sim
