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

#include "compute/choose.h"
#include "contact/contact_spring.h"
#include "material/laws.h"

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
inline constexpr float kFalls = 0.5f;      // how far a gap falls in a substep at most [edges]
inline constexpr float kHeld2 = 4;         // how far a place is held at most, squared [reach2()]

template <class T>
TISSUE_SIM_INLINE T dot(const T* a, const T* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// How far two nodes may be apart that feel one another, squared; `rest` is the sum of their
/// depths.
template <class T>
TISSUE_SIM_INLINE T reach2(T rest, T edge) {
  const T aside = kAside * edge;
  return rest * rest + aside * aside;
}

}  // namespace mls_contact

/// The weight of two nodes `d` apart: 1 where they stand face to face, 0 where neither feels the
/// other. `rest` is the sum of their depths. Here and below T = float (GPU) or Vec<W> (CPU).
template <class T>
TISSUE_SIM_INLINE T mls_contact_weight(const T* d, T rest, T edge) {
  const T aside = mls_contact::kAside * edge;
  const T left = (mls_contact::reach2(rest, edge) - mls_contact::dot(d, d)) / (aside * aside);
  const T some = larger(left, T{});
  return some * some;
}

/// What a node's support tells: nothing where it spans no space; how its face turns; and whether
/// forces may act beside it, where the support is so good that it does not magnify them.
enum MlsKnowsFace : std::uint8_t { kMlsKnowsNothing, kMlsKnowsNormal, kMlsBearsCouples };

/// From the deformation gradient F, by rows, and the face in reference space. Where it bears no
/// couples the deformation is I. `Mask` is bool where T is float.
template <class T, class Mask>
TISSUE_SIM_INLINE void turn_mls_face(const T* F, const T* face, Mask bears_couples,
                                     Mask knows_normal, T* deformation, T* inverse, T* normal,
                                     T& couples) {
  T cof[9];
  cofactor(F, cof);
  const T det = mls_contact::dot(F, cof), one = all_lanes<T>(1);
  const T least = all_lanes<T>(0.05f);  // of volume that is left
  const Mask knows = bears_couples & less(least, det);
  const T per_det = 1.0f / choose(knows, det, one);
  couples = choose(knows, one, T{});
  for (int k = 0; k < 9; ++k) {
    const T unit = k % 4 == 0 ? one : T{};
    deformation[k] = choose(knows, F[k], unit);
    inverse[k] = choose(knows, T(cof[3 * (k % 3) + k / 3] * per_det), unit);
  }
  T n[3];
  for (int a = 0; a < 3; ++a) n[a] = mls_contact::dot(cof + 3 * a, face);
  const T n2 = mls_contact::dot(n, n);
  const Mask is = knows_normal & less(T{}, n2);
  const T scale = choose(is, T(1.0f / square_root(choose(is, n2, one))), T{});
  for (int a = 0; a < 3; ++a) normal[a] = scale * n[a];
}

TISSUE_SIM_INLINE void set_mls_contact_face(const float* F, const float* face,
                                            MlsKnowsFace knows_face, MlsContactFace& out) {
  turn_mls_face(F, face, knows_face == kMlsBearsCouples, knows_face != kMlsKnowsNothing,
                out.deformation, out.inverse, out.normal, out.couples);
}

/// How far the faces of two nodes are apart along their common normal `n` [m]: the mean of theirs
/// where they look at one another; else, as where the edge of one touches the other, that of the
/// one that parts them more. `r` leads from the low one to the high one in reference space, `d` as
/// they are, `n` too. Faces that were near one another in reference space rest as they lay. Here
/// and below all is of (low, high).
template <class T>
TISSUE_SIM_INLINE T mls_gap(const T* r, const T* d, const T* face_low, const T* face_high,
                            const T* nl, const T* nh, T edge, T* n) {
  using mls_contact::dot;
  const T half = all_lanes<T>(0.5f), far = all_lanes<T>(kMlsApart), tiny = all_lanes<T>(1e-12f);
  const T depths = face_low[3] + face_high[3], length2_before = dot(r, r), length2 = dot(d, d);
  const auto near = less(length2_before, mls_contact::reach2(depths, edge));
  const auto knows_low = less(half, dot(nl, nl)), knows_high = less(half, dot(nh, nh));
  const auto both = knows_low & knows_high, none = none_of(knows_low | knows_high);
  const T cosine = dot(nl, nh);
  const auto opposed = both & less(cosine, all_lanes<T>(mls_contact::kOpposed));
  T mean[3], mean_before[3];
  for (int a = 0; a < 3; ++a) {
    mean[a] = nl[a] - nh[a];
    mean_before[a] = face_low[a] - face_high[a];
  }
  const T scale = 1.0f / square_root(choose(opposed, dot(mean, mean), all_lanes<T>(1)));
  const T scale_before = 1.0f / square_root(larger(dot(mean_before, mean_before), tiny));
  // Along the normal that parts them most.
  const T by_low = choose(knows_low, dot(nl, d), T(-far)),
          by_high = choose(knows_high, T(-dot(nh, d)), T(-far));
  const T then_low = choose(knows_low, dot(face_low, r), T(-far)),
          then_high = choose(knows_high, T(-dot(face_high, r)), T(-far));
  const auto is_high = less(by_low, by_high);
  const T length = square_root(length2), per_length = 1.0f / larger(length, tiny);
  for (int a = 0; a < 3; ++a) {
    const T by_one = choose(is_high, T(-nh[a]), nl[a]);
    n[a] = choose(none, T(per_length * d[a]), choose(opposed, T(scale * mean[a]), by_one));
  }
  const T by_one = choose(opposed, T(scale * dot(mean, d)), larger(by_low, by_high)),
          then_by_one =
              choose(opposed, T(scale_before * dot(mean_before, r)), larger(then_low, then_high));
  const T now = choose(none, length, by_one),
          then = choose(none, square_root(length2_before), then_by_one),
          whole = choose(none, edge, depths);
  const T rest = choose(near & less(then, whole), then, whole);
  const T gap = now - rest + mls_contact::kNone * edge;
  return choose(both & less(all_lanes<T>(mls_contact::kFacing), cosine), far, gap);
}

