#include "images/look.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "compute/choose.h"

namespace tissue_sim {
namespace looks {
namespace {

// W pixels at a time, without branches, and without fused multiplication and addition, so that each
// instruction set gives the same bits.

template <int W>
struct At {
  Vec<W> x, y, z;
};
template <int W>
TISSUE_SIM_INLINE At<W> operator+(At<W> a, At<W> b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
struct Shift {
  float x, y, z;
};
template <int W>
TISSUE_SIM_INLINE At<W> operator+(At<W> a, Shift b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <int W, class Scale>
TISSUE_SIM_INLINE At<W> operator*(Scale s, At<W> a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <int W>
TISSUE_SIM_INLINE Vec<W> inner(At<W> a, At<W> b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <int W>
TISSUE_SIM_INLINE At<W> at(const float (*x)[Pixels::kMost], int i) {
  return {load<W>(x[0] + i), load<W>(x[1] + i), load<W>(x[2] + i)};
}
template <int W>
TISSUE_SIM_INLINE At<W> all_of(const float (&a)[3]) {
  return {all_lanes<Vec<W>>(a[0]), all_lanes<Vec<W>>(a[1]), all_lanes<Vec<W>>(a[2])};
}

template <class V>
TISSUE_SIM_INLINE V magnitude(V x) {
  typedef std::int32_t Bits __attribute__((vector_size(sizeof(V))));
  return (V)((Bits)x & 0x7fffffff);
}
/// 0 to 1.
template <class V>
TISSUE_SIM_INLINE V share(V x) {
  x = larger(x, all_lanes<V>(0));
  return choose(less(all_lanes<V>(1), x), all_lanes<V>(1), x);
}
template <int W>
TISSUE_SIM_INLINE Mask<W> floor_of(Vec<W> x) {
  const Mask<W> whole = __builtin_convertvector(x, Mask<W>);
  return whole + less(x, __builtin_convertvector(whole, Vec<W>));
}
template <class V>
TISSUE_SIM_INLINE V smooth(V x) {
  return x * x * (3 - 2 * x);
}

template <int W>
struct Whole {
  typedef std::uint32_t type __attribute__((vector_size(W * 4)));
};

/// A number of each node of a lattice, 0 to 1, without order.
template <int W>
TISSUE_SIM_INLINE Vec<W> scattered(typename Whole<W>::type h) {
  h = (h ^ (h >> 15)) * 0x2c1b3c6du;
  h = (h ^ (h >> 12)) * 0x297a2d39u;
  return __builtin_convertvector((Mask<W>)(h >> 8), Vec<W>) * (1.0f / 16777216.0f);
}

/// Smooth noise, 0 to 1, that changes over a length of 1, and how it does.
template <int W>
TISSUE_SIM_INLINE Vec<W> noise(At<W> p, At<W>* slope = nullptr) {
  using U = typename Whole<W>::type;
  using V = Vec<W>;
  constexpr std::uint32_t kX = 0x9e3779b1u, kY = 0x85ebca77u, kZ = 0xc2b2ae3du;
  const Mask<W> i = floor_of<W>(p.x), j = floor_of<W>(p.y), k = floor_of<W>(p.z);
  const At<W> f = {p.x - __builtin_convertvector(i, V), p.y - __builtin_convertvector(j, V),
                   p.z - __builtin_convertvector(k, V)};
  const At<W> s = {smooth(f.x), smooth(f.y), smooth(f.z)};
  const U x = (U)i * kX, y = (U)j * kY, z = (U)k * kZ, x1 = x + kX, y1 = y + kY, z1 = z + kZ;
  const V a = scattered<W>(x ^ y ^ z), da = scattered<W>(x1 ^ y ^ z) - a;
  const V b = scattered<W>(x ^ y1 ^ z), db = scattered<W>(x1 ^ y1 ^ z) - b;
  const V c = scattered<W>(x ^ y ^ z1), dc = scattered<W>(x1 ^ y ^ z1) - c;
  const V d = scattered<W>(x ^ y1 ^ z1), dd = scattered<W>(x1 ^ y1 ^ z1) - d;
  const V near = a + s.x * da, far = c + s.x * dc;
  const V up = b + s.x * db - near, far_up = d + s.x * dd - far;
  const V in_front = near + s.y * up, behind = far + s.y * far_up;
  if (slope != nullptr) {
    const V dx = da + s.y * (db - da), far_dx = dc + s.y * (dd - dc);
    *slope = {6 * f.x * (1 - f.x) * (dx + s.z * (far_dx - dx)),
              6 * f.y * (1 - f.y) * (up + s.z * (far_up - up)),
              6 * f.z * (1 - f.z) * (behind - in_front)};
  }
  return in_front + s.z * (behind - in_front);
}

/// Noise of several sizes, the largest of 1.
template <int W>
TISSUE_SIM_INLINE Vec<W> clouds(At<W> p, int sizes) {
  Vec<W> sum = {};
  float weight = 0.5f;
  for (int i = 0; i < sizes; ++i) {
    sum += weight * noise<W>(p);
    p = 2.03f * p + Shift{13.7f, 5.1f, 9.2f};
    weight *= 0.5f;
  }
  return sum / (1 - 2 * weight);
}

/// 1 along winding lines of a width, 0 away from them; they come up and go under.
template <int W>
TISSUE_SIM_INLINE Vec<W> vessels(At<W> p, float width) {
  const Vec<W> up = share(3 * noise<W>(0.8f * p + Shift{19, 11, 23}) - 1.1f);
  const At<W> bent = p + noise<W>(1.3f * p) * all_of<W>({0.6f, -0.5f, 0.4f});
  return smooth(share(1 - magnitude(noise<W>(bent) - 0.5f) / width)) * up;
}

template <int W>
TISSUE_SIM_INLINE At<W> mixed(At<W> a, const float (&b)[3], Vec<W> by) {
  const Vec<W> s = share(by);
  return {a.x + s * (b[0] - a.x), a.y + s * (b[1] - a.y), a.z + s * (b[2] - a.z)};
}

/// As a sine, over a length of 1.
template <int W>
TISSUE_SIM_INLINE Vec<W> wave(Vec<W> x) {
  const Vec<W> f = x - __builtin_convertvector(floor_of<W>(x), Vec<W>) - 0.5f;
  return -8 * f * (1 - 2 * magnitude(f));
}

template <Look look, int W>
TISSUE_SIM_INLINE At<W> surface_colour(At<W> p) {
  if (look == Look::kSteel) return all_of<W>({0.19f, 0.20f, 0.215f});
  if (look == Look::kHandle) return all_of<W>({0.035f, 0.038f, 0.045f});
  if (look == Look::kDrape) {
    const Vec<W> weave = wave<W>(p.x * (1 / 0.0016f)) * wave<W>(p.y * (1 / 0.0016f));
    return (0.75f + 0.1f * weave + 0.35f * noise<W>(20.0f * p)) *
           all_of<W>({0.018f, 0.085f, 0.095f});
  }
  if (look == Look::kCutFace) {  // lobules of some 2 mm, and the mouths of vessels
    const At<W> c = mixed<W>(all_of<W>({0.36f, 0.030f, 0.028f}), {0.52f, 0.13f, 0.10f},
                             1.6f * clouds<W>((1 / 0.002f) * p, 3) - 0.5f);
    return mixed<W>(c, {0.12f, 0.006f, 0.010f}, vessels<W>((1 / 0.007f) * p, 0.035f));
  }
  At<W> c = mixed<W>(all_of<W>({0.205f, 0.030f, 0.022f}), {0.30f, 0.062f, 0.042f},
                     1.7f * clouds<W>((1 / 0.009f) * p, 4) - 0.5f);
  c = mixed<W>(c, {0.13f, 0.010f, 0.010f}, 0.8f * vessels<W>((1 / 0.0035f) * p, 0.05f));
  return mixed<W>(c, {0.075f, 0.007f, 0.016f}, 0.8f * vessels<W>((1 / 0.013f) * p, 0.05f));
}

template <int N, class V>
TISSUE_SIM_INLINE V power(V x) {
  if constexpr (N == 1)
    return x;
  else if constexpr (N % 2 == 1)
    return x * power<N / 2>(x * x);
  else
    return power<N / 2>(x * x);
}

/// How much of the light a surface mirrors, 0 to 1: the sharper, the smaller the highlight.
template <Look look, class V>
TISSUE_SIM_INLINE V mirrored(V facing) {
  switch (look) {
    case Look::kDrape:
      return V{};
    case Look::kSteel:
      return 0.45f * power<40>(facing);
    case Look::kHandle:
      return 0.25f * power<25>(facing);
    case Look::kTinted:
      return 0.1f * power<30>(facing);
    default:
      return 0.40f * power<110>(facing);
  }
}

template <Look look, int W>
TISSUE_SIM_INLINE void light_up_as(bool has_light, Pixels& pixels) {
  using V = Vec<W>;
  for (int i = 0; i < pixels.count; i += W) {  // what is behind the last has room, and no meaning
    const At<W> p = at<W>(pixels.place, i);
    At<W> normal = at<W>(pixels.normal, i);
    if (look == Look::kSkin || look == Look::kCutFace) {  // it is wet and uneven
      At<W> slope;
      noise<W>((1 / 0.0013f) * p, &slope);
      normal = normal + -0.07f * slope;
    }
    const At<W> colour = look == Look::kTinted || look == Look::kFluid ? at<W>(pixels.colour, i)
                                                                       : surface_colour<look, W>(p);
    const At<W> along = at<W>(pixels.along, i);
    const V length = square_root(inner(along, along));
    const V both = square_root(inner(normal, normal)) * length + 1e-30f;
    const V facing = share(magnitude(inner(normal, along)) / both);
    V full = all_lanes<V>(1), diffuse = 0.55f + 0.45f * facing, shine = {};
    if (has_light) {
      const V distance = load<W>(pixels.distance + i) * length;
      full = 1.7f / (0.35f + 0.65f * distance * distance);
      // Light that went into wet tissue comes out beside: soft where the surface turns away.
      diffuse = 0.06f + 0.85f * facing + 0.15f * square_root(facing);
      shine = mirrored<look>(facing);
    }
    store<W>(pixels.colour[0] + i, full * (colour.x * diffuse + shine));
    store<W>(pixels.colour[1] + i, full * (colour.y * diffuse + shine));
    store<W>(pixels.colour[2] + i, full * (colour.z * diffuse + shine));
  }
}

template <int W>
TISSUE_SIM_INLINE void light_up_by(Look look, bool has_light, Pixels& pixels) {
  switch (look) {
    case Look::kSkin:
      return light_up_as<Look::kSkin, W>(has_light, pixels);
    case Look::kCutFace:
      return light_up_as<Look::kCutFace, W>(has_light, pixels);
    case Look::kDrape:
      return light_up_as<Look::kDrape, W>(has_light, pixels);
    case Look::kSteel:
      return light_up_as<Look::kSteel, W>(has_light, pixels);
    case Look::kHandle:
      return light_up_as<Look::kHandle, W>(has_light, pixels);
    case Look::kFluid:
      return light_up_as<Look::kFluid, W>(has_light, pixels);
    default:
      return light_up_as<Look::kTinted, W>(has_light, pixels);
  }
}

#if defined(__x86_64__)
// Not TISSUE_SIM_TARGET_AVX2, with which the compiler would fuse.
__attribute__((target("avx2"))) void light_up_by_eight(Look look, bool has_light, Pixels& pixels) {
  light_up_by<8>(look, has_light, pixels);
}
#endif

}  // namespace
}  // namespace looks

void light_up(Look look, bool has_light, InstructionSet instructions, Pixels& pixels) {
#if defined(__x86_64__)
  if (instructions != InstructionSet::kSse2)
    return looks::light_up_by_eight(look, has_light, pixels);
#endif
  looks::light_up_by<4>(look, has_light, pixels);
}

Colour linear(std::uint32_t rgb) {
  Colour c;
  for (int i = 0; i < 3; ++i) {
    c[i] = std::pow(static_cast<float>(rgb >> (16 - 8 * i) & 0xff) / 255.0f, 2.2f);
  }
  return c;
}

void to_bytes(const float* colour, std::uint8_t* rgb) {
  constexpr int kSteps = 65536;
  static const std::vector<std::uint8_t> bytes = [] {
    std::vector<std::uint8_t> b(kSteps);
    for (int i = 0; i < kSteps; ++i) {
      b[i] = static_cast<std::uint8_t>(255 * std::pow(i / (kSteps - 1.0), 1 / 2.2) + 0.5);
    }
    return b;
  }();
  for (int i = 0; i < 3; ++i) {
    rgb[i] = bytes[static_cast<int>(std::clamp(colour[i], 0.0f, 1.0f) * (kSteps - 1) + 0.5f)];
  }
}

Colour stress_colour(double share) {
  static const Colour stops[] = {linear(0x4d121a), linear(0x9e1a1f), linear(0xed611a),
                                 linear(0xffc238), linear(0xfffacc)};
  const double at = 4 * std::clamp(share, 0.0, 1.0);
  const int stop = std::min(3, static_cast<int>(at));
  return stops[stop] + static_cast<float>(at - stop) * (stops[stop + 1] - stops[stop]);
}

}  // namespace tissue_sim
