// The constraints: what each asks for and how a projection moves its vertices. XPBD (Macklin,
// Mueller, Chentanez 2016): a constraint C of compliance alpha [1 / stiffness] is worth the energy
// C^2 / (2 alpha); in a step of h seconds a projection adds
//   dlambda = -(C + a lambda) / (sum_i w_i |grad_i C|^2 + a),  a = alpha / h^2
// to its multiplier and w_i grad_i C dlambda to its vertices. The same for V = float and for lanes,
// on the CPU and on the GPU. Equations by number: Lee et al. 2022.
#pragma once

#include "pbd/lanes.h"

namespace tissue_sim {
namespace pbd {

template <class V>
TISSUE_SIM_INLINE Vector<V> operator+(const Vector<V>& a, const Vector<V>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class V>
TISSUE_SIM_INLINE Vector<V> operator-(const Vector<V>& a, const Vector<V>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class V>
TISSUE_SIM_INLINE Vector<V> operator*(V s, const Vector<V>& a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class V>
TISSUE_SIM_INLINE V dot(const Vector<V>& a, const Vector<V>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class V>
TISSUE_SIM_INLINE Vector<V> cross(const Vector<V>& a, const Vector<V>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
/// From b to a.
template <class V>
TISSUE_SIM_INLINE Vector<V> between(const Vertex<V>& a, const Vertex<V>& b) {
  return {(a.x - b.x) + (a.moved.x - b.moved.x), (a.y - b.y) + (a.moved.y - b.moved.y),
          (a.z - b.z) + (a.moved.z - b.moved.z)};
}
template <class V>
TISSUE_SIM_INLINE void move(Vertex<V>& a, V scale, const Vector<V>& along) {
  const V s = a.w * scale;
  a.moved.x += s * along.x;
  a.moved.y += s * along.y;
  a.moved.z += s * along.z;
}

/// Keeps what has no mass to move, or no length, finite.
constexpr float kTiny = 1e-30f;

/// Two vertices at a distance (eqs. 1 to 3; edges, and internal shape-preserving constraints).
struct Distance {
  static constexpr int kVertices = 2, kNumbers = 2, kMultipliers = 1;
  /// number: length at rest [m], compliance [m/N]. Returns C [m].
  template <class V>
  static TISSUE_SIM_INLINE V value(const Vertex<V> (&v)[2], const V (&number)[2]) {
    const Vector<V> d = between(v[1], v[0]);
    return root(dot(d, d)) - number[0];
  }
  /// Energy [J].
  static TISSUE_SIM_INLINE double energy(const Vertex<float> (&v)[2], const float (&number)[2]) {
    const float c = value(v, number);
    return number[1] > 0 ? 0.5 * c * c / number[1] : 0.0;
  }
  template <class V>
  static TISSUE_SIM_INLINE void project(Vertex<V> (&v)[2], const V (&number)[2], V inverse_h2,
                                        V (&lambda)[1]) {
    const V a = number[1] * inverse_h2;
    const Vector<V> d = between(v[1], v[0]);
    const V length = root(dot(d, d) + kTiny);
    // One division, for it takes a quarter of the time.
    const V scale =
        quotient(number[0] - length - a * lambda[0], (v[0].w + v[1].w + a + 1e-20f) * length);
    lambda[0] += scale * length;
    move(v[0], -scale, d);
    move(v[1], scale, d);
  }
};

/// Two neighbours lose a share of what they move by against one another: a dashpot.
struct Damper {
  static constexpr int kVertices = 2, kNumbers = 1, kMultipliers = 0;
  /// v: inverse masses, and velocities [m/s] for what they have moved; number: the share.
  template <class V>
  static TISSUE_SIM_INLINE void project(Vertex<V> (&v)[2], const V (&number)[1], V, V (&)[1]) {
    const Vector<V> d = v[1].moved - v[0].moved;
    const V scale = quotient(number[0], v[0].w + v[1].w + 1e-20f);
    move(v[0], scale, d);
    move(v[1], -scale, d);
  }
};

/// The angle between two triangles that share the edge from vertex 2 to vertex 3, opposite to which
/// lie 0 and 1 (eq. 4; signed, where arccos knows no side and has no slope where the triangles are
/// flat; gradients: Bridson et al. 2003). Gradients are those of small turns: from kMost of an
/// excess on its moment grows no further, and whatever has become of its triangles, a projection
/// takes back no more than kMostOfStep of it. Else thin or folded ones would throw their vertices
/// to and fro for ever, one bend after the other: their gradients turn while they are followed.
struct Bending {
  static constexpr float kMost = 0.3f;  ///< [rad]
  static constexpr float kMostOfStep = 0.1f;
  static constexpr int kVertices = 4, kNumbers = 2, kMultipliers = 1;
  template <class V>
  struct Parts {
    Vector<V> e, n0, n1;
    V length;
    V angle;  ///< 0 where the triangles are flat, -pi to pi
  };
  template <class V>
  static TISSUE_SIM_INLINE Parts<V> parts(const Vertex<V> (&v)[4]) {
    Parts<V> p;
    p.e = between(v[3], v[2]);
    p.n0 = cross(between(v[0], v[2]), between(v[0], v[3]));
    p.n1 = cross(between(v[1], v[3]), between(v[1], v[2]));
    p.length = root(dot(p.e, p.e) + kTiny);
    p.angle = angle_of(dot(cross(p.n1, p.n0), p.e), p.length * dot(p.n0, p.n1));
    return p;
  }
  /// An angle's excess over another one, within half a turn.
  template <class V>
  static TISSUE_SIM_INLINE V excess(V angle, V rest) {
    const V d = angle - rest;
    // Whole turns: what a float of that size has no room for is rounded off.
    const V turns = (d * 0.159154943092f + 12582912.0f) - 12582912.0f;
    return d - 6.28318530718f * turns;
  }
  /// number: angle at rest [rad], compliance [rad/(N m)]. Returns C [rad].
  template <class V>
  static TISSUE_SIM_INLINE V value(const Vertex<V> (&v)[4], const V (&number)[2]) {
    return excess(parts(v).angle, number[0]);
  }
  /// Energy [J].
  static TISSUE_SIM_INLINE double energy(const Vertex<float> (&v)[4], const float (&number)[2]) {
    const float c = value(v, number), within = limited(c);
    return number[1] > 0 ? (c - 0.5 * within) * within / number[1] : 0.0;
  }
  /// An excess, no larger than kMost.
  template <class V>
  static TISSUE_SIM_INLINE V limited(V c) {
    const V most = c * 0.0f + kMost;
    return greater(lesser(c, most), -most);
  }
  /// Of the angle.
  template <class V>
  static TISSUE_SIM_INLINE void gradients(const Vertex<V> (&v)[4], const Parts<V>& p,
                                          Vector<V> (&g)[4]) {
    const V e2 = p.length * p.length, unit = e2 * 0.0f + 1.0f;
    const Vector<V> m0 = quotient(unit, p.length * (dot(p.n0, p.n0) + kTiny)) * p.n0,
                    m1 = quotient(unit, p.length * (dot(p.n1, p.n1) + kTiny)) * p.n1;
    const V s0 = dot(between(v[0], v[3]), p.e), s1 = dot(between(v[1], v[3]), p.e);
    const V t0 = dot(between(v[0], v[2]), p.e), t1 = dot(between(v[1], v[2]), p.e);
    g[0] = e2 * m0;
    g[1] = e2 * m1;
    g[2] = s0 * m0 + s1 * m1;
    g[3] = (-t0) * m0 + (-t1) * m1;
  }
  /// How far its vertices move for a turn of its angle: sum of w |g|^2 [1/(kg m^2)].
  template <class V>
  static TISSUE_SIM_INLINE V mobility(const Vertex<V> (&v)[4], const Vector<V> (&g)[4]) {
    return v[0].w * dot(g[0], g[0]) + v[1].w * dot(g[1], g[1]) + v[2].w * dot(g[2], g[2]) +
           v[3].w * dot(g[3], g[3]);
  }
  template <class V>
  static TISSUE_SIM_INLINE void project(Vertex<V> (&v)[4], const V (&number)[2], V inverse_h2,
                                        V (&lambda)[1]) {
    const Parts<V> p = parts(v);
    Vector<V> g[4];
    gradients(v, p, g);
    const V mobile = mobility(v, g);
    const V a = greater(number[1] * inverse_h2, mobile * (1 / kMostOfStep));
    const V change =
        quotient(-(limited(excess(p.angle, number[0])) + a * lambda[0]), mobile + a + kTiny);
    lambda[0] += change;
    for (int i = 0; i < 4; ++i) move(v[i], change, g[i]);
  }
};

}  // namespace pbd
}  // namespace tissue_sim
