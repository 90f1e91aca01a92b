#include "images/look.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace tissue_sim {
namespace {

/// A number of each node of a lattice, 0 to 1, without order.
double scattered(std::int64_t x, std::int64_t y, std::int64_t z) {
  std::uint64_t h = static_cast<std::uint64_t>(x) * 0x9e3779b97f4a7c15ull ^
                    static_cast<std::uint64_t>(y) * 0xc2b2ae3d27d4eb4full ^
                    static_cast<std::uint64_t>(z) * 0x165667b19e3779f9ull;
  h = (h ^ (h >> 31)) * 0xbf58476d1ce4e5b9ull;
  h = (h ^ (h >> 29)) * 0x94d049bb133111ebull;
  return static_cast<double>((h ^ (h >> 32)) >> 11) / 9007199254740992.0;
}

/// Smooth noise, 0 to 1, that changes over a length of 1.
double noise(const Vec3& x) {
  const Vec3 floor = x.array().floor();
  const Vec3 f = x - floor;
  const Vec3 s = f.array().square() * (3 - 2 * f.array());
  const auto i = static_cast<std::int64_t>(floor.x()), j = static_cast<std::int64_t>(floor.y()),
             k = static_cast<std::int64_t>(floor.z());
  double sum = 0;
  for (int c = 0; c < 8; ++c) {
    const int a = c & 1, b = c >> 1 & 1, d = c >> 2;
    sum += (a ? s.x() : 1 - s.x()) * (b ? s.y() : 1 - s.y()) * (d ? s.z() : 1 - s.z()) *
           scattered(i + a, j + b, k + d);
  }
  return sum;
}

/// Noise of several sizes, the largest of 1.
double clouds(Vec3 x, int sizes) {
  double sum = 0, weight = 0.5;
  for (int i = 0; i < sizes; ++i) {
    sum += weight * noise(x);
    x = 2.03 * x + Vec3(13.7, 5.1, 9.2);
    weight *= 0.5;
  }
  return sum / (1 - 2 * weight);
}

/// 1 along winding lines of a width, 0 away from them; they come up and go under.
double vessels(const Vec3& x, double width) {
  const Vec3 bent = x + 0.6 * Vec3(noise(1.3 * x), noise(1.3 * x + Vec3(7, 3, 1)),
                                   noise(1.3 * x + Vec3(2, 9, 4)));
  const double line = std::clamp(1 - std::fabs(noise(bent) - 0.5) / width, 0.0, 1.0);
  const double up = std::clamp(3 * noise(0.8 * x + Vec3(19, 11, 23)) - 1.1, 0.0, 1.0);
  return line * line * (3 - 2 * line) * up;
}

Colour mixed(const Colour& a, const Colour& b, double share) {
  return a + static_cast<float>(std::clamp(share, 0.0, 1.0)) * (b - a);
}

}  // namespace

Colour linear(std::uint32_t rgb) {
  Colour c;
  for (int i = 0; i < 3; ++i) {
    c[i] = std::pow(static_cast<float>(rgb >> (16 - 8 * i) & 0xff) / 255.0f, 2.2f);
  }
  return c;
}

void to_bytes(const Colour& colour, std::uint8_t* rgb) {
  for (int i = 0; i < 3; ++i) {
    const float c = std::clamp(colour[i], 0.0f, 1.0f);
    rgb[i] = static_cast<std::uint8_t>(255.0f * std::pow(c, 1 / 2.2f) + 0.5f);
  }
}

Colour tissue_colour(const Vec3& rest, bool is_cut) {
  if (is_cut) {  // lobules of some 2 mm, and the mouths of vessels
    const double lobules = clouds(rest / 0.002, 3);
    const Colour wet(0.36f, 0.030f, 0.028f), pale(0.52f, 0.13f, 0.10f), dark(0.12f, 0.006f, 0.010f);
    const Colour c = mixed(wet, pale, 1.6 * lobules - 0.5);
    return mixed(c, dark, vessels(rest / 0.007, 0.035));
  }
  const Colour skin(0.205f, 0.030f, 0.022f), light(0.30f, 0.062f, 0.042f);
  const Colour deep(0.075f, 0.007f, 0.016f), fine(0.13f, 0.010f, 0.010f);
  Colour c = mixed(skin, light, 1.7 * clouds(rest / 0.009, 4) - 0.5);
  c = mixed(c, fine, 0.8 * vessels(rest / 0.0035, 0.05));
  return mixed(c, deep, 0.8 * vessels(rest / 0.013, 0.05));
}

Vec3 tissue_bumps(const Vec3& rest) {
  const Vec3 x = rest / 0.0013;
  constexpr double kStep = 0.2, kHeight = 0.07;
  const double here = noise(x);
  return -kHeight / kStep *
         Vec3(noise(x + kStep * Vec3::UnitX()) - here, noise(x + kStep * Vec3::UnitY()) - here,
              noise(x + kStep * Vec3::UnitZ()) - here);
}

Colour drape_colour(const Vec3& place) {
  const double weave =
      std::sin(place.x() * 2 * M_PI / 0.0016) * std::sin(place.y() * 2 * M_PI / 0.0016);
  const double folds = noise(place / 0.05);
  return static_cast<float>(0.75 + 0.1 * weave + 0.35 * folds) * Colour(0.018f, 0.085f, 0.095f);
}

Colour lit(const Surface& surface, const Vec3& normal, const Vec3& to_lens, double distance,
           bool has_light) {
  const auto facing = static_cast<float>(std::max(0.0, normal.dot(to_lens)));
  if (!has_light) return surface.colour * (0.55f + 0.45f * facing);
  const auto full = static_cast<float>(1.7 / (0.35 + 0.65 * distance * distance));
  const float mirrored = surface.shine * std::pow(facing, surface.sharpness);
  // Light that went into wet tissue comes out beside: soft where the surface turns away.
  const float spread = 0.85f * facing + 0.15f * std::sqrt(facing);
  return full * (surface.colour * (0.06f + spread) + Colour::Constant(mirrored));
}

}  // namespace tissue_sim
