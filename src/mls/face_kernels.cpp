#include <algorithm>
#include <cmath>

#include "mls/face_contact.h"
#include "mls/face_pairs.h"

namespace tissue_sim {
namespace {

/// For weights: than what two nodes moved by when it was seen last, and for how long that holds.
constexpr float kFacesFaster = 1.5f;
constexpr int kLongestRest = 30;  // substeps

using Lanes = float[kMlsFaceBlock];

/// Four floats of each lane, `from(lane)`, into four rows.
template <class From>
TISSUE_SIM_INLINE void gather(const From& from, Lanes* rows) {
  for (int l = 0; l < kMlsFaceBlock; l += 4) {
    const Vec<4> a = load<4>(from(l)), b = load<4>(from(l + 1)), c = load<4>(from(l + 2)),
                 d = load<4>(from(l + 3));
    const Vec<4> ac = permute<4>(a, c, Mask<4>{0, 4, 1, 5}),
                 bd = permute<4>(b, d, Mask<4>{0, 4, 1, 5}),
                 ac2 = permute<4>(a, c, Mask<4>{2, 6, 3, 7}),
                 bd2 = permute<4>(b, d, Mask<4>{2, 6, 3, 7});
    store<4>(&rows[0][l], permute<4>(ac, bd, Mask<4>{0, 4, 1, 5}));
    store<4>(&rows[1][l], permute<4>(ac, bd, Mask<4>{2, 6, 3, 7}));
    store<4>(&rows[2][l], permute<4>(ac2, bd2, Mask<4>{0, 4, 1, 5}));
    store<4>(&rows[3][l], permute<4>(ac2, bd2, Mask<4>{2, 6, 3, 7}));
  }
}

/// Four rows into four floats of each lane.
template <class To>
TISSUE_SIM_INLINE void scatter(const Lanes* rows, const To& to) {
  for (int l = 0; l < kMlsFaceBlock; l += 4) {
    const Vec<4> a = load<4>(&rows[0][l]), b = load<4>(&rows[1][l]), c = load<4>(&rows[2][l]),
                 d = load<4>(&rows[3][l]);
    const Vec<4> ac = permute<4>(a, c, Mask<4>{0, 4, 1, 5}),
                 bd = permute<4>(b, d, Mask<4>{0, 4, 1, 5}),
                 ac2 = permute<4>(a, c, Mask<4>{2, 6, 3, 7}),
                 bd2 = permute<4>(b, d, Mask<4>{2, 6, 3, 7});
    store<4>(to(l), permute<4>(ac, bd, Mask<4>{0, 4, 1, 5}));
    store<4>(to(l + 1), permute<4>(ac, bd, Mask<4>{2, 6, 3, 7}));
    store<4>(to(l + 2), permute<4>(ac2, bd2, Mask<4>{0, 4, 1, 5}));
    store<4>(to(l + 3), permute<4>(ac2, bd2, Mask<4>{2, 6, 3, 7}));
  }
}

/// W lanes of rows from `row` on.
template <int W, int N>
TISSUE_SIM_INLINE void take(const Lanes* rows, int lane, Vec<W> (&out)[N]) {
  for (int k = 0; k < N; ++k) out[k] = load<W>(&rows[k][lane]);
}
template <int W, int N>
TISSUE_SIM_INLINE void put(const Vec<W> (&from)[N], int lane, Lanes* rows) {
  for (int k = 0; k < N; ++k) store<W>(&rows[k][lane], from[k]);
}

template <int W>
TISSUE_SIM_INLINE bool weigh(const MlsFaceField& f, int block) {
  const int first = block * kMlsFaceBlock;
  const std::int32_t *low = f.low + first, *high = f.high + first;
  alignas(64) Lanes L[8], H[8], weight, far;
  gather([&](int l) { return f.record + kMlsFaceRecord * low[l]; }, L);
  gather([&](int l) { return f.u + 4 * f.node[low[l]]; }, L + 4);
  gather([&](int l) { return f.record + kMlsFaceRecord * high[l]; }, H);
  gather([&](int l) { return f.u + 4 * f.node[high[l]]; }, H + 4);
  for (int lane = 0; lane < kMlsFaceBlock; lane += W) {
    Vec<W> l[8], h[8], d[3];
    take<W>(L, lane, l);
    take<W>(H, lane, h);
    for (int a = 0; a < 3; ++a) d[a] = (h[a] - l[a]) + (h[4 + a] - l[4 + a]);
    const Vec<W> edge = load<W>(f.edge + first + lane), rest = l[3] + h[3];
    const Vec<W> live = load<W>(f.live + first + lane);
    store<W>(&weight[lane], live * mls_contact_weight(d, rest, edge));
    const Vec<W> reach = square_root(mls_contact::reach2(rest, edge));
    store<W>(&far[lane], square_root(mls_contact::dot(d, d)) - reach);
  }
  float most = 0;
  for (int l = 0; l < kMlsFaceBlock; ++l) {
    most = weight[l] > most ? weight[l] : most;
    f.weight[first + l] = weight[l];
  }
  if (most > 0) return true;
  float least = kLongestRest;
  for (int l = 0; l < kMlsFaceBlock; ++l) {
    if (f.live[first + l] == 0) continue;
    const Vec<4> v = load<4>(f.v + 4 * f.node[high[l]]) - load<4>(f.v + 4 * f.node[low[l]]);
    const float step = kFacesFaster * f.dt * std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    if (!(far[l] > step * least)) least = step > 0 ? far[l] / step : 0;
  }
  f.rests[block] = static_cast<std::uint8_t>(least > 0 ? least : 0);
  // They are apart, and remember nothing.
  for (int l = 0; l < kMlsFaceBlock; ++l) {
    f.slip[kMlsSlipGap * f.stride + first + l] = kMlsApart;
    f.slip[kMlsSlipBegun * f.stride + first + l] = 0;
  }
  return false;
}

template <int W>
TISSUE_SIM_INLINE void turn(const float (&F)[9][kMlsFaceBlock],
                            const float (&knows)[2][kMlsFaceBlock], float* record) {
  alignas(64) Lanes outward[4], out[28];
  gather([&](int l) { return record + kMlsFaceRecord * l + kMlsFaceOutward; }, outward);
  gather([&](int l) { return record + kMlsFaceRecord * l + kMlsFaceSpring - 1; }, out + 12);
  for (int lane = 0; lane < kMlsFaceBlock; lane += W) {
    Vec<W> of[9], face[3], deformation[9], inverse[9], normal[3], couples;
    take<W>(F, lane, of);
    take<W>(outward, lane, face);
    turn_mls_face(of, face, less(Vec<W>{}, load<W>(&knows[0][lane])),
                  less(Vec<W>{}, load<W>(&knows[1][lane])), deformation, inverse, normal, couples);
    put<W>(normal, lane, out);
    put<W>(deformation, lane, out + 4);
    put<W>(inverse, lane, out + 16);
    store<W>(&outward[3][lane], couples);
  }
  scatter(outward, [&](int l) { return record + kMlsFaceRecord * l + kMlsFaceOutward; });
  for (int k = 4; k < 24; k += 4) {
    scatter(out + k, [&](int l) { return record + kMlsFaceRecord * l + kMlsFaceNormal + k; });
  }
  for (int l = 0; l < kMlsFaceBlock; ++l) {
    float* of = record + kMlsFaceRecord * l;
    of[kMlsFaceInverse + 8] = out[24][l];
    for (int a = 0; a < 3; ++a) of[kMlsFaceNormal + a] = out[a][l];
  }
}

template <int W>
TISSUE_SIM_INLINE bool push(const MlsFaceField& f, int block) {
  const int first = block * kMlsFaceBlock;
  const auto row = [&](int which) { return f.slip + which * f.stride + first; };
  float *gap = row(kMlsSlipGap), *begun = row(kMlsSlipBegun);
  const float* weight = f.weight + first;
  const std::int32_t *low = f.low + first, *high = f.high + first;
  const auto of_low = [&](int l) { return f.record + kMlsFaceRecord * low[l]; };
  const auto of_high = [&](int l) { return f.record + kMlsFaceRecord * high[l]; };
  alignas(64) Lanes L[28], H[28], D[3], N[3], before;
  for (int k = 0; k < 16; k += 4) {
    gather([&](int l) { return of_low(l) + k; }, L + k);
    gather([&](int l) { return of_high(l) + k; }, H + k);
  }
  for (int lane = 0; lane < kMlsFaceBlock; lane += W) {
    Vec<W> l[16], h[16], r[3], d[3], n[3], face_low[4], face_high[4];
    take<W>(L, lane, l);
    take<W>(H, lane, h);
    for (int a = 0; a < 3; ++a) {
      r[a] = h[a] - l[a];
      d[a] = r[a] + (h[kMlsFaceU + a] - l[kMlsFaceU + a]);
      face_low[a] = l[kMlsFaceOutward + a];
      face_high[a] = h[kMlsFaceOutward + a];
    }
    face_low[3] = l[3];
    face_high[3] = h[3];
    const Vec<W> edge = load<W>(f.edge + first + lane);
    const Vec<W> any =
        mls_gap(r, d, face_low, face_high, l + kMlsFaceNormal, h + kMlsFaceNormal, edge, n);
    const Vec<W> now =
        choose(less(Vec<W>{}, load<W>(weight + lane)), any, all_lanes<Vec<W>>(kMlsApart));
    Vec<W> g = load<W>(gap + lane), b = load<W>(begun + lane);
    store<W>(&before[lane], g);
    follow_mls_gap(now, edge, g, b);
    store<W>(gap + lane, g);
    store<W>(begun + lane, b);
    put<W>(d, lane, D);
    put<W>(n, lane, N);
  }
  float least = kMlsApart;
  for (int l = 0; l < kMlsFaceBlock; ++l) least = gap[l] < least ? gap[l] : least;
  if (!(least < 0)) return false;
  for (int k = 16; k < 28; k += 4) {
    gather([&](int l) { return of_low(l) + k; }, L + k);
    gather([&](int l) { return of_high(l) + k; }, H + k);
  }
  alignas(64) Lanes out[12] = {}, slide[3], flags[2];
  for (int lane = 0; lane < kMlsFaceBlock; lane += W) {
    const auto low_row = [&](int k) { return load<W>(&L[k][lane]); };
    const auto high_row = [&](int k) { return load<W>(&H[k][lane]); };
    Vec<W> d[3], n[3], held[3], of_low[3] = {}, of_high[3] = {}, apart[3], arm[3];
    take<W>(D, lane, d);
    take<W>(N, lane, n);
    for (int a = 0; a < 3; ++a) {
      held[a] = d[a];
      for (int b = 0; b < 3; ++b) {
        const int at = kMlsFaceDeformation + 3 * a + b;
        const Vec<W> h = high_row(at) * load<W>(row(kMlsSlipHigh + b) + lane),
                     l = low_row(at) * load<W>(row(kMlsSlipLow + b) + lane);
        held[a] += h - l;
        of_high[a] += h;
        of_low[a] += l;
      }
      apart[a] = load<W>(row(kMlsSlipApart + a) + lane);
    }
    const Vec<W> share = 0.5f * load<W>(weight + lane) *
                         (1.0f / low_row(kMlsFaceNormal + 3) + 1.0f / high_row(kMlsFaceNormal + 3));
    MlsSpringOfFaces<Vec<W>> spring;
    spring.stiffness = share * in_series(low_row(kMlsFaceSpring), high_row(kMlsFaceSpring));
    spring.damping = share * in_series(low_row(kMlsFaceSpring + 1), high_row(kMlsFaceSpring + 1));
    spring.friction = low_row(kMlsFaceSpring + 2) * high_row(kMlsFaceSpring + 2);
    spring.couples_low = low_row(kMlsFaceOutward + 3);
    spring.couples_high = high_row(kMlsFaceOutward + 3);
    const Vec<W> g = load<W>(gap + lane);
    MlsPush<Vec<W>, Mask<W>> push;
    const Mask<W> holds =
        holds_mls_places(of_low, of_high, low_row(3) + high_row(3), load<W>(f.edge + first + lane));
    push_mls_faces(d, n, g, load<W>(&before[lane]), held, holds, spring, f.since, apart, push);
    for (int a = 0; a < 3; ++a) {
      store<W>(row(kMlsSlipApart + a) + lane, apart[a]);
      arm[a] = push.at[a] - d[a];
    }
    put<W>(push.force, lane, out);
    put<W>(push.at, lane, out + 4);
    put<W>(arm, lane, out + 8);
    put<W>(push.slide, lane, slide);
    const Mask<W> touches = less(g, Vec<W>{});
    const Vec<W> one = all_lanes<Vec<W>>(1);
    store<W>(&flags[0][lane], choose(touches & push.begins, one, Vec<W>{}));
    store<W>(&flags[1][lane], choose(touches & push.slides, one, Vec<W>{}));
  }
  for (int k = 0; k < 12; k += 4) {
    scatter(out + k, [&](int l) { return f.push + kMlsFacePush * (first + l) + k; });
  }
  for (int l = 0; l < kMlsFaceBlock; ++l) {
    if (flags[0][l] + flags[1][l] == 0) continue;
    MlsPush<float, bool> push;
    push.begins = flags[0][l] > 0;
    push.slides = flags[1][l] > 0;
    float places[6], d[3];
    for (int a = 0; a < 3; ++a) {
      push.at[a] = out[4 + a][l];
      push.slide[a] = slide[a][l];
      d[a] = D[a][l];
      places[a] = row(kMlsSlipLow + a)[l];
      places[3 + a] = row(kMlsSlipHigh + a)[l];
    }
    move_mls_places(of_low(l) + kMlsFaceInverse, of_high(l) + kMlsFaceInverse, d, push, places,
                    places + 3);
    for (int a = 0; a < 3; ++a) {
      row(kMlsSlipLow + a)[l] = places[a];
      row(kMlsSlipHigh + a)[l] = places[3 + a];
    }
  }
  return true;
}

#define TISSUE_SIM_MLS_FACE_KERNELS(suffix, W, target)                                        \
  target bool weigh_##suffix(const MlsFaceField& f, int block) { return weigh<W>(f, block); } \
  target void turn_##suffix(const float(&F)[9][kMlsFaceBlock],                                \
                            const float(&knows)[2][kMlsFaceBlock], float* record) {           \
    turn<W>(F, knows, record);                                                                \
  }                                                                                           \
  target bool push_##suffix(const MlsFaceField& f, int block) { return push<W>(f, block); }

TISSUE_SIM_MLS_FACE_KERNELS(sse2, 4, )
#if defined(__x86_64__)
TISSUE_SIM_MLS_FACE_KERNELS(avx2, 8, TISSUE_SIM_TARGET_AVX2)
TISSUE_SIM_MLS_FACE_KERNELS(avx512, 16, TISSUE_SIM_TARGET_AVX512)
#endif

}  // namespace

const MlsFaceKernels& mls_face_kernels(InstructionSet set) {
  static constexpr MlsFaceKernels sse2 = {weigh_sse2, turn_sse2, push_sse2};
#if defined(__x86_64__)
  static constexpr MlsFaceKernels avx2 = {weigh_avx2, turn_avx2, push_avx2};
  static constexpr MlsFaceKernels avx512 = {weigh_avx512, turn_avx512, push_avx512};
  if (set == InstructionSet::kAvx512) return avx512;
  if (set == InstructionSet::kAvx2) return avx2;
#endif
  (void)set;
  return sse2;
}

}  // namespace tissue_sim
