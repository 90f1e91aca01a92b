// A tip and the place of a triangle that lies deepest in it: a tip passes between vertices that are
// drawn apart, and a punch's rim seldom lies at any: by its vertices alone it pressed 10 to 20 %
// too little. On the CPU and on the GPU.
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

/// Capsules, and punches and plates, whose rims come between vertices.
TISSUE_SIM_INLINE bool is_tip(const Collider& c) {
  return c.kind == Collider::kCapsule || c.kind >= Collider::kPunch;
}

/// The box that a tip sweeps [m], where it is then, and which of the colliders it is.
struct TipSweep {
  double low[3], high[3];
  Collider begin, end;
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

/// How far the surface of a tip lies around its core [m]: of a capsule around its axis; of a punch
/// or a plate as its edge is rounded, or as triangles see it where that is sharper.
TISSUE_SIM_INLINE float rounding_of(const Collider& c) {
  if (c.kind == Collider::kCapsule) return c.radius;
  const float across = c.kind == Collider::kPlate ? fminf(c.width, c.thickness) : 2 * c.radius;
  return fmaxf(c.edge, 0.125f * fminf(across, c.length));
}

/// From the place in the core of a punch or a plate that is nearest to p, to p; local.
TISSUE_SIM_INLINE void off_core(const Collider& c, const double* p, double* off) {
  const double rounding = rounding_of(c), half = 0.5 * c.length;
  double most[3] = {0.5 * c.width - rounding, 0.5 * c.thickness - rounding, half - rounding};
  if (c.kind != Collider::kPlate) {
    const double s = sqrt(p[0] * p[0] + p[1] * p[1]),
                 k = s > c.radius - rounding ? (c.radius - rounding) / s : 1;
    most[0] = s > 0 ? k * fabs(p[0]) : 0, most[1] = s > 0 ? k * fabs(p[1]) : 0;
  }
  const double q[3] = {p[0], p[1], p[2] + half};
  for (int a = 0; a < 3; ++a) {  // no fmin(), which is a call
    off[a] = q[a] > most[a] ? q[a] - most[a] : q[a] < -most[a] ? q[a] + most[a] : 0;
  }
}

/// Half the size of the box that such a tip fills [m].
TISSUE_SIM_INLINE void half_of(const Collider& c, double (&half)[3]) {
  half[0] = c.kind == Collider::kPlate ? 0.5 * c.width : c.radius;
  half[1] = c.kind == Collider::kPlate ? 0.5 * c.thickness : c.radius;
  half[2] = 0.5 * c.length;
}

/// Whether a triangle lies along a flat face of a punch or a plate, so far from its rim at least
/// [m]: it is deepest at a corner, and vertices see to that.
TISSUE_SIM_INLINE bool lies_along_face(const Collider& c, const double (&local)[3][3],
                                       double margin) {
  const bool is_plate = c.kind == Collider::kPlate;
  double half[3];
  half_of(c, half);
  int over = 0;  // the axes along which a corner is past a rim, by bits
  for (const double(&p)[3] : local) {
    const double q[3] = {is_plate ? fabs(p[0]) : sqrt(p[0] * p[0] + p[1] * p[1]),
                         is_plate ? fabs(p[1]) : 0, fabs(p[2] + half[2])};
    for (int a = 0; a < 3; ++a) over |= q[a] > half[a] - rounding_of(c) - margin ? 1 << a : 0;
  }
  return over == 0 || over == 4 || (is_plate && (over == 1 || over == 2));
}

TISSUE_SIM_INLINE void to_tip(const Collider& tip, const Corner (&corner)[3],
                              double (&local)[3][3]) {
  for (int k = 0; k < 3; ++k) {
    for (int a = 0; a < 3; ++a) {
      local[k][a] = 0;
      for (int i = 0; i < 3; ++i) {
        local[k][a] += tip.rotation[3 * i + a] * (corner[k].at(i) - tip.position[i]);
      }
    }
  }
}

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
  if (tip.begin.kind == Collider::kCapsule) return true;
  double local[3][3];
  to_tip(tip.begin, corner, local);
  const double margin = far - 0.75 * mean_edge;  // many do: each would take time in each step
  if (!lies_along_face(tip.begin, local, margin)) return true;
  to_tip(tip.end, corner, local);
  return !lies_along_face(tip.end, local, margin);
}

/// Where a triangle lies deepest in a tip, and the corners' shares in that place.
struct TipPlace {
  Gap gap;
  double place[3], share[3];
};

