#include "fluid/pair_sums.h"

#include <algorithm>
#include <cmath>

#include "compute/choose.h"
#include "compute/simd.h"

namespace tissue_sim {
namespace pair_sums {
namespace {

constexpr int kW = 8;
using V = Vec<kW>;

/// Neighbours side by side: where they are from here, and four numbers more of each. Those that are
/// not there have no volume.
struct Lanes {
  alignas(32) float d[3][kW], volume[kW];
};

TISSUE_SIM_INLINE int gather(const FluidState& s, std::int32_t begin, std::int32_t end,
                             const float* x, Lanes& lanes) {
  const int n = std::min(kW, static_cast<int>(end - begin));
  for (int l = 0; l < n; ++l) {
    const float* of = &s.place[4 * static_cast<std::size_t>(s.lists.other[begin + l])];
    for (int a = 0; a < 3; ++a) lanes.d[a][l] = x[a] - of[a];
    lanes.volume[l] = of[3];
  }
  for (int l = n; l < kW; ++l) {
    for (int a = 0; a < 3; ++a) lanes.d[a][l] = 0;
    lanes.volume[l] = 0;
  }
  return n;
}

TISSUE_SIM_INLINE float sum_of(V v) {
  float lane[kW], sum = 0;
  store<kW>(lane, v);
  for (const float x : lane) sum += x;
  return sum;
}

TISSUE_SIM_INLINE float neighbour_volume_by(const FluidState& s, int i) {
  const float* x = &s.place[4 * static_cast<std::size_t>(i)];
  const V one = all_lanes<V>(1), by_reach = all_lanes<V>(1 / s.kernel.reach);
  V sum = {};
  Lanes lanes;
  const std::int32_t end = s.lists.begin[i + 1];
  for (std::int32_t e = s.lists.begin[i]; e < end; e += kW) {
    gather(s, e, end, x, lanes);
    const V dx = load<kW>(lanes.d[0]), dy = load<kW>(lanes.d[1]), dz = load<kW>(lanes.d[2]);
    V t = square_root(dx * dx + dy * dy + dz * dz) * by_reach;
    t = choose(less(one, t), one, t);
    const V u2 = (one - t) * (one - t);
    sum += load<kW>(lanes.volume) * (u2 * u2 * (4 * t + one));
  }
  return s.kernel.value(0) * sum_of(sum);
}

TISSUE_SIM_INLINE void add_pair_forces_by(const FluidState& s, int i, float* force) {
  const float* x = &s.place[4 * static_cast<std::size_t>(i)];
  const float* v = &s.motion[4 * static_cast<std::size_t>(i)];
  const V one = all_lanes<V>(1), by_reach = all_lanes<V>(1 / s.kernel.reach);
  const V soft2 = all_lanes<V>(0.0025f * s.kernel.reach * s.kernel.reach);
  const float own = s.viscosity[s.particles.kind[i]];
  V f[3] = {};
  Lanes lanes;
  alignas(32) float u[3][kW] = {}, factor[kW] = {}, eta[kW] = {};
  const std::int32_t end = s.lists.begin[i + 1];
  for (std::int32_t e = s.lists.begin[i]; e < end; e += kW) {
    const int n = gather(s, e, end, x, lanes);
    for (int l = 0; l < n; ++l) {
      const std::int32_t j = s.lists.other[e + l];
      const float* of = &s.motion[4 * static_cast<std::size_t>(j)];
      for (int a = 0; a < 3; ++a) u[a][l] = v[a] - of[a];
      factor[l] = v[3] + of[3];
      eta[l] = 5 * (own + s.viscosity[s.particles.kind[j]]);
    }
    const V dx = load<kW>(lanes.d[0]), dy = load<kW>(lanes.d[1]), dz = load<kW>(lanes.d[2]);
    const V r2 = dx * dx + dy * dy + dz * dz;
    V t = square_root(r2) * by_reach;
    t = choose(less(one, t), one, t);
    const V w = one - t;
    const V nearing = load<kW>(u[0]) * dx + load<kW>(u[1]) * dy + load<kW>(u[2]) * dz;
    const V along = load<kW>(eta) * nearing / (r2 + soft2) - load<kW>(factor);
    const V scale = load<kW>(lanes.volume) * along * (w * w * w);
    f[0] += scale * dx;
    f[1] += scale * dy;
    f[2] += scale * dz;
  }
  const float all = x[3] * s.kernel.slope_by_r(0);
  for (int a = 0; a < 3; ++a) force[a] += all * sum_of(f[a]);
}

#if defined(__x86_64__)
// Not TISSUE_SIM_TARGET_AVX2, with which the compiler would fuse.
__attribute__((target("avx2"))) float neighbour_volume_avx2(const FluidState& s, int i) {
  return neighbour_volume_by(s, i);
}
__attribute__((target("avx2"))) void add_pair_forces_avx2(const FluidState& s, int i,
                                                          float* force) {
  add_pair_forces_by(s, i, force);
}
#endif

}  // namespace
}  // namespace pair_sums

float neighbour_volume(const FluidState& s, int i) {
#if defined(__x86_64__)
  if (s.instructions != InstructionSet::kSse2) return pair_sums::neighbour_volume_avx2(s, i);
#endif
  return pair_sums::neighbour_volume_by(s, i);
}

void add_pair_forces(const FluidState& s, int i, float* force) {
#if defined(__x86_64__)
  if (s.instructions != InstructionSet::kSse2) return pair_sums::add_pair_forces_avx2(s, i, force);
#endif
  pair_sums::add_pair_forces_by(s, i, force);
}

namespace wall_sums {
namespace {

using pair_sums::kW;
using pair_sums::V;
constexpr float kPi = FluidKernel::kPi;

/// Of the reach: a triangle with longer edges is summed in parts; at most so many along an edge.
constexpr float kPart = 0.75f;
constexpr int kMostParts = 8;
/// Radii of a triangle: from there on its middle stands for it, the share within 0.002.
constexpr float kFar = 3;

/// Places of a triangle by two of their coordinates, three in each of its `n` times `n` parts: they
/// integrate squares exactly.
struct Places {
  int count[kMostParts + 1];
  float a[kMostParts + 1][3 * kMostParts * kMostParts],
      b[kMostParts + 1][3 * kMostParts * kMostParts];
  constexpr Places() : count(), a(), b() {
    for (int n = 1; n <= kMostParts; ++n) {
      int& k = count[n];
      for (int i = 0; i < n; ++i) {
        for (int j = 0; i + j < n; ++j) {
          for (int down = 0; down < (i + j + 1 < n ? 2 : 1); ++down) {
            for (int c = 0; c < 3; ++c, ++k) {
              const float u = c == 1 ? 2.0f / 3 : 1.0f / 6, v = c == 2 ? 2.0f / 3 : 1.0f / 6;
              a[n][k] = (i + (down == 0 ? u : 1 - u)) / n;
              b[n][k] = (j + (down == 0 ? v : 1 - v)) / n;
            }
          }
        }
      }
    }
  }
};
constexpr Places kPlaces;

/// Triangles side by side: their corners seen from the place, their normals. Those that are not
/// there have no area.
struct Lanes {
  alignas(32) float corner[9][kW], normal[3][kW], area[kW];
  std::int32_t entry[kW];
  int count = 0;
  float edge2 = 0;  // the longest
};

TISSUE_SIM_INLINE V absolute(V x) { return choose(less(x, V{}), -x, x); }

/// atan2, within 1e-7 (the polynomial: Abramowitz and Stegun 4.4.49).
TISSUE_SIM_INLINE V angle(V y, V x) {
  const V ax = absolute(x), ay = absolute(y);
  const auto steep = less(ax, ay);
  const V t = choose(steep, ax, ay) / (choose(steep, ay, ax) + 1e-30f), s = t * t;
  V p = 0.0028662257f * s - 0.0161657367f;
  p = p * s + 0.0429096138f;
  p = p * s - 0.0752896400f;
  p = p * s + 0.1065626393f;
  p = p * s - 0.1420889944f;
  p = p * s + 0.1999355085f;
  p = p * s - 0.3333314528f;
  p = t + t * (s * p);
  p = choose(steep, kPi / 2 - p, p);
  p = choose(less(x, V{}), kPi - p, p);
  return choose(less(y, V{}), -p, p);
}

TISSUE_SIM_INLINE V dot(const V* a, const V* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/// The solid angle is exact; what the kernel has within the triangle, which is smooth, and the
/// kernel itself are summed over places.
TISSUE_SIM_INLINE float add_lanes(FluidState& s, Lanes& lanes, V* push) {
  const float reach = s.kernel.reach;
  for (int l = lanes.count; l < kW; ++l) {
    for (int k = 0; k < 9; ++k) lanes.corner[k][l] = k % 4 == 0 ? reach : 0;
    for (int a = 0; a < 3; ++a) lanes.normal[a][l] = 0;
    lanes.area[l] = 0;
  }
  V c[3][3], n[3], r[3];
  for (int k = 0; k < 9; ++k) c[k / 3][k % 3] = load<kW>(lanes.corner[k]);
  for (int a = 0; a < 3; ++a) n[a] = load<kW>(lanes.normal[a]);
  for (int k = 0; k < 3; ++k) r[k] = square_root(dot(c[k], c[k]));
  const V area = load<kW>(lanes.area), height = -dot(c[0], n);
  // Twice the area along the normal makes the volume that the corners span with the place.
  const V half = angle(2 * area * height, r[0] * r[1] * r[2] + dot(c[0], c[1]) * r[2] +
                                              dot(c[1], c[2]) * r[0] + dot(c[2], c[0]) * r[1]);
  const int parts = std::clamp(
      static_cast<int>(std::ceil(std::sqrt(lanes.edge2) / (kPart * reach))), 1, kMostParts);
  const V one = all_lanes<V>(1), by_reach = all_lanes<V>(1 / reach);
  V from[3], to[3], within = {}, face = {};
  for (int a = 0; a < 3; ++a) {
    from[a] = c[1][a] - c[0][a];
    to[a] = c[2][a] - c[0][a];
  }
  const int places = kPlaces.count[parts];
  for (int k = 0; k < places; ++k) {
    V x[3];
    for (int a = 0; a < 3; ++a) {
      x[a] = c[0][a] + kPlaces.a[parts][k] * from[a] + kPlaces.b[parts][k] * to[a];
    }
    const V t = square_root(dot(x, x)) * by_reach, t2 = t * t;
    const auto near = less(t, one);
    const V inside = 14 + t2 * (-84 + t * (140 + t * (-90 + 21 * t)));
    within += choose(near, inside, one / (t2 * t + 1e-30f));
    const V u = choose(near, one - t, V{}), u2 = u * u;
    face += u2 * u2 * (4 * t + one);
  }
  const float by_places = 1.0f / static_cast<float>(places);
  const V share = half * (1 / (2 * kPi)) -
                  area * height * within * (by_places / (4 * kPi * reach * reach * reach));
  alignas(32) float shares[kW], faces[kW];
  store<kW>(shares, share);
  const V over = area * face * (by_places * s.kernel.value(0));
  for (int a = 0; a < 3; ++a) push[a] += over * n[a];
  store<kW>(faces, over);
  float sum = 0;
  for (int l = 0; l < lanes.count; ++l) {
    sum += shares[l];
    s.share[lanes.entry[l]] = faces[l];
  }
  lanes.count = 0;
  lanes.edge2 = 0;
  return sum;
}

/// Triangles that their middles stand for.
struct FarLanes {
  alignas(32) float middle[3][kW], normal[3][kW], area[kW];
  std::int32_t entry[kW];
  int count = 0;
};

TISSUE_SIM_INLINE float add_far(FluidState& s, FarLanes& lanes, V* push) {
  for (int l = lanes.count; l < kW; ++l) {
    for (int a = 0; a < 3; ++a) lanes.middle[a][l] = s.kernel.reach, lanes.normal[a][l] = 0;
    lanes.area[l] = 0;
  }
  V x[3], n[3];
  for (int a = 0; a < 3; ++a) {
    x[a] = load<kW>(lanes.middle[a]);
    n[a] = load<kW>(lanes.normal[a]);
  }
  const V one = all_lanes<V>(1), area = load<kW>(lanes.area);
  const V r = square_root(dot(x, x));
  V t = r * all_lanes<V>(1 / s.kernel.reach);
  t = choose(less(one, t), one, t);
  const V t2 = t * t, u2 = (one - t) * (one - t);
  const V beyond = one - t2 * t * (14 + t2 * (-84 + t * (140 + t * (-90 + 21 * t))));
  const V over = area * (u2 * u2 * (4 * t + one)) * s.kernel.value(0);
  for (int a = 0; a < 3; ++a) push[a] += over * n[a];
  alignas(32) float shares[kW], faces[kW];
  store<kW>(shares, area * beyond * dot(x, n) / (r * r * r) * (-1 / (4 * kPi)));
  store<kW>(faces, over);
  float sum = 0;
  for (int l = 0; l < lanes.count; ++l) {
    sum += shares[l];
    s.share[lanes.entry[l]] = faces[l];
  }
  lanes.count = 0;
  return sum;
}

TISSUE_SIM_INLINE float wall_share_by(FluidState& s, int i) {
  const float* x = &s.place[4 * static_cast<std::size_t>(i)];
  Lanes lanes;
  FarLanes away;
  V push[3] = {};
  float sum = 0;
  const std::int32_t end = s.lists.wall_begin[i + 1];
  for (std::int32_t e = s.lists.wall_begin[i]; e < end; ++e) {
    const WallTriangle& t = s.now[s.lists.wall[e]];
    const float d[3] = {t.middle[0] - x[0], t.middle[1] - x[1], t.middle[2] - x[2]};
    const float far = s.kernel.reach + t.radius, d2 = dot3(d, d);
    if (d2 >= far * far || dot3(t.normal, t.normal) == 0) {
      s.share[e] = 0;
      continue;
    }
    if (d2 > kFar * kFar * t.radius * t.radius) {
      const int l = away.count++;
      for (int a = 0; a < 3; ++a) away.middle[a][l] = d[a], away.normal[a][l] = t.normal[a];
      away.area[l] = t.area;
      away.entry[l] = e;
      if (away.count == kW) sum += add_far(s, away, push);
      continue;
    }
    const int l = lanes.count++;
    for (int k = 0; k < 9; ++k) lanes.corner[k][l] = t.corner[k / 3][k % 3] - x[k % 3];
    for (int a = 0; a < 3; ++a) lanes.normal[a][l] = t.normal[a];
    lanes.area[l] = t.area;
    lanes.entry[l] = e;
    lanes.edge2 = std::max(lanes.edge2, t.edge2);
    if (lanes.count == kW) sum += add_lanes(s, lanes, push);
  }
  if (lanes.count > 0) sum += add_lanes(s, lanes, push);
  if (away.count > 0) sum += add_far(s, away, push);
  for (int a = 0; a < 3; ++a) {
    s.wall_push[3 * static_cast<std::size_t>(i) + a] = pair_sums::sum_of(push[a]);
  }
  return sum;
}

#if defined(__x86_64__)
// Not TISSUE_SIM_TARGET_AVX2, with which the compiler would fuse.
__attribute__((target("avx2"))) float wall_share_avx2(FluidState& s, int i) {
  return wall_share_by(s, i);
}
#endif

}  // namespace
}  // namespace wall_sums

float wall_share(FluidState& s, int i) {
#if defined(__x86_64__)
  if (s.instructions != InstructionSet::kSse2) return wall_sums::wall_share_avx2(s, i);
#endif
  return wall_sums::wall_share_by(s, i);
}

}  // namespace tissue_sim
