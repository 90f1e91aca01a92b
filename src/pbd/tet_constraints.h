// Constraints of a tetrahedron: strain as the paper prints it, and a material. See constraints.h.
#pragma once

#include <cmath>

#include "pbd/constraints.h"

namespace tissue_sim {
namespace pbd {

/// Columns f[j] = P q_j of the deformation gradient F = P Q^-1 (eqs. 5 to 7); number[3 * i + j] is
/// the entry (i, j) of Q^-1 [1/m].
template <class V>
TISSUE_SIM_INLINE Vector<V> column(const Vector<V> (&p)[3], const V* number, int j) {
  return number[j] * p[0] + number[3 + j] * p[1] + number[6 + j] * p[2];
}

template <class V>
TISSUE_SIM_INLINE void edges_of(const Vertex<V> (&v)[4], Vector<V> (&p)[3]) {
  for (int i = 0; i < 3; ++i) p[i] = between(v[i + 1], v[0]);
}

/// Stretch and shear strain constraints (eqs. 5 to 11; Mueller et al. 2014): S = F^T F shall be the
/// identity. Six projections one after the other, without compliance: `stretch` and `shear` are the
/// shares of the error that they take away. Held vertices may leave a constraint next to no slope;
/// rounding over that slope threw the last free vertex of a tetrahedron out of its body, so no
/// slope counts for less than kLeastSlope2 of what all vertices together have.
struct Strain {
  static constexpr float kLeastSlope2 = 2.5e-5f;
  static constexpr int kVertices = 4, kNumbers = 11, kMultipliers = 0;
  /// C of the stretch (i == j) or shear constraint [-].
  template <class V>
  static TISSUE_SIM_INLINE V value(const Vertex<V> (&v)[4], const V (&number)[11], int i, int j) {
    Vector<V> p[3];
    edges_of(v, p);
    const V s = dot(column(p, number, i), column(p, number, j));
    return i == j ? s - 1.0f : s;
  }
  template <class V>
  static TISSUE_SIM_INLINE void project_one(Vertex<V> (&v)[4], const V (&number)[11], int i,
                                            int j) {
    Vector<V> p[3];
    edges_of(v, p);
    const Vector<V> fi = column(p, number, i), fj = column(p, number, j);
    V c = dot(fi, fj);
    // What is pressed flat comes back by no more than its length at rest: S has next to no slope
    // there, and a step along it threw tissue that a tool pressed against an anchor.
    if (i == j) c = greater(c - 1.0f, -2.0f * root(c));
    Vector<V> g[4];
    g[0] = {c * 0.0f, c * 0.0f, c * 0.0f};
    V sum = c * 0.0f, slope2 = sum, mobile = v[0].w;
    for (int k = 0; k < 3; ++k) {
      g[k + 1] = number[3 * k + i] * fj + number[3 * k + j] * fi;
      g[0] = g[0] - g[k + 1];
      const V g2 = dot(g[k + 1], g[k + 1]);
      sum += v[k + 1].w * g2;
      slope2 += g2;
      mobile += v[k + 1].w;
    }
    const V g2 = dot(g[0], g[0]);
    sum += v[0].w * g2 + kLeastSlope2 * mobile * (slope2 + g2);
    const V change = -(i == j ? number[9] : number[10]) * c / (sum + kTiny);
    for (int k = 0; k < 4; ++k) move(v[k], change, g[k]);
  }
  /// number: Q^-1, stretch, shear.
  template <class V>
  static TISSUE_SIM_INLINE void project(Vertex<V> (&v)[4], const V (&number)[11], V, V (&)[1]) {
    project_one(v, number, 0, 0);
    project_one(v, number, 1, 1);
    project_one(v, number, 2, 2);
    project_one(v, number, 0, 1);
    project_one(v, number, 0, 2);
    project_one(v, number, 1, 2);
  }
};

/// v^(-1/3) for v between 0.1 and 4, by Newton's method.
template <class V>
TISSUE_SIM_INLINE V inverse_cube_root(V v) {
  V y = 1.6f / (0.6f + v);
  for (int i = 0; i < 6; ++i) y = y * (4.0f - v * y * y * y) * (1.0f / 3);
  return y;
}

/// Neo-Hookean tetrahedron by a deviatoric and a hydrostatic constraint, as Macklin and Mueller
/// (2021) have them with their compliances, 1 / (mu V) and 1 / (K V). Theirs, sqrt(tr F^T F) and
/// det F - 1 - mu / lambda, are at rest only as a sum: solved one after the other they pull
/// tissue at rest to and fro, solved together they are explicit in shear, and blow up with small
/// tetrahedra. Here each is 0 at rest: C_D^2 = tr F^T F - 3 J^(2/3), C_H = J - 1.
///
/// One projection a step, from no multiplier, leaves tissue at rest softer than it is: of
/// constraints in a row C = -(a + D / 2 + what those before it move) lambda, D being the sum of w
/// |grad C|^2, and a mesh of them came out as if each compliance were larger by 0.8 D. The
/// deviatoric one has that taken off, as far as what is left moves no element by more than 4 / 3 of
/// what it is off, from where on one by itself would shake. Sums of volume keep it: off, they would
/// shake (docs/pbd.md).
struct Elastic {
  static constexpr int kVertices = 4, kNumbers = 11, kMultipliers = 2;
  static constexpr float kSoftened = 0.8f, kLeastCompliance = 0.75f;

