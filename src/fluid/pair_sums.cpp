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

/// Rows of four numbers side by side: of[k] has the k-th of each.
struct Columns {
  V of[4];
};

TISSUE_SIM_INLINE V join(Vec<4> a, Vec<4> b) {
  return V{a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]};
}

/// In registers: what is stored in parts and loaded whole waits.
TISSUE_SIM_INLINE Columns transpose(const float* const* row) {
  using Quad = Vec<4>;
  const Mask<4> low = {0, 4, 1, 5}, high = {2, 6, 3, 7}, left = {0, 1, 4, 5}, right = {2, 3, 6, 7};
  Quad half[2][4];
  for (int h = 0; h < 2; ++h) {
    const Quad a = load<4>(row[4 * h]), b = load<4>(row[4 * h + 1]), c = load<4>(row[4 * h + 2]),
               d = load<4>(row[4 * h + 3]);
    const Quad ab = permute<4>(a, b, low), cd = permute<4>(c, d, low);
    const Quad ab2 = permute<4>(a, b, high), cd2 = permute<4>(c, d, high);
    half[h][0] = permute<4>(ab, cd, left);
    half[h][1] = permute<4>(ab, cd, right);
    half[h][2] = permute<4>(ab2, cd2, left);
    half[h][3] = permute<4>(ab2, cd2, right);
  }
  return {{join(half[0][0], half[1][0]), join(half[0][1], half[1][1]), join(half[0][2], half[1][2]),
           join(half[0][3], half[1][3])}};
}

