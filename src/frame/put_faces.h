// The triangles that a tissue shows.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <vector>

#include "compute/for_each.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// A triangle of a surface; the rest as in SurfaceTriangles.
struct ShownTriangle {
  const float* corner[3];
  std::array<float, 3> rest[3];
  std::int32_t fragment, point;
  std::uint8_t cut;
};

inline std::array<float, 3> floats(const Vec3& x) {
  return {static_cast<float>(x[0]), static_cast<float>(x[1]), static_cast<float>(x[2])};
}

/// Numbers for SurfaceTriangles::made, each once in a process.
inline std::uint64_t next_made() {
  static std::atomic<std::uint64_t> last{0};
  return ++last;
}

/// Replaces `out` with triangle(i) for each i below `count`. What it has already it keeps: few
/// frames change more than corners.
template <class F>
void put_triangles(std::size_t count, Cpu& cpu, SurfaceTriangles& out, const F& triangle) {
  std::atomic<bool> is_new{out.made == 0 || out.fragment.size() != count};
  out.corners.resize(9 * count);
  out.rest.resize(9 * count);
  out.fragment.resize(count);
  out.point.resize(count);
  out.cut.resize(count);
  const auto put = [&is_new](auto& to, auto value) {
    if (to == value) return;
    to = value;
    if (!is_new.load(std::memory_order_relaxed)) is_new.store(true, std::memory_order_relaxed);
  };
  cpu.for_each(
      static_cast<int>(count),
      [&](int i) {
        const ShownTriangle t = triangle(i);
        float* corner = out.corners.data() + std::size_t{9} * i;
        float* at_rest = out.rest.data() + std::size_t{9} * i;
        for (int k = 0; k < 3; ++k) {
          corner = std::copy_n(t.corner[k], 3, corner);
          for (int a = 0; a < 3; ++a) put(*at_rest++, t.rest[k][a]);
        }
        put(out.fragment[i], t.fragment);
        put(out.point[i], t.point);
        put(out.cut[i], t.cut);
      },
      512);
  if (is_new) out.made = next_made();
}

/// Replaces `out` with two triangles for each of `faces`, whose `vertex` name entries of `place`
/// [m], whose `point` is tissue there and whose `cut` says whether a cut or a tear made it; rest(v)
/// is where a vertex was at time zero [m], `piece` the Fragment::id of each point.
template <class Faces, class Rest>
void put_faces(const Faces& faces, const std::vector<std::array<float, 3>>& place, const Rest& rest,
               const std::vector<std::int32_t>& piece, Cpu& cpu, SurfaceTriangles& out) {
  put_triangles(2 * faces.size(), cpu, out, [&](int i) {
    const auto& f = faces[i / 2];
    ShownTriangle t{{}, {}, piece[f.point], f.point, f.cut};
    const int second = i % 2 + 1;
    for (int k = 0; k < 3; ++k) {
      const std::int32_t v = f.vertex[k == 0 ? 0 : second + k - 1];
      t.corner[k] = place[v].data();
      t.rest[k] = rest(v);
    }
    return t;
  });
}

/// The same where nothing but `place` is other than when put_faces() made `out`: a few bytes a
/// triangle, of some hundred.
template <class Faces>
void move_faces(const Faces& faces, const std::vector<std::array<float, 3>>& place, Cpu& cpu,
                SurfaceTriangles& out) {
  cpu.for_each(
      static_cast<int>(faces.size()),
      [&](int i) {
        float* corner = out.corners.data() + std::size_t{18} * i;
        for (const int k : {0, 1, 2, 0, 2, 3}) {
          corner = std::copy_n(place[faces[i].vertex[k]].data(), 3, corner);
        }
      },
      512);
}

/// Calls f(vertex, impulse) for the vertices of `faces` that impulses act on, as
/// Tissue::push_surface() takes them, of the triangles that put_faces() made. One after the other,
/// by number.
template <class Faces, class F>
void for_pushed_vertices(const Faces& faces, std::size_t vertices, Span<const float> impulses,
                         const F& f) {
  std::vector<std::array<float, 3>> sum(vertices, {0, 0, 0});
  const float* impulse = impulses.data();
  for (const auto& face : faces) {
    for (int half = 0; half < 2; ++half, impulse += 3) {
      for (const int k : {0, 1 + half, 2 + half}) {
        for (int a = 0; a < 3; ++a) sum[face.vertex[k]][a] += impulse[a];
      }
    }
  }
  for (std::size_t i = 0; i < vertices; ++i) {
    if (sum[i][0] != 0 || sum[i][1] != 0 || sum[i][2] != 0) f(static_cast<int>(i), sum[i].data());
  }
}

}  // namespace tissue_sim
