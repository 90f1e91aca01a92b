#include "images/look.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace tissue_sim {
namespace {

/// A number of each node of a lattice, 0 to 1, without order.
float scattered(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  std::uint32_t h = x * 0x9e3779b1u ^ y * 0x85ebca77u ^ z * 0xc2b2ae3du;
  h = (h ^ (h >> 15)) * 0x2c1b3c6du;
  h = (h ^ (h >> 12)) * 0x297a2d39u;
  return static_cast<float>(h >> 8) * (1.0f / 16777216.0f);
}

/// Smooth noise, 0 to 1, that changes over a length of 1.
double noise(const Vec3& x) {
  std::uint32_t at[3];
  float s[3];
  for (int a = 0; a < 3; ++a) {
    const double floor = std::floor(x[a]);
    const auto f = static_cast<float>(x[a] - floor);
    at[a] = static_cast<std::uint32_t>(static_cast<std::int32_t>(floor));
    s[a] = f * f * (3 - 2 * f);
  }
  const auto along_x = [&](std::uint32_t j, std::uint32_t k) {
    const float a = scattered(at[0], at[1] + j, at[2] + k);
    return a + s[0] * (scattered(at[0] + 1, at[1] + j, at[2] + k) - a);
  };
  const float near = along_x(0, 0), far = along_x(0, 1);
  const float a = near + s[1] * (along_x(1, 0) - near), b = far + s[1] * (along_x(1, 1) - far);
  return a + s[2] * (b - a);
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
  const double up = std::clamp(3 * noise(0.8 * x + Vec3(19, 11, 23)) - 1.1, 0.0, 1.0);
  if (up <= 0) return 0;
  const Vec3 bent = x + noise(1.3 * x) * Vec3(0.6, -0.5, 0.4);
  const double line = std::clamp(1 - std::fabs(noise(bent) - 0.5) / width, 0.0, 1.0);
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

Colour stress_colour(double share) {
  constexpr std::uint32_t kStops[] = {0x4d121a, 0x9e1a1f, 0xed611a, 0xffc238, 0xfffacc};
  const double at = 4 * std::clamp(share, 0.0, 1.0);
  const int stop = std::min(3, static_cast<int>(at));
  return mixed(linear(kStops[stop]), linear(kStops[stop + 1]), at - stop);
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