/// The places of a triangle and of such a core that are nearest to one another, in turn. False
/// where the triangle lies along a face, or no deeper than `allowed` in the tip's box [m].
TISSUE_SIM_APART bool find_at_rim(const Collider& tip, const Corner (&corner)[3], double allowed,
                                  double* place, double* in_core) {
  double local[3][3], at[3] = {0, 0, -0.5 * tip.length}, found[3], off[3];
  to_tip(tip, corner, local);
  half_of(tip, off);
  for (int a = 0; a < 3; ++a) {
    const double middle = a == 2 ? -off[2] : 0;
    bool above = true, below = true;
    for (const double(&p)[3] : local) {
      above = above && p[a] - middle > off[a] - allowed;
      below = below && middle - p[a] > off[a] - allowed;
    }
    if (above || below) return false;
  }
  if (lies_along_face(tip, local, 0)) return false;
  const double near = 1e-3 * rounding_of(tip);
  for (int turn = 0; turn < 8; ++turn) {
    double way2 = 0;
    on_triangle(at, local[0], local[1], local[2], found);
    off_core(tip, found, off);
    for (int a = 0; a < 3; ++a) {
      const double next = found[a] - off[a];
      way2 += (next - at[a]) * (next - at[a]);
      at[a] = next;
    }
    if (way2 < near * near) break;
  }
  for (int i = 0; i < 3; ++i) {
    place[i] = in_core[i] = tip.position[i];
    for (int a = 0; a < 3; ++a) {
      place[i] += tip.rotation[3 * i + a] * found[a];
      in_core[i] += tip.rotation[3 * i + a] * at[a];
    }
  }
  return true;
}

/// The same of a capsule's axis.
TISSUE_SIM_INLINE void find_at_axis(const Collider& tip, const double (&x)[3][3], double* place,
                                    double* axis) {
  double end[3], up[3], way[3], next[3];
  for (int a = 0; a < 3; ++a) {
    end[a] = tip.position[a];
    up[a] = -static_cast<double>(tip.rotation[3 * a + 2]);
    axis[a] = end[a] + static_cast<double>(tip.radius) * up[a];
  }
  const double least = tip.radius, most = fmaxf(tip.radius, tip.length);
  for (int turn = 0; turn < 8; ++turn) {
    on_triangle(axis, x[0], x[1], x[2], place);
    for (int a = 0; a < 3; ++a) way[a] = place[a] - end[a];
    const double along = fmin(most, fmax(least, dot_of(way, up)));
    for (int a = 0; a < 3; ++a) {
      next[a] = end[a] + along * up[a];
      way[a] = next[a] - axis[a];
    }
    if (sqrt(dot_of(way, way)) < 1e-3 * least) break;
    for (int a = 0; a < 3; ++a) axis[a] = next[a];
  }
}

/// False where it lies in the tip nowhere; of corners x and moved count.
TISSUE_SIM_INLINE bool find_in_tip(const Collider& tip, const Corner (&corner)[3], double mean_edge,
                                   TipPlace& found) {
  double x[3][3], core[3], off[3];
  for (int a = 0; a < 3; ++a) {
    for (int k = 0; k < 3; ++k) x[k][a] = corner[k].at(a);
  }
  // So deep it may lie beside its corners: a mesh that fits the tip does, its triangles are chords.
  const auto edge = static_cast<float>(mean_edge);
  const float radius = rounding_of(tip);
  const double allowed = fminf(edge * edge / (8 * radius), 0.25f * radius);
  if (tip.kind == Collider::kCapsule) {
    find_at_axis(tip, x, found.place, core);
  } else if (!find_at_rim(tip, corner, allowed, found.place, core)) {
    return false;
  }
  for (int a = 0; a < 3; ++a) off[a] = found.place[a] - core[a];
  const double distance = sqrt(dot_of(off, off));
  if (!(distance > 0)) return false;
  if (tip.kind == Collider::kCapsule) {
    found.gap.distance = static_cast<float>(distance - radius + allowed);
    for (int a = 0; a < 3; ++a) found.gap.normal[a] = static_cast<float>(off[a] / distance);
  } else {
    float at[3];
    for (int a = 0; a < 3; ++a) at[a] = static_cast<float>(found.place[a]);
    found.gap = gap(tip, at);
    found.gap.distance += static_cast<float>(allowed);
  }
  if (!(found.gap.distance < 0)) return false;
  double e[3], f[3], r[3];
  for (int a = 0; a < 3; ++a) {
    e[a] = x[1][a] - x[0][a], f[a] = x[2][a] - x[0][a], r[a] = found.place[a] - x[0][a];
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