/// What MlsSlip::gap and begun come to where that is the gap now, kMlsApart where no weight is
/// left: the nodes push one another where it falls below 0. What is deeper at once by half an edge
/// did not come along the normal, but from beside or behind: it pushes no more than before, or it
/// would be thrown out with energy from nowhere.
template <class T>
TISSUE_SIM_INLINE void follow_mls_gap(T now, T edge, T& gap, T& begun) {
  const T first = choose(less(gap, all_lanes<T>(kMlsFresh)), larger(begun, now), now);
  // 0 - 0, not -0: less() goes by the sign.
  const T most = -larger(T(-first), T{}), was = T{} - larger(T(-gap), T{}), is = now - most;
  const auto falls = less(is, T(was - mls_contact::kFalls * edge));
  begun = choose(falls, T(now - was), most);
  gap = choose(falls, was, is);
}

/// Whether the places held, `low` and `high` from their nodes as they are deformed, lie where faces
/// touch. Where a node is squeezed flat a short way is a long one in reference space, and longer
/// than it was as the node springs back: two of them, each of which takes half of how far places
/// slide, would drive them out of all bounds. They begin anew then.
template <class T>
TISSUE_SIM_INLINE auto holds_mls_places(const T* low, const T* high, T rest, T edge) {
  using mls_contact::dot;
  return less(larger(dot(low, low), dot(high, high)),
              T(mls_contact::kHeld2 * mls_contact::reach2(rest, edge)));
}

/// How two nodes that touch push one another, once each.
template <class T, class Mask>
struct MlsPush {
  T force[3];           ///< on the low one [N]
  T at[3];              ///< from the low one to where it acts [m]
  T slide[3];           ///< how far the places held of each slide, the high one's back [m]
  Mask begins, slides;  ///< the places held are to be set; to be moved
};

/// What a push follows from besides the gap, of both nodes.
template <class T>
struct MlsSpringOfFaces {
  T stiffness, damping;  ///< of both in series, times the weight's share
  T friction;            ///< Coulomb's coefficient
  T couples_low, couples_high;
};

/// Of two nodes that touch: `gap` as follow_mls_gap() left it, `before` what it was, `apart` of
/// MlsSlip, which follows; `held` from the place held of the low one to that of the high one, as
/// they are deformed, and whether that `holds`. `dt` is the time since [s].
template <class T, class Mask>
TISSUE_SIM_INLINE void push_mls_faces(const T* d, const T* n, T gap, T before, const T* held,
                                      Mask holds, const MlsSpringOfFaces<T>& spring, float dt,
                                      T* apart, MlsPush<T, Mask>& out) {
  using mls_contact::dot;
  // In the middle, or at the one that bears no couples.
  const T there = 0.5f * (1.0f + spring.couples_low - spring.couples_high);
  out.begins = none_of(less(before, T{}) & holds);
  // All in lengths, of a spring of this stiffness.
  const T lasts = dt > 0 ? T(spring.damping / (spring.stiffness * dt)) : T{};
  const T closed = choose(less(before, all_lanes<T>(0.5f * kMlsApart)), T(before - gap), T{});
  const T push = larger(T(lasts * closed - gap), T{});
  T now[3], moved[3], pull[3];
  const T along_n = dot(held, n);
  for (int a = 0; a < 3; ++a) {
    out.at[a] = there * d[a];
    now[a] = choose(out.begins, T{}, T(held[a] - along_n * n[a]));
    moved[a] = choose(out.begins, T{}, T(now[a] - apart[a]));
  }
  const T moved_n = dot(moved, n);
  for (int a = 0; a < 3; ++a) pull[a] = now[a] + lasts * (moved[a] - moved_n * n[a]);
  const Mask any_couples = less(T{}, T(spring.couples_low + spring.couples_high));
  const T limit = choose(any_couples, T(spring.friction * push), T{});
  const T pull2 = dot(pull, pull);
  out.slides = less(T(limit * limit), pull2);
  const T one = all_lanes<T>(1);
  const T scale = choose(out.slides, T(limit / square_root(choose(out.slides, pull2, one))), one);
  for (int a = 0; a < 3; ++a) {  // the places held slide, each half the way
    pull[a] *= scale;
    out.slide[a] = 0.5f * (now[a] - pull[a]);
    apart[a] = choose(out.slides, pull[a], now[a]);
    out.force[a] = spring.stiffness * (pull[a] - push * n[a]);
  }
  // Without couples along the line between them alone.
  const T along_d = dot(out.force, d) / larger(dot(d, d), all_lanes<T>(1e-20f));
  for (int a = 0; a < 3; ++a) {
    out.force[a] = choose(any_couples, out.force[a], T(along_d * d[a]));
  }
}

