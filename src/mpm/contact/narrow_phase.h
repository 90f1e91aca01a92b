// A look at a contact: which facet a facet touches, how deep it is, where it is held. The same on
// the CPU and on the GPU; what differs is how facets and nodes are reached, which a `Faces` knows.
// It is of one contact and has
//   facet(f), motion(f)        of a facet: what it is, how it stands
//   body(f)                    which
//   middle(f, place)           reference place of the middle of its cell [m]
//   modulus(f), friction(f)    of its tissue: P-wave modulus [Pa], Coulomb's
//   cell_size(), per_cell()    the scene's, and every lattice's [m], [1/m]
//   near(n)                    the facets near this one, by their place in its list
//   for_each_near(visit)       calls visit(n, near(n), its motion's x), for this lane's share
//   nearest(best), largest(x)  the best, the largest of all lanes
//   hold_in(f), hold(place)    sets the cell and the place in it of the place held
//   own(u), held(u)            displacements of the facet's centre and of the place held [m]
//   own_mobility(), held_mobility()   of both: sum of w^2 / m [1/kg]
#pragma once

#include <climits>
#include <cmath>

#include "contact/contact_spring.h"
#include "mpm/contact/face_search.h"
#include "mpm/contact/face_spring.h"
#include "mpm/surface/facet_in_world.h"

