// Constraints of a tetrahedron: strain as the paper prints it, and a material. See constraints.h.
#pragma once

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
/// shares of the error that they take away.
struct Strain {
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
  static TISSUE_SIM_INLINE void project_one(Vertex<V> (&v)[4], const V (&number)[11], int i, int j) {
    Vector<V> p[3];
    edges_of(v, p);
    const Vector<V> fi = column(p, number, i), fj = column(p, number, j);
    V c = dot(fi, fj);
    if (i == j) c -= 1.0f;
    Vector<V> g[4];
    g[0] = {c * 0.0f, c * 0.0f, c * 0.0f};
    V sum = c * 0.0f;
    for (int k = 0; k < 3; ++k) {
      g[k + 1] = number[3 * k + i] * fj + number[3 * k + j] * fi;
      g[0] = g[0] - g[k + 1];
      sum += v[k + 1].w * dot(g[k + 1], g[k + 1]);
    }
    sum += v[0].w * dot(g[0], g[0]);
    const V change = -(i == j ? number[9] : number[10]) * c / (sum + kTiny);
    for (int k = 0; k < 4; ++k) move(v[k], change, g[k]);
  }
  /// number: Q^-1, stretch, shear.
  template <class V>
  static TISSUE_SIM_INLINE void project(Vertex<V> (&v)[4], const V (&number)[11], V,
                                        V (&)[1]) {
    project_one(v, number, 0, 0);
    project_one(v, number, 1, 1);
    project_one(v, number, 2, 2);
    project_one(v, number, 0, 1);
    project_one(v, number, 0, 2);
    project_one(v, number, 1, 2);
  }
};

/// Stable neo-Hookean tetrahedron (Macklin and Mueller 2021): deviatoric C_D = sqrt(tr F^T F) of
/// compliance 1 / (mu V), hydrostatic C_H = det F - 1 - mu / lambda of compliance 1 / (lambda V).
/// Both at once, by the 2 x 2 system of their multipliers: one after the other they pull a
/// tetrahedron at rest to and fro, for only their sum is at rest there.
struct Elastic {
  static constexpr int kVertices = 4, kNumbers = 12, kMultipliers = 2;
  template <class V>
  struct Parts {
    Vector<V> f[3];    ///< columns of F
    Vector<V> cof[3];  ///< columns of its cofactors
    V norm, det;
  };
  template <class V>
  static TISSUE_SIM_INLINE Parts<V> parts(const Vertex<V> (&v)[4], const V (&number)[12]) {
    Vector<V> p[3];
    edges_of(v, p);
    Parts<V> r;
    for (int j = 0; j < 3; ++j) r.f[j] = column(p, number, j);
    for (int j = 0; j < 3; ++j) r.cof[j] = cross(r.f[(j + 1) % 3], r.f[(j + 2) % 3]);
    r.norm = root(dot(r.f[0], r.f[0]) + dot(r.f[1], r.f[1]) + dot(r.f[2], r.f[2]) + kTiny);
    r.det = dot(r.f[0], r.cof[0]);
    return r;
  }
  /// number: Q^-1, both compliances [1/(N m)], and 1 + mu / lambda.
  template <class V>
  static TISSUE_SIM_INLINE void project(Vertex<V> (&v)[4], const V (&number)[12], V inverse_h2,
                                        V (&lambda)[2]) {
    const Parts<V> r = parts(v, number);
    const V over = 1.0f / r.norm;
    Vector<V> gd[4], gh[4];
    V add = v[0].w * 0.0f, ahh = add, adh = add;
    gd[0] = gh[0] = {add, add, add};
    for (int k = 0; k < 3; ++k) {
      gd[k + 1] = over * (number[3 * k] * r.f[0] + number[3 * k + 1] * r.f[1] +
                          number[3 * k + 2] * r.f[2]);
      gh[k + 1] = number[3 * k] * r.cof[0] + number[3 * k + 1] * r.cof[1] +
                  number[3 * k + 2] * r.cof[2];
      gd[0] = gd[0] - gd[k + 1];
      gh[0] = gh[0] - gh[k + 1];
    }
    for (int k = 0; k < 4; ++k) {
      add += v[k].w * dot(gd[k], gd[k]);
      ahh += v[k].w * dot(gh[k], gh[k]);
      adh += v[k].w * dot(gd[k], gh[k]);
    }
    const V a = number[9] * inverse_h2, b = number[10] * inverse_h2;
    const V cd = -(r.norm + a * lambda[0]), ch = -(r.det - number[11] + b * lambda[1]);
    // The determinant without the difference of what is nearly equal: what both gradients have in
    // common where the tetrahedron is at rest leaves add ahh - adh^2 = 0, and compliance the rest.
    const V apart = greater(add * ahh - adh * adh, 1e-6f * add * ahh);
    const V over_det = 1.0f / (apart + a * ahh + b * add + a * b + kTiny);
    const V ld = ((ahh + b) * cd - adh * ch) * over_det;
    const V lh = ((add + a) * ch - adh * cd) * over_det;
    lambda[0] += ld;
    lambda[1] += lh;
    for (int k = 0; k < 4; ++k) {
      move(v[k], ld, gd[k]);
      move(v[k], lh, gh[k]);
    }
  }
};

}  // namespace pbd
}  // namespace tissue_sim