  template <bool kOnce, class V>
  static TISSUE_SIM_INLINE void project_along(Vertex<V> (&v)[4], const V* number,
                                              const Vector<V> (&along)[3], V c, V a, V& lambda) {
    Vector<V> g[4];
    V sum = c * 0.0f;
    g[0] = {sum, sum, sum};
    for (int k = 0; k < 3; ++k) {
      g[k + 1] =
          number[3 * k] * along[0] + number[3 * k + 1] * along[1] + number[3 * k + 2] * along[2];
      g[0] = g[0] - g[k + 1];
      sum += v[k + 1].w * dot(g[k + 1], g[k + 1]);
    }
    sum += v[0].w * dot(g[0], g[0]);
    if (kOnce) a = greater(a - kSoftened * sum, kLeastCompliance * a);
    const V change = -(c + a * lambda) / (sum + a + kTiny);
    lambda += change;
    for (int k = 0; k < 4; ++k) move(v[k], change, g[k]);
  }
  template <class V>
  static TISSUE_SIM_INLINE void cofactors(const Vector<V> (&f)[3], Vector<V> (&cof)[3]) {
    for (int j = 0; j < 3; ++j) cof[j] = cross(f[(j + 1) % 3], f[(j + 2) % 3]);
  }
  template <class V>
  static TISSUE_SIM_INLINE V square(const Vector<V> (&a)[3]) {
    return dot(a[0], a[0]) + dot(a[1], a[1]) + dot(a[2], a[2]);
  }
  /// number: Q^-1, both compliances [1/(N m)]. kOnce: the only projection of a step.
  template <bool kOnce = false, class V>
  static TISSUE_SIM_INLINE void project(Vertex<V> (&v)[4], const V (&number)[11], V inverse_h2,
                                        V (&lambda)[2]) {
    Vector<V> p[3], f[3], cof[3], h[3];
    edges_of(v, p);
    for (int j = 0; j < 3; ++j) f[j] = column(p, number, j);
    cofactors(f, cof);
    const V whole = dot(f[0], cof[0]), none = whole * 0.0f;
    const V det = lesser(greater(whole, none + 0.1f), none + 4.0f);
    // Of a sheet, a needle or what lies inside out the cofactors grow with the square of what is
    // left, and their slope would lead through the other side, ever further. No longer than F, they
    // make nothing larger.
    const V cubic = inverse_cube_root(det);
    const V factor =
        where_negative(greater(whole - 3.9f, 0.11f - whole), none + 2.25f, none + 1.0f);
    const V most = factor * square(f) / (cubic * cubic * square(cof) + kTiny);
    const V root3 = where_negative(most - 1.0f, cubic * root(most), cubic);
    // C_D grad C_D = H = F - J^(-1/3) cof F. As differences C_D^2 would lose half its digits; of
    // small strains it is |H|^2 / 2, and with that for all, and H / C_D for the slope, the force
    // that the multiplier means stays exactly that of the energy.
    V h2 = det * 0.0f;
    for (int j = 0; j < 3; ++j) {
      h[j] = f[j] - root3 * cof[j];
      h2 += dot(h[j], h[j]);
    }
    const V cd = root(0.5f * h2 + 1e-20f);
    const V over = 1.0f / cd;
    for (int j = 0; j < 3; ++j) h[j] = over * h[j];
    project_along<kOnce>(v, number, h, cd, number[9] * inverse_h2, lambda[0]);
    edges_of(v, p);
    for (int j = 0; j < 3; ++j) f[j] = column(p, number, j);
    cofactors(f, cof);
    // The slope of J is next to nothing in a tetrahedron that two of its directions have collapsed
    // in: a step along it would go ten times too far, and through the tetrahedron. Then the error
    // counts for less; and one that lies inside out comes back little by little.
    const V one = det * 0.0f + 1.0f;
    const V volume =
        lesser(square(cof), one) * greater(lesser(dot(f[0], cof[0]) - 1.0f, one), -1.5f * one);
    project_along<false>(v, number, cof, volume, number[10] * inverse_h2, lambda[1]);
  }
  /// Energy of the two [J].
  static TISSUE_SIM_INLINE double energy(const Vertex<float> (&v)[4], const float (&number)[11]) {
    Vector<float> p[3];
    edges_of(v, p);
    double f[3][3], f2 = 0;
    for (int j = 0; j < 3; ++j) {
      const Vector<float> c = column(p, number, j);
      f[j][0] = c.x, f[j][1] = c.y, f[j][2] = c.z;
      for (int i = 0; i < 3; ++i) f2 += f[j][i] * f[j][i];
    }
    const double det = f[0][0] * (f[1][1] * f[2][2] - f[1][2] * f[2][1]) +
                       f[0][1] * (f[1][2] * f[2][0] - f[1][0] * f[2][2]) +
                       f[0][2] * (f[1][0] * f[2][1] - f[1][1] * f[2][0]);
    const double root3 = cbrt(det);
    return 0.5 * ((f2 - 3 * root3 * root3) / number[9] + (det - 1) * (det - 1) / number[10]);
  }
};

}  // namespace pbd
}  // namespace tissue_sim
