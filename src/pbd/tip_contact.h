// A tip and the place of a triangle that lies deepest in it: a tip passes between vertices that are
// drawn apart. On the CPU and on the GPU.
#pragma once

#include <array>
#include <cstdint>

#include "geometry/on_triangle.h"
#include "pbd/contact.h"

namespace tissue_sim {
namespace pbd {

/// Triangles that a tip is wrapped in share corners: a push of one takes back others'. After one
/// round a step a tip that was dragged deep in a slab went through its surface, after four none of
/// the same (test/tissue/holds_off_test.cpp).
constexpr int kTipRounds = 4;

TISSUE_SIM_INLINE bool is_tip(const Collider& c) { return c.kind == Collider::kCapsule; }

/// The box that a tip sweeps [m], and which of the colliders it is.
struct TipSweep {
  double low[3], high[3];
  std::int32_t collider;
};

using Triangle = std::array<std::int32_t, 3>;

/// A triangle that comes near a tip, and that tip's collider.
struct AtTip {
  Triangle corner;
  std::int32_t collider;
};

/// A corner of a triangle, as Vertices has it.
struct Corner {
  float x[4], moved[3], predicted[3], v[3];
  TISSUE_SIM_INLINE double at(int axis) const {
    return static_cast<double>(x[axis]) + static_cast<double>(moved[axis]);
  }
};

/// Whether a triangle may come to the tip within so many seconds; of corners x, moved and v count.
TISSUE_SIM_INLINE bool may_meet(const TipSweep& tip, const Corner (&corner)[3], double mean_edge,
                                double duration) {
  double fastest = 0;
  for (const Corner& c : corner) {
    const double v[3] = {c.v[0], c.v[1], c.v[2]};
    fastest = fmax(fastest, dot_of(v, v));
  }
  const double far = mean_edge + 2 * sqrt(fastest) * duration;
  for (int a = 0; a < 3; ++a) {
    const double p = corner[0].at(a), q = corner[1].at(a), r = corner[2].at(a);
    if (tip.low[a] - fmax(p, fmax(q, r)) > far || fmin(p, fmin(q, r)) - tip.high[a] > far) {
      return false;
    }
  }
  return true;
}

/// Where a triangle lies deepest in a tip, and the corners' shares in that place.
struct TipPlace {
  Gap gap;
  double place[3], share[3];
};

/// False where it lies in the tip nowhere; of corners x and moved count.
TISSUE_SIM_INLINE bool find_in_tip(const Collider& tip, const Corner (&corner)[3], double mean_edge,
                                   TipPlace& found) {
  double x[3][3], end[3], up[3], axis[3], off[3], way[3], next[3];
  for (int a = 0; a < 3; ++a) {
    for (int k = 0; k < 3; ++k) x[k][a] = corner[k].at(a);
    end[a] = tip.position[a];
    up[a] = -static_cast<double>(tip.rotation[3 * a + 2]);
    axis[a] = end[a] + static_cast<double>(tip.radius) * up[a];
  }
  // The tip's axis and the triangle: each other's nearest place in turn.
  const double least = tip.radius, most = fmax(tip.radius, tip.length);
  for (int turn = 0; turn < 8; ++turn) {
    on_triangle(axis, x[0], x[1], x[2], found.place);
    for (int a = 0; a < 3; ++a) way[a] = found.place[a] - end[a];
    const double along = fmin(most, fmax(least, dot_of(way, up)));
    for (int a = 0; a < 3; ++a) {
      next[a] = end[a] + along * up[a];
      way[a] = next[a] - axis[a];
    }
    if (sqrt(dot_of(way, way)) < 1e-3 * least) break;
    for (int a = 0; a < 3; ++a) axis[a] = next[a];
  }
  for (int a = 0; a < 3; ++a) off[a] = found.place[a] - axis[a];
  const double distance = sqrt(dot_of(off, off));
  // So deep it may lie beside its corners: a mesh that fits the tip does, its triangles are chords.
  const auto edge = static_cast<float>(mean_edge);
  const double allowed = fminf(edge * edge / (8 * tip.radius), 0.25f * tip.radius);
  found.gap.distance = static_cast<float>(distance - tip.radius + allowed);
  if (!(found.gap.distance < 0) || !(distance > 0)) return false;
  double e[3], f[3], r[3];
  for (int a = 0; a < 3; ++a) {
    e[a] = x[1][a] - x[0][a], f[a] = x[2][a] - x[0][a], r[a] = found.place[a] - x[0][a];
    found.gap.normal[a] = static_cast<float>(off[a] / distance);
  }
  double n[3], of[3];
  cross_of(e, f, n);
  // From within it meets what it has pierced: that is for vertices to get off.
  if (dot_of(n, off) > 0) return false;
  const double n2 = dot_of(n, n) + 1e-300;
  cross_of(r, f, of);
  const double of_b = dot_of(of, n) / n2;
  cross_of(e, r, of);
  const double of_c = dot_of(of, n) / n2;
  const double share[3] = {1 - of_b - of_c, of_b, of_c};
  for (int k = 0; k < 3; ++k) found.share[k] = fmin(1.0, fmax(0.0, share[k]));
  return true;
}

/// Pushes that place out of the tip in a step of h seconds, as push_out() a vertex: changes
/// `moved` of the corners. Whether any of them can go.
TISSUE_SIM_INLINE bool push_out_of_tip(const Collider& tip, const TipPlace& found, float h,
                                       Corner (&corner)[3], ContactPush& push) {
  double mobility = 0, farthest = 0;  // no vertex goes farther than the place, as in Touch
  float at[3], moved[3] = {}, predicted[3] = {}, velocity[3] = {};
  for (int k = 0; k < 3; ++k) {
    const double share = found.share[k], w = corner[k].x[3];
    mobility += share * share * w;
    farthest = fmax(farthest, share * w);
    const auto part = static_cast<float>(share);
    for (int a = 0; a < 3; ++a) {
      moved[a] += part * corner[k].moved[a];
      predicted[a] += part * corner[k].predicted[a];
      velocity[a] += part * corner[k].v[a];
    }
  }
  mobility = fmax(mobility, farthest);
  if (!(mobility > 0)) return false;
  for (int a = 0; a < 3; ++a) at[a] = static_cast<float>(found.place[a]);
  const float before[3] = {moved[0], moved[1], moved[2]};
  push = push_out(tip, found.gap, h, 1 / mobility, predicted, velocity, at,
                  static_cast<float>(mobility), moved);
  for (int k = 0; k < 3; ++k) {
    const auto by = static_cast<float>(found.share[k] * corner[k].x[3] / mobility);
    for (int a = 0; a < 3; ++a) corner[k].moved[a] += by * (moved[a] - before[a]);
  }
  return true;
}

}  // namespace pbd
}  // namespace tissue_sim
