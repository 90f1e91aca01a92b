#include "fluid/pair_sums.h"

#include <algorithm>
#include <cmath>

#include "compute/choose.h"
#include "compute/rows.h"
#include "compute/simd.h"
#include "fluid/wall_integrals.h"

namespace tissue_sim {
namespace lanes {
namespace {

constexpr int kLanes = kFluidLanes;

/// Rows of four numbers side by side: of[k] has the k-th of each.
template <int W>
struct Columns {
  Vec<W> of[4];
};

/// Of rows of four numbers those by `index`.
template <int W>
TISSUE_SIM_INLINE Columns<W> gather(const float* rows, const std::int32_t* index) {
  Columns<W> c;
  for (int i = 0; i < 4; ++i) c.of[i] = load_row<W>(rows, index, i);
  transpose<W>(c.of);
  return c;
}

/// Of all lanes, in the same order whatever vectors they come in.
template <int W>
TISSUE_SIM_INLINE float sum_of(const Vec<W>* v) {
  float lane[kLanes];
  for (int part = 0; part < kLanes / W; ++part) store<W>(lane + W * part, v[part]);
  for (int half = kLanes / 2; half > 0; half /= 2) {
    for (int l = 0; l < half; ++l) lane[l] += lane[l + half];
  }
  return lane[0];
}

}  // namespace
}  // namespace lanes

namespace pair_sums {
namespace {

using namespace lanes;  // NOLINT: what these sums are made of

template <int W>
TISSUE_SIM_INLINE float neighbour_volume_by(const FluidState& s, int i) {
  using V = Vec<W>;
  const float* x = &s.place[4 * static_cast<std::size_t>(i)];
  const V one = all_lanes<V>(1), by_reach = all_lanes<V>(1 / s.kernel.reach);
  V sum[kLanes / W] = {};
  const std::int32_t end = s.lists.begin[i + 1];
  for (std::int32_t e = s.lists.begin[i]; e < end; e += kLanes) {
    for (int part = 0; part < kLanes / W; ++part) {
      const Columns<W> place = gather<W>(s.place.data(), &s.lists.other[e + W * part]);
      const V dx = x[0] - place.of[0], dy = x[1] - place.of[1], dz = x[2] - place.of[2];
      V t = square_root(dx * dx + dy * dy + dz * dz) * by_reach;
      t = fluid::lesser(t, one);
      const V u2 = (one - t) * (one - t);
      sum[part] += place.of[3] * (u2 * u2 * (4 * t + one));
    }
  }
  return s.kernel.value(0) * sum_of<W>(sum);
}

template <int W>
TISSUE_SIM_INLINE void add_pair_forces_by(const FluidState& s, int i, float* force) {
  using V = Vec<W>;
  const float* x = &s.place[4 * static_cast<std::size_t>(i)];
  const float* v = &s.motion[4 * static_cast<std::size_t>(i)];
  const V one = all_lanes<V>(1), by_reach = all_lanes<V>(1 / s.kernel.reach);
  const V soft2 = all_lanes<V>(0.0025f * s.kernel.reach * s.kernel.reach);
  const float own = s.viscosity[s.particles.kind[i]];
  V f[3][kLanes / W] = {};
  const bool is_one_fluid = s.viscosity.size() == 1;
  V eta = all_lanes<V>(10 * own);
  const std::int32_t end = s.lists.begin[i + 1];
  for (std::int32_t e = s.lists.begin[i]; e < end; e += kLanes) {
    for (int part = 0; part < kLanes / W; ++part) {
      const std::int32_t* other = &s.lists.other[e + W * part];
      const Columns<W> place = gather<W>(s.place.data(), other),
                       motion = gather<W>(s.motion.data(), other);
      if (!is_one_fluid) {
        float of[W];
        for (int l = 0; l < W; ++l) {
          const std::int32_t j = other[l] < s.particles.size() ? other[l] : i;
          of[l] = 5 * (own + s.viscosity[s.particles.kind[j]]);
        }
        eta = load<W>(of);
      }
      const V dx = x[0] - place.of[0], dy = x[1] - place.of[1], dz = x[2] - place.of[2];
      const V r2 = dx * dx + dy * dy + dz * dz;
      V t = square_root(r2) * by_reach;
      t = fluid::lesser(t, one);
      const V w = one - t;
      const V nearing =
          (v[0] - motion.of[0]) * dx + (v[1] - motion.of[1]) * dy + (v[2] - motion.of[2]) * dz;
      const V along = eta * nearing / (r2 + soft2) - (v[3] + motion.of[3]);
      const V scale = place.of[3] * along * (w * w * w);
      f[0][part] += scale * dx;
      f[1][part] += scale * dy;
      f[2][part] += scale * dz;
    }
  }
  const float all = x[3] * s.kernel.slope_by_r(0);
  for (int a = 0; a < 3; ++a) force[a] += all * sum_of<W>(f[a]);
}

#if defined(__x86_64__)
TISSUE_SIM_UNFUSED_AVX2 float neighbour_volume_avx2(const FluidState& s, int i) {
  return neighbour_volume_by<8>(s, i);
}
TISSUE_SIM_UNFUSED_AVX2 void add_pair_forces_avx2(const FluidState& s, int i, float* force) {
  add_pair_forces_by<8>(s, i, force);
}
TISSUE_SIM_UNFUSED_AVX512 float neighbour_volume_avx512(const FluidState& s, int i) {
  return neighbour_volume_by<16>(s, i);
}
TISSUE_SIM_UNFUSED_AVX512 void add_pair_forces_avx512(const FluidState& s, int i, float* force) {
  add_pair_forces_by<16>(s, i, force);
}
#endif

}  // namespace
}  // namespace pair_sums

float neighbour_volume(const FluidState& s, int i) {
#if defined(__x86_64__)
  if (s.instructions == InstructionSet::kAvx512) return pair_sums::neighbour_volume_avx512(s, i);
  if (s.instructions == InstructionSet::kAvx2) return pair_sums::neighbour_volume_avx2(s, i);
#endif
  return pair_sums::neighbour_volume_by<4>(s, i);
}

void add_pair_forces(const FluidState& s, int i, float* force) {
#if defined(__x86_64__)
  if (s.instructions == InstructionSet::kAvx512) {
    return pair_sums::add_pair_forces_avx512(s, i, force);
  }
  if (s.instructions == InstructionSet::kAvx2) return pair_sums::add_pair_forces_avx2(s, i, force);
#endif
  pair_sums::add_pair_forces_by<4>(s, i, force);
}

namespace wall_sums {
namespace {

using namespace lanes;  // NOLINT: what these sums are made of
/// A share follows by its slope until it changed by so much, or what the slope leaves out, some
/// slope times way^2 over the reach, is so much. With that ten times as large, drops at walls are
/// kicked by it: a closed ball at 5 kPa fell to 4.0 as they left their order.
constexpr float kKeepShare = 0.015f, kKeep = 3e-5f;

/// Places of a triangle in `n` times `n` parts.
struct Places {
  int count[fluid::kMostParts + 1];
  float a[fluid::kMostParts + 1][3 * fluid::kMostParts * fluid::kMostParts],
      b[fluid::kMostParts + 1][3 * fluid::kMostParts * fluid::kMostParts];
  constexpr Places() : count(), a(), b() {
    for (int n = 1; n <= fluid::kMostParts; ++n) {
      int& k = count[n];
      for (fluid::TrianglePlaces at(n); !at.done(); at.next(), ++k) {
        a[n][k] = at.a();
        b[n][k] = at.b();
      }
    }
  }
};
constexpr Places kPlaces;

/// What a particle sees of walls, while it is summed.
template <int W>
struct Sums {
  Vec<W> share[kLanes / W] = {};
  std::int32_t* triangle;  // that the kernel reaches, one after the other
  float* over;             // and its integral over it
  int count = 0;

