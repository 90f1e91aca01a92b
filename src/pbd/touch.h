// Pieces that touch one another: a vertex and a triangle of another piece.
#pragma once

#include "pbd/constraints.h"

namespace tissue_sim {
namespace pbd {

/// Vertex 0 stays outside of the triangle of 1, 2 and 3, inelastic, with Coulomb friction. Once a
/// step, after all that has a compliance: no multiplier.
struct Touch {
  /// What overlaps comes apart at this speed, and no faster [m/s].
  static constexpr float kWayApart = 5;
  static constexpr int kVertices = 4, kNumbers = 4, kMultipliers = 0;
  /// number: how deep the vertex lies in the triangle at rest, as a gap, at most 0 [m]; the place
  /// on the triangle, as shares of vertices 2 and 3, that the vertex was above when the frame
  /// began, which friction holds it to; friction.
  template <class V>
  static TISSUE_SIM_INLINE void project(Vertex<V> (&v)[4], const V (&number)[4], V inverse_h2,
                                        V (&)[1]) {
    const Vector<V> e = between(v[2], v[1]), f = between(v[3], v[1]), r = between(v[0], v[1]);
    Vector<V> n = cross(e, f);
    const V n2 = dot(n, n) + kTiny, zero = n2 * 0.0f, one = zero + 1.0f;
    // Shares of the corners in the place below the vertex.
    const V b = dot(cross(r, f), n) / n2, c = dot(cross(e, r), n) / n2, a = 1.0f - b - c;
    n = (1.0f / root(n2)) * n;
    const V gap = dot(r, n) - number[0];
    const V share[3] = {a, b, c};
    // No vertex goes farther than the gap that is closed: one with a small share would, beside
    // corners that are held or heavy, and its share would shrink with each step.
    V sum = v[0].w, farthest = sum;
    for (int k = 0; k < 3; ++k) {
      sum += share[k] * share[k] * v[k + 1].w;
      farthest = greater(farthest, magnitude(share[k]) * v[k + 1].w);
    }
    // Beside the triangle another one is there.
    const V inside = lesser(a, lesser(b, c)) + 0.1f;
    const V depth = lesser(greater(zero - gap, zero), kWayApart / root(inverse_h2));
    const V push = where_negative(inside, zero, depth);
    // What it slid in the frame comes back, up to its share of the push.
    Vector<V> slid = between(v[0], v[1]) - number[1] * e - number[2] * f;
    slid = slid - dot(slid, n) * n;
    const V way = root(dot(slid, slid) + kTiny);
    const V back = lesser(number[3] * push, way) / way;
    const V over = 1.0f / (greater(sum, farthest) + kTiny);
    const Vector<V> moved = (push * over) * n - (back * over) * slid;
    move(v[0], one, moved);
    for (int k = 0; k < 3; ++k) move(v[k + 1], zero - share[k], moved);
  }
};

}  // namespace pbd
}  // namespace tissue_sim