/// Sets or moves the places held, in reference space, as a push says.
TISSUE_SIM_INLINE void move_mls_places(const float* inverse_low, const float* inverse_high,
                                       const float* d, const MlsPush<float, bool>& push, float* low,
                                       float* high) {
  using mls_contact::dot;
  if (!push.begins && !push.slides) return;
  float of_low[3], of_high[3];
  for (int a = 0; a < 3; ++a) {
    of_low[a] = (push.begins ? push.at[a] : 0.0f) + (push.slides ? push.slide[a] : 0.0f);
    of_high[a] = (push.begins ? push.at[a] - d[a] : 0.0f) - (push.slides ? push.slide[a] : 0.0f);
  }
  for (int a = 0; a < 3; ++a) {
    low[a] = (push.begins ? 0.0f : low[a]) + dot(inverse_low + 3 * a, of_low);
    high[a] = (push.begins ? 0.0f : high[a]) + dot(inverse_high + 3 * a, of_high);
  }
}

/// Of springs, and of dampers.
template <class T>
TISSUE_SIM_INLINE T in_series(T a, T b) {
  return a * b / (a + b);
}

/// Whether the two nodes push one another: the force on the low one [N], and from it to where that
/// acts [m]. `dt` is the time since this was worked out last [s].
TISSUE_SIM_INLINE bool touch_mls_faces(const MlsContactSide& low, const MlsContactSide& high,
                                       float dt, MlsSlip& slip, float (&force)[3], float (&at)[3]) {
  using mls_contact::dot;
  float r[3], d[3], n[3] = {}, held[3];
  for (int a = 0; a < 3; ++a) {
    r[a] = high.place[a] - low.place[a];
    d[a] = r[a] + (high.u[a] - low.u[a]);
  }
  const MlsContactFace &l = *low.of, &h = *high.of;
  const float edge = 0.5f * (low.edge + high.edge);
  const float weight = mls_contact_weight(d, low.face[3] + high.face[3], edge);
  const float before = slip.gap;
  const float now =
      weight > 0 ? mls_gap(r, d, low.face, high.face, l.normal, h.normal, edge, n) : kMlsApart;
  follow_mls_gap(now, edge, slip.gap, slip.begun);
  if (!(slip.gap < 0)) return false;
  float of_low[3], of_high[3];
  for (int a = 0; a < 3; ++a) {
    of_low[a] = dot(l.deformation + 3 * a, slip.low);
    of_high[a] = dot(h.deformation + 3 * a, slip.high);
    held[a] = d[a] + of_high[a] - of_low[a];
  }
  const bool holds = holds_mls_places(of_low, of_high, low.face[3] + high.face[3], edge);
  const float share = 0.5f * weight * (1 / l.weights + 1 / h.weights);
  MlsSpringOfFaces<float> spring;
  spring.stiffness = share * in_series(low.spring.stiffness, high.spring.stiffness);
  spring.damping = share * in_series(low.spring.damping, high.spring.damping);
  spring.friction = low.root_friction * high.root_friction;
  spring.couples_low = l.couples;
  spring.couples_high = h.couples;
  MlsPush<float, bool> push;
  push_mls_faces(d, n, slip.gap, before, held, holds, spring, dt, slip.apart, push);
  move_mls_places(l.inverse, h.inverse, d, push, slip.low, slip.high);
  for (int a = 0; a < 3; ++a) {
    force[a] = push.force[a];
    at[a] = push.at[a];
  }
  return true;
}

}  // namespace tissue_sim