namespace tissue_sim {

inline constexpr int kLongestLook = 16;            ///< substeps between two looks
inline constexpr float kNearGap = 0.25f;           ///< up to which a contact is worked on [cells]
inline constexpr float kMovedBetweenLooks = 0.1f;  ///< [cells]
/// Share of its speed that counts for what is near no face: that is a cell away at least, ten times
/// what may be moved between looks.
inline constexpr float kFarOff = 0.3f;

/// Time until the next look where the fastest pair moves at this speed [s].
TISSUE_SIM_INLINE double look_horizon(float fastest, double cell_size, double dt) {
  return fmin(kLongestLook * dt, kMovedBetweenLooks * cell_size / fmaxf(fastest, 1e-6f));
}

/// Whether a contact touches, or may before the next look.
TISSUE_SIM_INLINE bool is_active(const FaceSpring& c) {
  return c.other >= 0 && (c.touching || c.depth >= -kNearGap);
}

/// A facet that might catch another: how far beyond its edge, and where in the list.
struct NearFacet {
  float beyond;
  int at;  ///< INT_MAX: none
};

namespace looks {

// Lengths in cells. Points are half a cell apart, so a slice of one layer is that thick: a facet
// that deep in another may be the back of its own slice, and only a contact that began while the
// faces were apart goes deeper than kDeepest.
inline constexpr float kDeepest = 0.375f;
inline constexpr float kDeeper = 0.25f;  ///< by how much more it may be in another that takes over
inline constexpr float kBeyond = 0.25f;  ///< how far beyond its edge a facet still catches
inline constexpr float kBeyondHeld = 1;  ///< the same of one that touches and finds no other
inline constexpr float kFarthest = 2;    ///< from the centre of the facet that catches it
inline constexpr float kStay = 0.1f;     ///< by how much another facet must fit better to take over
inline constexpr float kNothing = 1e-3f;  ///< share of a spring's energy at `sudden`
inline constexpr float kRough = 0.1f;     ///< by how much fitted faces may be off
inline constexpr float kSettle =
    0.02f;  ///< in which what began deeper than that gets its spring back [s]

/// Where a facet's centre lies as seen by another facet, in cells of its reference space.
struct Seen {
  float place[3];  ///< from the middle of the other's cell
  float depth;     ///< below its plane
  float beyond;    ///< its edge
};

template <class Faces>
TISSUE_SIM_HOST_DEVICE inline Seen seen_by(const Faces& s, const FacetMotion& f, int other) {
  const FacetMotion& o = s.motion(other);
  const Facet& facet = s.facet(other);
  const float d[3] = {f.x[0] - o.x[0], f.x[1] - o.x[1], f.x[2] - o.x[2]};
  float from[3];
  for (int a = 0; a < 3; ++a) from[a] = s.per_cell() * dot(o.to_reference + 3 * a, d);
  Seen seen;
  seen.depth = -dot(from, facet.normal);
  seen.beyond = -1;
  for (int a = 0; a < 3; ++a) {
    seen.place[a] = facet.center[a] + from[a];
    if (facet.extent[a] == 0) continue;
    const float along = from[a] + seen.depth * facet.normal[a];
    seen.beyond = fmaxf(seen.beyond, fabsf(along) - facet.extent[a]);
  }
  return seen;
}

/// How fast a facet gets deeper below another [cells/s].
template <class Faces>
TISSUE_SIM_HOST_DEVICE inline float closing_speed(const Faces& s, int facet, int other) {
  const FacetMotion &f = s.motion(facet), &o = s.motion(other);
  const float v[3] = {f.v[0] - o.v[0], f.v[1] - o.v[1], f.v[2] - o.v[2]};
  return fmaxf(0.0f, -dot(v, o.normal)) * s.per_cell();
}

/// Whether a contact was in front of a face when it was looked at last.
TISSUE_SIM_INLINE bool was_in_front(const FaceSpring& c) {
  return c.other >= 0 && !c.touching && c.depth < 0;
}

/// The facet to touch among those near, -1 if none. What touches, or was in front, may have become
/// deeper by `moved` [cells] since the last look.
template <class Faces>
TISSUE_SIM_HOST_DEVICE inline int choose_other(const Faces& s, const FaceSpring& c, float moved) {
  const float deepest =
      c.touching || was_in_front(c) ? fmaxf(kDeepest, c.depth + kDeeper + moved) : kDeepest;
  const FacetMotion& own = s.motion(c.facet);
  if (c.touching && c.other >= 0) {
    const Seen seen = seen_by(s, own, c.other);
    if (seen.beyond < 0 && seen.depth < deepest) return c.other;
  }
  const auto far = static_cast<float>(kFarthest * s.cell_size());
  NearFacet best{kBeyond, INT_MAX};
  s.for_each_near([&](int n, int other, const float* y) {
    const float d[3] = {own.x[0] - y[0], own.x[1] - y[1], own.x[2] - y[2]};
    if (dot(d, d) > far * far) return;
    const Seen seen = seen_by(s, own, other);
    const float beyond = seen.beyond - (other == c.other ? kStay : 0);
    if (seen.depth > deepest || seen.depth < -kSearchReach - kNearGap) return;
    if (beyond < best.beyond) best = {beyond, n};
  });
  best = s.nearest(best);
  if (best.at != INT_MAX) return s.near(best.at);
  // Where tissue is bent its faces leave gaps, through which what presses would be gone for good.
  if (!c.touching || c.other < 0) return -1;
  const Seen seen = seen_by(s, own, c.other);
  return seen.beyond < kBeyondHeld && seen.depth < deepest ? c.other : -1;
}

/// How fast a facet moves against the fastest of those near [m/s].
template <class Faces>
TISSUE_SIM_HOST_DEVICE inline float speed_against_near(const Faces& s, const FaceSpring& c) {
  const float* own = s.motion(c.facet).v;
  float most = 0;
  s.for_each_near([&](int, int other, const float*) {
    const float* v = s.motion(other).v;
    const float d[3] = {own[0] - v[0], own[1] - v[1], own[2] - v[2]};
    most = fmaxf(most, dot(d, d));
  });
  return sqrtf(s.largest(most));
}

template <class Faces>
TISSUE_SIM_HOST_DEVICE inline void hold_at(Faces& s, FaceSpring& c, const float (&place)[3]) {
  c.hold_at(place);
  s.hold(place);
}

/// From the place held to the facet's centre, in the world.
template <class Faces>
TISSUE_SIM_HOST_DEVICE inline void measure_apart(const Faces& s, FaceSpring& c) {
  float own[3], held[3];
  s.own(own);
  s.held(held);
  c.measure_apart(own, held);
}

template <class Faces>
TISSUE_SIM_HOST_DEVICE inline void take_normal(const Faces& s, FaceSpring& c) {
  const FacetMotion& o = s.motion(c.other);
  for (int a = 0; a < 3; ++a) c.normal[a] = o.normal[a];
  for (int k = 0; k < 9; ++k) c.to_reference[k] = o.to_reference[k] * s.per_cell();
}

/// Starts a contact with another facet, at a place of its cell. The spring is a point's spring
/// against a tool, the two tissues' in series; softer where it would move so little mass that
/// substeps of `dt` could not follow.
template <class Faces>
TISSUE_SIM_HOST_DEVICE inline void begin(Faces& s, FaceSpring& c, int other,
                                         const float (&place)[3], float dt) {
  const Facet& facet = s.facet(c.facet);
  const double p = s.modulus(c.facet), q = s.modulus(other), own_size = s.cell_size();
  c.other = other;
  s.hold_in(other);
  take_normal(s, c);
  double own[3], middle[3];
  s.middle(c.facet, own);
  s.middle(other, middle);
  for (int a = 0; a < 3; ++a) {
    c.from_middle[a] = own[a] + own_size * facet.center[a] - middle[a];
  }
  c.cell_size = s.cell_size();
  hold_at(s, c, place);
  c.stiffness =
      static_cast<float>(kContactStiffness * 2 * p * q / (p + q) * facet.area / (0.5 * own_size));
  c.own_mobility = s.own_mobility();
  c.soften(s.held_mobility(), dt);
  c.friction = sqrtf(s.friction(c.facet) * s.friction(other));
  c.sudden = static_cast<float>(kMovedBetweenLooks * own_size);
  c.touching = false;
}

TISSUE_SIM_INLINE float stretch2(const FaceSpring& c) {
  return c.stiffness * dot(c.apart, c.apart);
}

/// Lets the place held give way until the spring holds no more than `limit` of energy (twice it,
/// [J]). Returns whether it does.
template <class Faces>
TISSUE_SIM_HOST_DEVICE inline bool give_way(Faces& s, FaceSpring& c, float limit) {
  measure_apart(s, c);
  for (int i = 0; i < 3 && stretch2(c) > limit; ++i) {
    const float share = 1 - sqrtf(limit / stretch2(c));
    float place[3];
    for (int a = 0; a < 3; ++a) {
      place[a] = c.hold[a] + share * dot(c.to_reference + 3 * a, c.apart);
    }
    hold_at(s, c, place);
    measure_apart(s, c);
  }
  return stretch2(c) <= 1.01f * limit + kNothing * c.stiffness * c.sudden * c.sudden;
}

/// How far the place held lies below the other face [cells].
template <class Faces>
TISSUE_SIM_HOST_DEVICE inline float below(const Faces& s, const FaceSpring& c) {
  const Facet& facet = s.facet(c.other);
  float result = 0;
  for (int a = 0; a < 3; ++a) result -= (c.hold[a] - facet.center[a]) * facet.normal[a];
  return result;
}

/// Starts a contact with another facet that goes on from the material place that was held so far,
/// at `held` in reference space [m], if that is on the new face, too. It had sunk so far below
/// where it began [cells]; that it may be deeper below the new face is no reason to lift it.
template <class Faces>
TISSUE_SIM_HOST_DEVICE inline void go_on(Faces& s, FaceSpring& c, int other,
                                         const double (&held)[3], float sunk, float dt) {
  const float limit = stretch2(c), stiffness = c.stiffness;
  double middle[3];
  s.middle(other, middle);
  float place[3];
  for (int a = 0; a < 3; ++a) {
    place[a] = static_cast<float>((held[a] - middle[a]) / s.cell_size());
  }
  begin(s, c, other, place, dt);
  c.stiffness = stiffness;  // the same spring, unless substeps cannot follow
  c.soften(s.held_mobility(), dt);
  c.touching = give_way(s, c, limit) && c.holds();
  c.begun = fmaxf(c.begun, below(s, c) - sunk);
}

/// Puts the place held by a contact that does not touch on the other face, below the facet, or,
/// where faces are in one another from the start, where there is no force. What came from the front
/// since the last look touches, up to `came` deep [cells], or what is fast would be aimed anew in
/// each substep.
template <class Faces>
TISSUE_SIM_HOST_DEVICE inline bool aim(Faces& s, FaceSpring& c, const Seen& seen, float came) {
  const Facet& facet = s.facet(c.other);
  const float lift = fminf(came, seen.depth);
  float place[3];
  for (int a = 0; a < 3; ++a) place[a] = seen.place[a] + lift * facet.normal[a];
  hold_at(s, c, place);
  measure_apart(s, c);
  c.begun = fmaxf(kRough, seen.depth - fmaxf(0.0f, lift));
  c.touching = came > 0 && lift > 0;
  return c.touching || dot(c.apart, c.normal) >= 0 || give_way(s, c, 0);
}

/// Puts the place held by a contact that touches onto the face if it got above it, and back up
/// towards the face if it sank below where the contact began; the last look was `since` seconds
/// ago.
template <class Faces>
TISSUE_SIM_HOST_DEVICE inline void settle(Faces& s, FaceSpring& c, float dt, float since) {
  const Facet& facet = s.facet(c.other);
  float lift = below(s, c);
  if (lift > 0) {
    lift = fmaxf(0.0f, lift - c.begun) * (1 - expf(-since / kSettle));
  } else {
    lift = fminf(0.0f, lift + 0.5f * kRough);
  }
  c.soften(s.held_mobility(), dt);
  if (lift == 0) return;
  float place[3];
  for (int a = 0; a < 3; ++a) place[a] = c.hold[a] + lift * facet.normal[a];
  hold_at(s, c, place);
  measure_apart(s, c);
}

}  // namespace looks

/// Looks anew at a contact: which facet, its normal, and the place held. Returns how fast the two
/// move against one another as the next look has to know it: kFarOff of it if there is none [m/s].
template <class Faces>
TISSUE_SIM_HOST_DEVICE inline float look(Faces& s, FaceSpring& c, float dt, float since) {
  constexpr float kComes = 0.5f;  // substeps: from 0.8 on, pieces that spin gain energy
  const int before = c.other;
  const bool in_front = looks::was_in_front(c);
  const float moved = before >= 0 ? since * looks::closing_speed(s, c.facet, before) : 0.0f;
  const int other = looks::choose_other(s, c, moved);
  if (other < 0) {
    c.other = -1;
    c.touching = false;
    return kFarOff * looks::speed_against_near(s, c);
  }
  const FacetMotion &f = s.motion(c.facet), &o = s.motion(other);
  const looks::Seen seen = looks::seen_by(s, f, other);
  c.depth = seen.depth;
  if (other == before) {
    looks::take_normal(s, c);
  } else if (c.touching && s.body(before) == s.body(other)) {
    double held[3];
    s.middle(before, held);
    for (int a = 0; a < 3; ++a) held[a] += c.cell_size * c.hold[a];
    looks::go_on(s, c, other, held, fmaxf(0.0f, looks::below(s, c) - c.begun), dt);
  } else {
    looks::begin(s, c, other, seen.place, dt);
  }
  const float v[3] = {f.v[0] - o.v[0], f.v[1] - o.v[1], f.v[2] - o.v[2]};
  const float speed = sqrtf(dot(v, v));
  if (c.touching) {
    looks::settle(s, c, dt, since);
  } else {
    const float came = in_front ? kComes * dt * looks::closing_speed(s, c.facet, other) : 0.0f;
    if (!looks::aim(s, c, seen, came)) {
      c.other = -1;
      return kFarOff * speed;
    }
  }
  return speed;
}

/// Lets a contact go on from what it was before blocks were made anew, if it does.
template <class Faces>
TISSUE_SIM_HOST_DEVICE inline void take_up(Faces& s, FaceSpring& c, const KeptContact& kept,
                                           float dt) {
  c.touching = true;
  c.depth = kept.depth;
  const int other = looks::choose_other(s, c, 0);
  c.touching = false;
  if (other < 0 || s.body(other) != kept.other_body) return;
  c.stiffness = kept.stiffness;
  for (int a = 0; a < 3; ++a) c.apart[a] = kept.apart[a];
  c.begun = kept.begun;
  looks::go_on(s, c, other, kept.hold, fmaxf(0.0f, kept.depth - kept.begun), dt);
}

}  // namespace tissue_sim
