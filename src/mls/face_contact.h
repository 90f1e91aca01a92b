// Two nodes of faces that touch: the spring between them, on the CPU and on the GPU.
//
// Faces are flat around a node: tissue ends `depth` ahead of it along its normal, which turns with
// its deformation. How far two faces are apart along their common normal n is then
// n . (x_j - x_i) - depth_i - depth_j whatever place along the faces the nodes have. A node pushes
// all nodes that it faces within some distance, each for its share of
//   (w_ij / sum over i's + w_ij / sum over j's) / 2,
// so flat faces slide over one another without a bump. Forces act in the middle between the nodes,
// on each as its fit of places says (docs/mls.md), so that both momenta stay. Friction holds the
// material places of both sides that lay there when they began to touch, within Coulomb's cone.
#pragma once

#include <cmath>
#include <cstdint>

#include "compute/host_device.h"
#include "contact/contact_spring.h"

namespace tissue_sim {

/// What is known of a node that may touch others, as of the present substep.
struct MlsContactFace {
  float deformation[9];  ///< of rows; I where it bears no couples
  float inverse[9];
  float normal[3];  ///< outward, in the world; 0 where unknown
  float weights;    ///< sum over those that it may touch
  float couples;    ///< 1 where forces may act beside the node, 0 where only at it
};

/// What two nodes that touch remember.
struct MlsSlip {
  float low[3], high[3];  ///< places held, from each node, in reference space [m]
  float apart[3];         ///< from the low one's to the high one's, along the faces [m]
  float gap;              ///< [m]; kMlsApart where they were not near
  float begun;            ///< gap from which on they push, at most 0 [m]
};
/// kMlsFresh before the first substep of two that were found because of a cut: deformed as it is,
/// tissue there may overlap, and a fresh cut is free of stress. They push from there on, and from
/// where they opened to.
inline constexpr float kMlsApart = 1e30f, kMlsFresh = 2e30f;

/// One of both nodes, the one with the lower number and the other.
struct MlsContactSide {
  const float *place, *u;  ///< reference and displacement [m]
  const float* face;       ///< outward normal in reference space and depth below it [m]
  const MlsContactFace* of;
  ContactSpring spring;
  float edge;           ///< distance to its neighbours [m]
  float root_friction;  ///< of Coulomb's coefficient
};

namespace mls_contact {

inline constexpr float kAside = 1.1f;      // how far along a face a node is felt [edges]
inline constexpr float kNone = 1e-4f;      // gaps below count as none [edges]: rounding
inline constexpr float kFacing = 0.3f;     // most of n_i . n_j of those that face one another
inline constexpr float kOpposed = -0.85f;  // of those that look at one another

TISSUE_SIM_INLINE float dot(const float* a, const float* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

TISSUE_SIM_INLINE float reach2(const float* face, const float* other, float edge) {
  const float rest = face[3] + other[3], aside = kAside * edge;
  return rest * rest + aside * aside;
}

}  // namespace mls_contact

/// The weight of two nodes `d` apart: 1 where they stand face to face, 0 where neither feels the
/// other.
TISSUE_SIM_INLINE float mls_contact_weight(const float* d, const float* face, const float* other,
                                           float edge) {
  const float aside = mls_contact::kAside * edge;
  const float left =
      (mls_contact::reach2(face, other, edge) - mls_contact::dot(d, d)) / (aside * aside);
  return left > 0 ? left * left : 0.0f;
}

/// What a node's support tells: nothing where it spans no space; how its face turns; and whether
/// forces may act beside it, where the support is so good that it does not magnify them.
enum MlsKnowsFace : std::uint8_t { kMlsKnowsNothing, kMlsKnowsNormal, kMlsBearsCouples };

/// From the deformation gradient, by rows, and the face in reference space.
TISSUE_SIM_INLINE void set_mls_contact_face(const float* F, const float* face,
                                            MlsKnowsFace knows_face, MlsContactFace& out) {
  const float cof[9] = {
      F[4] * F[8] - F[5] * F[7], F[5] * F[6] - F[3] * F[8], F[3] * F[7] - F[4] * F[6],
      F[2] * F[7] - F[1] * F[8], F[0] * F[8] - F[2] * F[6], F[1] * F[6] - F[0] * F[7],
      F[1] * F[5] - F[2] * F[4], F[2] * F[3] - F[0] * F[5], F[0] * F[4] - F[1] * F[3]};
  const float det = mls_contact::dot(F, cof);
  constexpr float kLeast = 0.05f;  // of volume that is left
  const bool knows = knows_face == kMlsBearsCouples && det > kLeast;
  out.couples = knows ? 1.0f : 0.0f;
  for (int k = 0; k < 9; ++k) {
    const float unit = k % 4 == 0 ? 1.0f : 0.0f;
    out.deformation[k] = knows ? F[k] : unit;
    out.inverse[k] = knows ? cof[3 * (k % 3) + k / 3] / det : unit;
  }
  float n[3];
  for (int a = 0; a < 3; ++a) n[a] = mls_contact::dot(cof + 3 * a, face);
  const float n2 = mls_contact::dot(n, n);
  const float scale = knows_face != kMlsKnowsNothing && n2 > 0 ? 1 / sqrtf(n2) : 0.0f;
  for (int a = 0; a < 3; ++a) out.normal[a] = scale * n[a];
}

/// How far the faces of two nodes are apart along their common normal [m]: the mean of theirs where
/// they look at one another; else, as where the edge of one touches the other, that of the one that
/// parts them more. `d` leads from the low one to the high one, `n` too. Faces that were near one
/// another in reference space rest as they lay.
TISSUE_SIM_INLINE float mls_gap(const MlsContactSide& low, const MlsContactSide& high,
                                const float* d, float edge, float (&n)[3]) {
  using mls_contact::dot;
  float r[3];
  for (int a = 0; a < 3; ++a) r[a] = high.place[a] - low.place[a];
  const bool near = dot(r, r) < mls_contact::reach2(low.face, high.face, edge);
  const float none = mls_contact::kNone * edge, rest = low.face[3] + high.face[3];
  const float *nl = low.of->normal, *nh = high.of->normal;
  const bool knows_low = dot(nl, nl) > 0, knows_high = dot(nh, nh) > 0;
  if (!knows_low && !knows_high) {
    const float length = sqrtf(dot(d, d)), before = sqrtf(dot(r, r));
    for (int a = 0; a < 3; ++a) n[a] = d[a] / fmaxf(length, 1e-12f);
    return length - (near ? fminf(edge, before) : edge) + none;
  }
  const bool both = knows_low && knows_high;
  if (both && dot(nl, nh) > mls_contact::kFacing) return kMlsApart;
  float now = -kMlsApart, then = -kMlsApart;  // along the normal that parts them most
  const auto part_along = [&](const float* m, const float* M) {
    then = fmaxf(then, dot(M, r));
    const float parted = dot(m, d);
    if (parted <= now) return;
    now = parted;
    for (int a = 0; a < 3; ++a) n[a] = m[a];
  };
  float m[3], M[3];
  if (both && dot(nl, nh) < mls_contact::kOpposed) {
    for (int a = 0; a < 3; ++a) {
      m[a] = nl[a] - nh[a];
      M[a] = low.face[a] - high.face[a];
    }
    const float scale = 1 / sqrtf(dot(m, m)), scale_M = 1 / sqrtf(fmaxf(dot(M, M), 1e-12f));
    for (int a = 0; a < 3; ++a) {
      m[a] *= scale;
      M[a] *= scale_M;
    }
    part_along(m, M);
  } else {
    if (knows_low) part_along(nl, low.face);
    for (int a = 0; a < 3; ++a) {
      m[a] = -nh[a];
      M[a] = -high.face[a];
    }
    if (knows_high) part_along(m, M);
  }
  return now - (near ? fminf(rest, then) : rest) + none;
}

/// Whether the two nodes push one another: the force on the low one [N], and from it to where that
/// acts [m]. `dt` is the time since this was worked out last [s].
TISSUE_SIM_INLINE bool touch_mls_faces(const MlsContactSide& low, const MlsContactSide& high,
                                       float dt, MlsSlip& slip, float (&force)[3], float (&at)[3]) {
  using mls_contact::dot;
  float d[3], n[3] = {};
  for (int a = 0; a < 3; ++a) {
    d[a] = (high.place[a] - low.place[a]) + (high.u[a] - low.u[a]);
  }
  const float edge = 0.5f * (low.edge + high.edge);
  const float weight = mls_contact_weight(d, low.face, high.face, edge);
  const float before = slip.gap;
  slip.gap = weight > 0 ? mls_gap(low, high, d, edge, n) : kMlsApart;
  slip.begun = fminf(0.0f, before < kMlsFresh ? fmaxf(slip.begun, slip.gap) : slip.gap);
  slip.gap -= slip.begun;
  if (!(slip.gap < 0)) return false;
  const MlsContactFace &l = *low.of, &h = *high.of;
  // In the middle, or at the one that bears no couples.
  const float there = 0.5f * (1 + l.couples - h.couples);
  for (int a = 0; a < 3; ++a) at[a] = there * d[a];
  if (!(before < 0)) {  // they begin to touch
    for (int a = 0; a < 3; ++a) {
      slip.apart[a] = 0;
      slip.low[a] = dot(l.inverse + 3 * a, at);
      const float from_high[3] = {at[0] - d[0], at[1] - d[1], at[2] - d[2]};
      slip.high[a] = dot(h.inverse + 3 * a, from_high);
    }
  }
  // All in lengths, of a spring of this stiffness.
  const float share = 0.5f * weight * (1 / l.weights + 1 / h.weights);
  const float stiffness = share * low.spring.stiffness * high.spring.stiffness /
                          (low.spring.stiffness + high.spring.stiffness);
  const float damping =
      share * low.spring.damping * high.spring.damping / (low.spring.damping + high.spring.damping);
  const float lasts = dt > 0 ? damping / (stiffness * dt) : 0.0f;
  const float closed = before < 0.5f * kMlsApart ? before - slip.gap : 0.0f;
  const float push = fmaxf(0.0f, -slip.gap + lasts * closed);
  float apart[3], pull[3];
  for (int a = 0; a < 3; ++a) {
    apart[a] = d[a] + dot(h.deformation + 3 * a, slip.high) - dot(l.deformation + 3 * a, slip.low);
  }
  const float along_n = dot(apart, n);
  for (int a = 0; a < 3; ++a) apart[a] -= along_n * n[a];
  float moved[3];
  for (int a = 0; a < 3; ++a) moved[a] = apart[a] - slip.apart[a];
  const float moved_n = dot(moved, n);
  for (int a = 0; a < 3; ++a) pull[a] = apart[a] + lasts * (moved[a] - moved_n * n[a]);
  const bool any_couples = l.couples + h.couples > 0;
  const float limit = any_couples ? low.root_friction * high.root_friction * push : 0.0f;
  const float pull2 = dot(pull, pull);
  if (pull2 > limit * limit) {  // the places held slide, each half the way
    const float scale = limit / sqrtf(pull2);
    float half[3];
    for (int a = 0; a < 3; ++a) {
      pull[a] *= scale;
      half[a] = 0.5f * (apart[a] - pull[a]);
      apart[a] = pull[a];
    }
    for (int a = 0; a < 3; ++a) {
      slip.low[a] += dot(l.inverse + 3 * a, half);
      slip.high[a] -= dot(h.inverse + 3 * a, half);
    }
  }
  for (int a = 0; a < 3; ++a) {
    slip.apart[a] = apart[a];
    force[a] = stiffness * (pull[a] - push * n[a]);
  }
  if (!any_couples) {  // along the line between them alone
    const float share = dot(force, d) / fmaxf(dot(d, d), 1e-20f);
    for (int a = 0; a < 3; ++a) force[a] = share * d[a];
  }
  return true;
}

}  // namespace tissue_sim