  TISSUE_SIM_INLINE void keep(const std::int32_t* of, int n, Vec<W> face) {
    float faces[W];
    store<W>(faces, face);
    for (int l = 0; l < n; ++l) {
      triangle[count] = of[l];
      over[count] = faces[l];
      count += faces[l] > 0 ? 1 : 0;
    }
  }
};

/// Where triangles begin in rows of four numbers.
constexpr int kRows = sizeof(WallTriangle) / (4 * sizeof(float));

/// `triangle` has kLanes of them; those from `count` on do not count.
template <int W>
TISSUE_SIM_INLINE void add_close(const FluidState& s, const float* x, const std::int32_t* triangle,
                                 int count, Sums<W>& sums) {
  using V = Vec<W>;
  const float reach = s.kernel.reach;
  std::int32_t row[kLanes];
  float longest2 = 0;
  for (int l = 0; l < kLanes; ++l) {
    row[l] = kRows * triangle[l];
    longest2 = std::max(longest2, s.now[triangle[l]].edge2);
  }
  const int parts = fluid::parts_of(longest2, reach), places = kPlaces.count[parts];
  for (int part = 0; part < kLanes / W && W * part < count; ++part) {
    const float* at = s.now[0].middle + 4;
    const Columns<W> side = gather<W>(at, row + W * part);
    const Columns<W> corner[3] = {gather<W>(at + 4, row + W * part),
                                  gather<W>(at + 8, row + W * part),
                                  gather<W>(at + 12, row + W * part)};
    fluid::CloseTriangle<V> t;
    for (int k = 0; k < 9; ++k) t.c[k / 3][k % 3] = corner[k / 4].of[k % 4] - x[k % 3];
    t.begin(side.of, keep<W>(lanes_between<W>(0, count - W * part), side.of[3]), reach);
    for (int k = 0; k < places; ++k) t.add_place(kPlaces.a[parts][k], kPlaces.b[parts][k]);
    sums.share[part] += keep<W>(lanes_between<W>(0, count - W * part), t.angle_share()) -
                        t.kernel_share(places, reach);
    sums.keep(triangle + W * part, std::min(W, count - W * part), t.over(places, s.kernel));
  }
}

/// Triangles that their middles stand for.
template <int W>
TISSUE_SIM_INLINE void add_far(const FluidState& s, const float* from, const std::int32_t* triangle,
                               int count, Sums<W>& sums) {
  using V = Vec<W>;
  std::int32_t row[kLanes];
  for (int l = 0; l < kLanes; ++l) row[l] = kRows * triangle[l];
  for (int part = 0; part < kLanes / W && W * part < count; ++part) {
    const Columns<W> place = gather<W>(s.now[0].middle, row + W * part),
                     normal = gather<W>(s.now[0].middle + 4, row + W * part);
    V x[3], n[3];
    for (int a = 0; a < 3; ++a) {
      x[a] = place.of[a] - from[a];
      n[a] = normal.of[a];
    }
    const V area = keep<W>(lanes_between<W>(0, count - W * part), normal.of[3]);
    const fluid::FarTriangle<V> t(x, n, area, s.kernel);
    sums.share[part] += t.share;
    sums.keep(triangle + W * part, std::min(W, count - W * part), t.over);
  }
}

template <int W>
TISSUE_SIM_INLINE float see_walls_by(FluidState& s, int i) {
  using V = Vec<W>;
  const float* x = &s.place[4 * static_cast<std::size_t>(i)];
  const V reach = all_lanes<V>(s.kernel.reach);
  std::int32_t close[2 * kLanes], away[2 * kLanes];  // triangles that wait for the lanes to be full
  int closes = 0, aways = 0;
  const std::int32_t begin = s.lists.wall_begin[i], end = s.lists.wall_begin[i + 1];
  Sums<W> sums;
  sums.triangle = s.seen.data() + begin;
  sums.over = s.share.data() + begin;
  const auto fill = [](std::int32_t* triangles, int count) {
    for (int l = count; l < kLanes; ++l) triangles[l] = triangles[0];
  };
  for (std::int32_t e = begin; e < end; e += kLanes) {
    const int n = std::min<int>(kLanes, end - e);
    std::int32_t row[kLanes];
    for (int l = 0; l < kLanes; ++l) row[l] = kRows * s.lists.wall[e + (l < n ? l : 0)];
    float beyond_reach[kLanes], radii[kLanes];
    for (int part = 0; part < kLanes / W; ++part) {
      const Columns<W> middle = gather<W>(s.now[0].middle, row + W * part);
      const V dx = middle.of[0] - x[0], dy = middle.of[1] - x[1], dz = middle.of[2] - x[2],
              radius = middle.of[3];
      const V d2 = dx * dx + dy * dy + dz * dz, far = reach + radius;
      store<W>(beyond_reach + W * part, d2 - far * far);
      store<W>(radii + W * part, d2 - fluid::kFar * fluid::kFar * (radius * radius));
    }
    for (int l = 0; l < n; ++l) {
      close[closes] = away[aways] = s.lists.wall[e + l];
      const int there = beyond_reach[l] < 0 ? 1 : 0, is_far = radii[l] > 0 ? 1 : 0;
      closes += there & ~is_far;
      aways += there & is_far;
    }
    if (aways >= kLanes) {
      add_far<W>(s, x, away, kLanes, sums);
      std::copy(away + kLanes, away + aways, away);
      aways -= kLanes;
    }
    if (closes >= kLanes) {
      add_close<W>(s, x, close, kLanes, sums);
      std::copy(close + kLanes, close + closes, close);
      closes -= kLanes;
    }
  }
  if (closes > 0) {
    fill(close, closes);
    add_close<W>(s, x, close, closes, sums);
  }
  if (aways > 0) {
    fill(away, aways);
    add_far<W>(s, x, away, aways, sums);
  }
  s.seen_count[i] = sums.count;
  return sum_of<W>(sums.share);
}

#if defined(__x86_64__)
TISSUE_SIM_UNFUSED_AVX2 float see_walls_avx2(FluidState& s, int i) { return see_walls_by<8>(s, i); }
TISSUE_SIM_UNFUSED_AVX512 float see_walls_avx512(FluidState& s, int i) {
  return see_walls_by<16>(s, i);
}
#endif

/// Sums what the walls' rows have by `share`: normals, and how far they came.
void add_rows(const FluidState& s, int i, float* sum) {
  using Row = Vec<4>;
  const std::int32_t begin = s.lists.wall_begin[i];
  const std::int32_t* triangle = s.seen.data() + begin;
  const float* over = s.share.data() + begin;
  Row part[4] = {};
  const int count = s.seen_count[i];
  int k = 0;
  const auto row = [&s](std::int32_t t) {
    return load<4>(&s.facing[4 * static_cast<std::size_t>(t)]);
  };
  for (; k + 4 <= count; k += 4) {
    for (int l = 0; l < 4; ++l) part[l] += over[k + l] * row(triangle[k + l]);
  }
  for (; k < count; ++k) part[0] += over[k] * row(triangle[k]);
  store<4>(sum, (part[0] + part[1]) + (part[2] + part[3]));
}

}  // namespace
}  // namespace wall_sums

float wall_share(FluidState& s, int i) {
  using namespace wall_sums;  // NOLINT
  float* push = &s.wall_push[4 * static_cast<std::size_t>(i)];
  FluidState::Seen& then = s.seen_at[i];
  const float* x = &s.place[4 * static_cast<std::size_t>(i)];
  if (then.is_new == 0) {
    add_rows(s, i, push);
    const float moved[3] = {x[0] - then.x[0], x[1] - then.x[1], x[2] - then.x[2]};
    const float change = push[3] - then.moved - dot3(push, moved);
    const float left_out = std::sqrt(dot3(push, push)) * dot3(moved, moved);
    if (std::fabs(change) < kKeepShare && left_out < kKeep * s.kernel.reach) {
      return then.share + change;
    }
  }
  float share;
#if defined(__x86_64__)
  if (s.instructions == InstructionSet::kAvx512) {
    share = see_walls_avx512(s, i);
  } else if (s.instructions == InstructionSet::kAvx2) {
    share = see_walls_avx2(s, i);
  } else {
    share = see_walls_by<4>(s, i);
  }
#else
  share = see_walls_by<4>(s, i);
#endif
  add_rows(s, i, push);
  then = {{x[0], x[1], x[2]}, share, push[3], 0};
  return share;
}

}  // namespace tissue_sim