/// Of neighbours side by side four numbers each, from an array of them; those that are not there
/// have none.
TISSUE_SIM_INLINE Columns gather(const Array<float>& from, const std::int32_t* other, int n) {
  static constexpr float kNone[4] = {};
  const float* row[kW];
  for (int l = 0; l < kW; ++l) {
    row[l] = l < n ? &from[4 * static_cast<std::size_t>(other[l])] : kNone;
  }
  return transpose(row);
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
  const std::int32_t end = s.lists.begin[i + 1];
  for (std::int32_t e = s.lists.begin[i]; e < end; e += kW) {
    const Columns place = gather(s.place, &s.lists.other[e], end - e);
    const V dx = x[0] - place.of[0], dy = x[1] - place.of[1], dz = x[2] - place.of[2];
    V t = square_root(dx * dx + dy * dy + dz * dz) * by_reach;
    t = choose(less(one, t), one, t);
    const V u2 = (one - t) * (one - t);
    sum += place.of[3] * (u2 * u2 * (4 * t + one));
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
  const bool is_one_fluid = s.viscosity.size() == 1;
  V eta = all_lanes<V>(10 * own);
  const std::int32_t end = s.lists.begin[i + 1];
  for (std::int32_t e = s.lists.begin[i]; e < end; e += kW) {
    const std::int32_t* other = &s.lists.other[e];
    const Columns place = gather(s.place, other, end - e),
                  motion = gather(s.motion, other, end - e);
    if (!is_one_fluid) {
      alignas(32) float of[kW] = {};
      for (int l = 0; l < std::min<int>(kW, end - e); ++l) {
        of[l] = 5 * (own + s.viscosity[s.particles.kind[other[l]]]);
      }
      eta = load<kW>(of);
    }
    const V dx = x[0] - place.of[0], dy = x[1] - place.of[1], dz = x[2] - place.of[2];
    const V r2 = dx * dx + dy * dy + dz * dz;
    V t = square_root(r2) * by_reach;
    t = choose(less(one, t), one, t);
    const V w = one - t;
    const V nearing =
        (v[0] - motion.of[0]) * dx + (v[1] - motion.of[1]) * dy + (v[2] - motion.of[2]) * dz;
    const V along = eta * nearing / (r2 + soft2) - (v[3] + motion.of[3]);
    const V scale = place.of[3] * along * (w * w * w);
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

using pair_sums::Columns;
using pair_sums::kW;
using pair_sums::V;
constexpr float kPi = FluidKernel::kPi;

/// Of the reach: a triangle with longer edges is summed in parts; at most so many along an edge.
constexpr float kPart = 0.75f;
constexpr int kMostParts = 8;
/// Radii of a triangle: from there on its middle stands for it, the share within 0.001.
constexpr float kFar = 4;

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

/// The sum of the first `count` shares; what each face does to the place stays with its entry.
/// entry.
TISSUE_SIM_INLINE float keep_shares(FluidState& s, const std::int32_t* entry, int count, V share,
                                    V face) {
  alignas(32) float shares[kW], faces[kW];
  store<kW>(shares, share);
  store<kW>(faces, face);
  float sum = 0;
  for (int l = 0; l < count; ++l) {
    sum += shares[l];
    s.share[entry[l]] = faces[l];
  }
  return sum;
}

/// The solid angle is exact; what the kernel has within the triangle, which is smooth, and the
/// kernel itself are summed over places.
TISSUE_SIM_INLINE float add_close(FluidState& s, const float* x, const std::int32_t* entry,
                                  int count, V* push) {
  const float reach = s.kernel.reach;
  const float* row[4][kW];  // of a triangle's numbers, from its normal on
  float longest2 = 0;
  for (int l = 0; l < kW; ++l) {
    const WallTriangle& t = s.now[s.lists.wall[entry[l < count ? l : 0]]];
    for (int k = 0; k < 4; ++k) row[k][l] = t.middle + 4 * (k + 1);
    longest2 = std::max(longest2, t.edge2);
  }
  const Columns side = pair_sums::transpose(row[0]);
  const Columns corner[3] = {pair_sums::transpose(row[1]), pair_sums::transpose(row[2]),
                             pair_sums::transpose(row[3])};
  V c[3][3], r[3];
  for (int k = 0; k < 9; ++k) c[k / 3][k % 3] = corner[k / 4].of[k % 4] - x[k % 3];
  const V* n = side.of;
  for (int k = 0; k < 3; ++k) r[k] = square_root(dot(c[k], c[k]));
  // Those behind the last are the first once more.
  const V area = keep<kW>(lanes_between<kW>(0, count), side.of[3]), height = -dot(c[0], n);
  // Twice the area along the normal makes the volume that the corners span with the place. What has
  // no normal has no angle.
  const V half =
      keep<kW>(less(all_lanes<V>(0.5f), dot(n, n)),
               angle(2 * area * height, r[0] * r[1] * r[2] + dot(c[0], c[1]) * r[2] +
                                            dot(c[1], c[2]) * r[0] + dot(c[2], c[0]) * r[1]));
  const int parts =
      std::clamp(static_cast<int>(std::ceil(std::sqrt(longest2) / (kPart * reach))), 1, kMostParts);
  const V one = all_lanes<V>(1), by_reach = all_lanes<V>(1 / reach);
  V from[3], to[3], within = {}, face = {};
  for (int a = 0; a < 3; ++a) {
    from[a] = c[1][a] - c[0][a];
    to[a] = c[2][a] - c[0][a];
  }
  const int places = kPlaces.count[parts];
  for (int k = 0; k < places; ++k) {
    V at[3];
    for (int a = 0; a < 3; ++a) {
      at[a] = c[0][a] + kPlaces.a[parts][k] * from[a] + kPlaces.b[parts][k] * to[a];
    }
    const V t = square_root(dot(at, at)) * by_reach, t2 = t * t;
    const auto near = less(t, one);
    const V inside = 14 + t2 * (-84 + t * (140 + t * (-90 + 21 * t)));
    within += choose(near, inside, one / (t2 * t + 1e-30f));
    const V u = choose(near, one - t, V{}), u2 = u * u;
    face += u2 * u2 * (4 * t + one);
  }
  const float by_places = 1.0f / static_cast<float>(places);
  const V share = half * (1 / (2 * kPi)) -
                  area * height * within * (by_places / (4 * kPi * reach * reach * reach));
  const V over = area * face * (by_places * s.kernel.value(0));
  for (int a = 0; a < 3; ++a) push[a] += over * n[a];
  return keep_shares(s, entry, count, share, over);
}

/// Triangles that their middles stand for.
TISSUE_SIM_INLINE float add_far(FluidState& s, const float* from, const std::int32_t* entry,
                                int count, V* push) {
  static constexpr float kNone[8] = {};
  const float *middle[kW], *side[kW];
  for (int l = 0; l < kW; ++l) {
    const float* of = l < count ? s.now[s.lists.wall[entry[l]]].middle : kNone;
    middle[l] = of;
    side[l] = of + 4;
  }
  const Columns place = pair_sums::transpose(middle), normal = pair_sums::transpose(side);
  V x[3], n[3];
  for (int a = 0; a < 3; ++a) {
    x[a] = place.of[a] - from[a];
    n[a] = normal.of[a];
  }
  const V one = all_lanes<V>(1), area = normal.of[3];
  const V r = square_root(dot(x, x));
  V t = r * all_lanes<V>(1 / s.kernel.reach);
  t = choose(less(one, t), one, t);
  const V t2 = t * t, u2 = (one - t) * (one - t);
  const V beyond = one - t2 * t * (14 + t2 * (-84 + t * (140 + t * (-90 + 21 * t))));
  const V over = area * (u2 * u2 * (4 * t + one)) * s.kernel.value(0);
  for (int a = 0; a < 3; ++a) push[a] += over * n[a];
  const V share = area * beyond * dot(x, n) / (r * r * r + 1e-30f) * (-1 / (4 * kPi));
  return keep_shares(s, entry, count, share, over);
}

TISSUE_SIM_INLINE float wall_share_by(FluidState& s, int i) {
  const float* x = &s.place[4 * static_cast<std::size_t>(i)];
  const V reach = all_lanes<V>(s.kernel.reach);
  std::int32_t close[2 * kW], away[2 * kW];  // entries that wait for eight
  int closes = 0, aways = 0;
  V push[3] = {};
  float sum = 0;
  const std::int32_t end = s.lists.wall_begin[i + 1];
  for (std::int32_t e = s.lists.wall_begin[i]; e < end; e += kW) {
    const int n = std::min<int>(kW, end - e);
    const float* row[kW];
    for (int l = 0; l < kW; ++l) row[l] = s.now[s.lists.wall[e + (l < n ? l : 0)]].middle;
    alignas(32) float beyond_reach[kW], radii[kW];
    const Columns middle = pair_sums::transpose(row);
    const V dx = middle.of[0] - x[0], dy = middle.of[1] - x[1], dz = middle.of[2] - x[2],
            radius = middle.of[3];
    const V d2 = dx * dx + dy * dy + dz * dz, far = reach + radius;
    store<kW>(beyond_reach, d2 - far * far);
    store<kW>(radii, d2 - kFar * kFar * (radius * radius));
    for (int l = 0; l < n; ++l) {
      s.share[e + l] = 0;
      close[closes] = away[aways] = e + l;
      const int there = beyond_reach[l] < 0 ? 1 : 0, is_far = radii[l] > 0 ? 1 : 0;
      closes += there & ~is_far;
      aways += there & is_far;
    }
    if (aways >= kW) {
      sum += add_far(s, x, away, kW, push);
      std::copy(away + kW, away + aways, away);
      aways -= kW;
    }
    if (closes >= kW) {
      sum += add_close(s, x, close, kW, push);
      std::copy(close + kW, close + closes, close);
      closes -= kW;
    }
  }
  if (closes > 0) sum += add_close(s, x, close, closes, push);
  if (aways > 0) sum += add_far(s, x, away, aways, push);
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
