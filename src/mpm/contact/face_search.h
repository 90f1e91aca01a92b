// The search for facets that may meet: what the CPU's and the GPU's have in common.
#pragma once

#include <cmath>
#include <cstdint>

#include "compute/host_device.h"
#include "mpm/lattice/bonds.h"
#include "mpm/surface/facet_in_world.h"

namespace tissue_sim {

// Lengths in cells.
inline constexpr float kSearchReach =
    0.75f;                            ///< half size of the box in which a facet looks around
inline constexpr float kSkin = 0.1f;  ///< that facets may move, beyond what is predicted, in a list
inline constexpr float kLargestReach = 4;  ///< of what moves fast; the next search follows sooner

inline constexpr double kHorizon = 1.0 / 60;  ///< between two searches [s]
inline constexpr float kForesight = 1.5f;     ///< of how far facets go until the next, a margin
inline constexpr float kOutOfControl = 1e4f;  ///< no search where something is as fast [m/s]
inline constexpr float kFacing =
    -0.5f;  ///< cosine between normals up to which facets face each other

/// Time until the next search where the fastest facet moves at this speed against the mean [s].
TISSUE_SIM_INLINE double search_horizon(double fastest, double cell_size) {
  return fmin(kHorizon, kLargestReach * cell_size / (kForesight * fastest + 1e-9));
}

/// Up to so many points a piece may fly: it is not to make all others search as often as its speed
/// asks for.
inline constexpr int kMayFly = 64;

/// The box that a facet sweeps until the next search at the latest, and what it reaches from there.
struct SweptBox {
  float min[3], max[3];  ///< [m]

  SweptBox() = default;
  TISSUE_SIM_INLINE SweptBox(const FacetMotion& f, double cell_size) {
    const auto margin = static_cast<float>((kSearchReach + kSkin) * cell_size);
    for (int a = 0; a < 3; ++a) {
      const float way = static_cast<float>(kForesight * kHorizon) * f.v[a];
      min[a] = f.x[a] + fminf(way, 0.0f) - margin;
      max[a] = f.x[a] + fmaxf(way, 0.0f) + margin;
    }
  }
  TISSUE_SIM_INLINE bool meets(const SweptBox& other) const {
    bool meets = true;
    for (int a = 0; a < 3; ++a) {
      meets = meets && min[a] <= other.max[a] && other.min[a] <= max[a];
    }
    return meets;
  }
};

/// Whether a facet of a piece of so many points flies: that is small, and so fast that the next
/// search would have to follow sooner. Where its box does not meet that of all that do not fly, it
/// takes no part until the next search.
TISSUE_SIM_INLINE bool flies(const FacetMotion& f, int points, double cell_size) {
  const auto far = static_cast<float>(kLargestReach * cell_size / (kForesight * kHorizon));
  return points <= kMayFly && dot(f.v, f.v) > far * far;
}

/// Whether something is to be done before a substep, or rather before the next.
TISSUE_SIM_INLINE bool is_due(double until, double dt) { return until < 0.5 * dt; }

/// Where a facet was when the pairs were listed, and how far it may move while the list holds [m].
struct ListedFacet {
  float x[3], skin;  ///< skin < 0: it took no part
  TISSUE_SIM_FIELDS(x, skin)
};

/// A piece, as contacts see it.
struct PieceSize {
  std::int32_t id, points;

  /// Debris touches larger pieces, tools and the ground, but no other debris: what a thousand bits
  /// of a cell's volume do to one another cost more than all the tissue that they came from.
  TISSUE_SIM_INLINE bool is_debris() const { return points <= kDebrisPoints; }
};

/// Whether facets of the piece `a` touch those of `b`: the smaller one's do; of one piece, both
/// ways.
TISSUE_SIM_INLINE bool touches(const PieceSize& a, const PieceSize& b) {
  if (a.is_debris() && b.is_debris()) return false;
  if (a.id == b.id) return true;
  return a.points != b.points ? a.points < b.points : a.id > b.id;
}

/// Whether one of two facets of a piece lies so deep behind the other that they do not meet from
/// the front before the next search: what is between them is tissue, as at a thin rim.
TISSUE_SIM_INLINE bool are_back_to_back(const FacetMotion& a, const FacetMotion& b,
                                        double cell_size) {
  constexpr double kBehind = 1;  // [cells]; contacts are pressed 0.8 deep at most, when abused
  const float d[3] = {b.x[0] - a.x[0], b.x[1] - a.x[1], b.x[2] - a.x[2]};
  const auto behind = static_cast<float>(-kBehind * cell_size);
  return dot(d, a.normal) < behind || -dot(d, b.normal) < behind;
}

/// One over the time until two facets may be as near as those that are listed at rest [1/s], where
/// the fastest of all moves at this speed against their mean [m/s].
TISSUE_SIM_INLINE float rate_of_meeting(const FacetMotion& a, const FacetMotion& b, float fastest,
                                        double cell_size) {
  float far = 0, speed2 = 0;
  for (int i = 0; i < 3; ++i) {
    far = fmaxf(far, fabsf(a.x[i] - b.x[i]));
    speed2 += (a.v[i] - b.v[i]) * (a.v[i] - b.v[i]);
  }
  const float gap = far - 2 * (kSearchReach + kSkin) * static_cast<float>(cell_size);
  return gap > 0 ? (kForesight * sqrtf(speed2) + fastest) / gap : 1e30f;
}

/// Whether bonds lead from a point's site to another's close by, never away from it: then no cut
/// parts them. `bonds_at(x, y, z)` are those of the point at a site.
template <class Bonds>
TISSUE_SIM_HOST_DEVICE inline bool are_bound(const int (&from)[3], const int (&to)[3],
                                             const Bonds& bonds_at) {
  constexpr int kFar = 4, kRow = kFar + 1;  // points
  int bond[3], step[3], length[3];
  for (int a = 0; a < 3; ++a) {
    const int d = to[a] - from[a];
    length[a] = d < 0 ? -d : d;
    step[a] = d < 0 ? -1 : 1;
    bond[a] = d < 0 ? kForwardBond - 1 - a : kForwardBond + a;
    if (length[a] > kFar) return false;
  }
  std::uint32_t reached = 1, above = 0;  // of this layer and the next: bit y * kRow + x
  for (int z = 0; z <= length[2] && reached != 0; ++z, reached = above, above = 0) {
    for (int y = 0; y <= length[1]; ++y) {
      for (int x = 0; x <= length[0]; ++x) {
        const int at = y * kRow + x;
        if ((reached >> at & 1) == 0) continue;
        if (x == length[0] && y == length[1] && z == length[2]) return true;
        const unsigned bonds =
            bonds_at(from[0] + step[0] * x, from[1] + step[1] * y, from[2] + step[2] * z);
        if (x < length[0]) reached |= (bonds >> bond[0] & 1) << (at + 1);
        if (y < length[1]) reached |= (bonds >> bond[1] & 1) << (at + kRow);
        if (z < length[2]) above |= (bonds >> bond[2] & 1) << at;
      }
    }
  }
  return false;
}

}  // namespace tissue_sim
