#include "contact/look_at_face.h"

#include <algorithm>
#include <cmath>

#include "contact/collider.h"
#include "contact/face_places.h"

namespace tissue_sim {
namespace {

// Lengths in cells. Points are half a cell apart, so a slice of one layer is that thick: a facet
// that deep in another may be the back of its own slice, and only a contact that began while the
// faces were apart goes deeper than kDeepest.
constexpr float kDeepest = 0.375f;
constexpr float kDeeper = 0.25f;   ///< by how much more it may be in another that takes over
constexpr float kBeyond = 0.25f;   ///< how far beyond its edge a facet still catches
constexpr float kFarthest = 2;     ///< from the centre of the facet that catches it
constexpr float kStay = 0.1f;      ///< by how much another facet must fit better to take over
constexpr float kNothing = 1e-3f;  ///< share of a spring's energy at `sudden`
constexpr float kRough = 0.1f;     ///< by how much fitted faces may be off
constexpr double kSettle = 0.02;  ///< in which what began deeper than that gets its spring back [s]

/// Where a facet's centre lies as seen by another facet, in cells of its reference space.
struct Seen {
  float place[3];  ///< from the middle of the other's cell
  float depth;     ///< below its plane
  float beyond;    ///< its edge
};

Seen seen_by(const MpmState& s, const FacetMotion& f, std::int32_t other) {
  const FacetMotion& o = s.faces.motion[other];
  const Facet& facet = facet_of(s, other);
  const auto per_cell = static_cast<float>(1 / body_of(s, other).cell_size);
  const float d[3] = {f.x[0] - o.x[0], f.x[1] - o.x[1], f.x[2] - o.x[2]};
  float from[3];
  for (int a = 0; a < 3; ++a) from[a] = per_cell * dot(o.to_reference + 3 * a, d);
  Seen seen;
  seen.depth = -dot(from, facet.normal);
  seen.beyond = -1;
  for (int a = 0; a < 3; ++a) {
    seen.place[a] = facet.center[a] + from[a];
    if (facet.extent[a] == 0) continue;
    const float along = from[a] + seen.depth * facet.normal[a];
    seen.beyond = std::max(seen.beyond, std::fabs(along) - facet.extent[a]);
  }
  return seen;
}

/// The facet to touch among those near contact `i`, -1 if none.
std::int32_t choose_other(const MpmState& s, int i) {
  const FaceContacts& faces = s.faces;
  const FaceContact& c = faces.all[i];
  const float deepest = c.touching ? std::max(kDeepest, c.depth + kDeeper) : kDeepest;
  if (c.touching && c.other >= 0) {
    const Seen seen = seen_by(s, faces.motion[c.facet], c.other);
    if (seen.beyond < 0 && seen.depth < deepest) return c.other;
  }
  const float* x = faces.motion[c.facet].x;
  const auto far = static_cast<float>(kFarthest * s.scene.cell_size);
  float best = kBeyond;
  std::int32_t other = -1;
  for (std::int32_t n = faces.first_near[i]; n < faces.first_near[i + 1]; ++n) {
    const float* y = faces.motion[faces.near[n]].x;
    const float d[3] = {x[0] - y[0], x[1] - y[1], x[2] - y[2]};
    if (dot(d, d) > far * far) continue;
    const Seen seen = seen_by(s, faces.motion[c.facet], faces.near[n]);
    const bool same = faces.near[n] == c.other;
    const float beyond = seen.beyond - (same ? kStay : 0);
    if (seen.depth > deepest || seen.depth < -kSearchReach - kNearGap || !(beyond < best)) continue;
    best = beyond;
    other = faces.near[n];
  }
  return other;
}

void take_normal(const MpmState& s, FaceContact& c) {
  const FacetMotion& o = s.faces.motion[c.other];
  const auto per_cell = static_cast<float>(1 / body_of(s, c.other).cell_size);
  std::copy(o.normal, o.normal + 3, c.normal);
  for (int k = 0; k < 9; ++k) c.to_reference[k] = o.to_reference[k] * per_cell;
}

/// Starts a contact with another facet, at a place of its cell. The spring is a point's spring
/// against a tool, the two tissues' in series; softer where it would move so little mass that
/// substeps of `dt` could not follow.
void begin(const MpmState& s, FaceContact& c, std::int32_t other, const float (&place)[3],
           double dt) {
  const LatticeBody &own = body_of(s, c.facet), &body = body_of(s, other);
  const Material &m = material_of(s, c.facet), &n = material_of(s, other);
  const double p = lame_lambda(m) + 2 * lame_mu(m), q = lame_lambda(n) + 2 * lame_mu(n);
  c.other = other;
  c.other_nodes = CellNodes(block_of(s, other), facet_of(s, other).cell);
  take_normal(s, c);
  const float middle[3] = {};
  const Vec3 from_middle =
      reference_place(own, block_of(s, c.facet), facet_of(s, c.facet)) -
      reference_place(body, block_of(s, other), facet_of(s, other).cell, middle);
  for (int a = 0; a < 3; ++a) c.from_middle[a] = from_middle[a];
  c.cell_size = body.cell_size;
  hold_at(c, place);
  const double stiffness =
      kContactStiffness * 2 * p * q / (p + q) * facet_of(s, c.facet).area / (0.5 * own.cell_size);
  c.stiffness = static_cast<float>(stiffness);
  c.own_mobility = static_cast<float>(mobility(s.nodes, c.nodes, c.weights));
  soften(s, c, dt);
  c.friction = static_cast<float>(std::sqrt(m.friction * n.friction));
  c.sudden = static_cast<float>(kMovedBetweenLooks * own.cell_size);
  c.touching = false;
}

float stretch2(const FaceContact& c) { return c.stiffness * dot(c.apart, c.apart); }

/// Lets the place held give way until the spring holds no more than `limit` of energy (twice it,
/// [J]). Returns whether it does.
bool give_way(const MpmState& s, FaceContact& c, float limit) {
  measure_apart(s, c);
  for (int i = 0; i < 3 && stretch2(c) > limit; ++i) {
    const float share = 1 - std::sqrt(limit / stretch2(c));
    float place[3];
    for (int a = 0; a < 3; ++a) {
      place[a] = c.hold[a] + share * dot(c.to_reference + 3 * a, c.apart);
    }
    hold_at(c, place);
    measure_apart(s, c);
  }
  return stretch2(c) <= 1.01f * limit + kNothing * c.stiffness * c.sudden * c.sudden;
}

/// Starts a contact with another facet that goes on from the material place that was held so far,
/// if that is on the new face, too.
void go_on(const MpmState& s, FaceContact& c, std::int32_t other, const Vec3& held, double dt) {
  const LatticeBody& body = body_of(s, other);
  const float middle[3] = {}, limit = stretch2(c);
  const Vec3 from =
      (held - reference_place(body, block_of(s, other), facet_of(s, other).cell, middle)) /
      body.cell_size;
  const FaceContact old = c;
  begin(s, c, other, {float(from[0]), float(from[1]), float(from[2])}, dt);
  c.stiffness = old.stiffness;  // the same spring, unless substeps cannot follow
  soften(s, c, dt);
  c.touching = give_way(s, c, limit) && c.holds();
}

/// Puts the place held by a contact that does not touch on the other face, below the facet, or,
/// where faces are in one another from the start, where there is no force.
bool aim(const MpmState& s, FaceContact& c, const Seen& seen) {
  const Facet& facet = facet_of(s, c.other);
  const float lift = std::min(0.0f, seen.depth);
  float place[3];
  for (int a = 0; a < 3; ++a) place[a] = seen.place[a] + lift * facet.normal[a];
  hold_at(c, place);
  measure_apart(s, c);
  c.begun = std::max(kRough, seen.depth);
  return dot(c.apart, c.normal) >= 0 || give_way(s, c, 0);
}

/// Puts the place held by a contact that touches onto the face if it got above it, and back up
/// towards the face if it sank below where the contact began.
void settle(const MpmState& s, FaceContact& c, double dt) {
  const Facet& facet = facet_of(s, c.other);
  float lift = 0;
  for (int a = 0; a < 3; ++a) lift -= (c.hold[a] - facet.center[a]) * facet.normal[a];
  if (lift > 0) {
    lift = std::max(0.0f, lift - c.begun) *
           (1 - static_cast<float>(std::exp(-s.faces.since_look / kSettle)));
  } else {
    lift = std::min(0.0f, lift + 0.5f * kRough);
  }
  soften(s, c, dt);
  if (lift == 0) return;
  float place[3];
  for (int a = 0; a < 3; ++a) place[a] = c.hold[a] + lift * facet.normal[a];
  hold_at(c, place);
  measure_apart(s, c);
}

}  // namespace

float look(MpmState& s, int i, double dt) {
  FaceContacts& faces = s.faces;
  FaceContact& c = faces.all[i];
  const std::int32_t other = choose_other(s, i), before = c.other;
  if (other < 0) {
    c.other = -1;
    c.touching = false;
    return 0;
  }
  const Seen seen = seen_by(s, faces.motion[c.facet], other);
  c.depth = seen.depth;
  if (other == before) {
    take_normal(s, c);
  } else if (c.touching && body_of(s, before).first_point == body_of(s, other).first_point) {
    go_on(s, c, other, place_held(s, c), dt);
  } else {
    begin(s, c, other, seen.place, dt);
  }
  if (c.touching) {
    settle(s, c, dt);
  } else if (!aim(s, c, seen)) {
    c.other = -1;
    return 0;
  }
  const FacetMotion &f = faces.motion[c.facet], &o = faces.motion[other];
  const float v[3] = {f.v[0] - o.v[0], f.v[1] - o.v[1], f.v[2] - o.v[2]};
  return std::sqrt(dot(v, v));
}

bool take_up(MpmState& s, int i, const KeptContact& kept, double dt) {
  FaceContact& c = s.faces.all[i];
  c.touching = true;
  c.depth = kept.depth;
  const std::int32_t other = choose_other(s, i);
  c.touching = false;
  if (other < 0 || block_of(s, other).body != kept.other_body) return false;
  c.stiffness = kept.stiffness;
  std::copy(kept.apart, kept.apart + 3, c.apart);
  c.begun = kept.begun;
  go_on(s, c, other, kept.hold, dt);
  return c.touching;
}

}  // namespace tissue_sim
