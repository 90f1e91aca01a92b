#include <algorithm>
#include <cmath>

#include "contact/collider.h"
#include "contact/face_places.h"
#include "contact/facet_pairs.h"
#include "cutting/bonds.h"
#include "fragments/pieces.h"

namespace tissue_sim {
namespace {

// Lengths in cells. Points are half a cell apart, so a slice of one layer is that thick: a facet
// that deep in another may be the back of its own slice, and only a contact that began while the
// faces were apart goes deeper than kDeepest.
constexpr float kSearch = 0.75f;  ///< half size of the box in which a facet looks for others
constexpr float kNear = 0.25f;    ///< gap up to which a contact is worked on in each substep
constexpr float kDeepest = 0.375f;
constexpr float kDeeper = 0.25f;    ///< by how much more it may be in another that takes over
constexpr float kBeyond = 0.25f;    ///< how far beyond its edge a facet still catches
constexpr float kFarthest = 2;      ///< from the centre of the facet that catches it
constexpr float kStay = 0.1f;       ///< by how much another facet must fit better to take over
constexpr float kNothing = 1e-3f;   ///< share of a spring's energy at `sudden`
constexpr float kMoved = 0.1f;      ///< motion between two looks
constexpr int kLongest = 16;        ///< substeps between two looks
constexpr float kLargestReach = 4;  ///< of what moves fast; the next search follows sooner
constexpr double kHorizon = 1.0 / 60;  ///< between two searches [s]
constexpr float kRough = 0.1f;         ///< by how much fitted faces may be off
constexpr double kSettle = 0.02;  ///< in which what began deeper than that gets its spring back [s]

FacetMotion motion_of(const MpmState& s, std::int32_t facet) {
  return facet_motion(body_of(s, facet), block_of(s, facet), facet_of(s, facet), s.nodes);
}

Vec3 place_held(const MpmState& s, const FaceContact& c) {
  return reference_place(body_of(s, c.other), block_of(s, c.other), facet_of(s, c.other).cell,
                         c.hold);
}

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
    if (seen.depth > deepest || seen.depth < -kSearch - kNear || !(beyond < best)) continue;
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
  const Material &m = own.material, &n = body.material;
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
  c.sudden = static_cast<float>(kMoved * own.cell_size);
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

/// Looks anew at contact `i`: which facet, its normal, and the place held. Returns how fast the two
/// move against one another [m/s], 0 if there is none.
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

/// Lists the contacts that may touch before the next look, and for each block those it is part of.
void list_active(MpmState& s) {
  FaceContacts& faces = s.faces;
  faces.active.clear();
  faces.first_of_block.assign(s.blocks.all.size() + 1, 0);
  for (std::size_t i = 0; i < faces.all.size(); ++i) {
    const FaceContact& c = faces.all[i];
    if (c.other < 0 || (!c.touching && c.depth < -kNear)) continue;
    faces.active.push_back(static_cast<std::int32_t>(i));
    ++faces.first_of_block[faces.block_of[c.facet] + 1];
    ++faces.first_of_block[faces.block_of[c.other] + 1];
  }
  for (std::size_t b = 1; b < faces.first_of_block.size(); ++b) {
    faces.first_of_block[b] += faces.first_of_block[b - 1];
  }
  faces.of_block.resize(2 * faces.active.size());
  std::vector<std::int32_t> next(faces.first_of_block.begin(), faces.first_of_block.end() - 1);
  for (const std::int32_t i : faces.active) {
    faces.of_block[next[faces.block_of[faces.all[i].facet]]++] = 2 * i;
    faces.of_block[next[faces.block_of[faces.all[i].other]]++] = 2 * i + 1;
  }
}

void look_at_all(MpmState& s, double dt, bool moved) {
  FaceContacts& faces = s.faces;
  if (moved) {
    s.cpu->for_each(
        static_cast<int>(faces.involved.size()),
        [&](int i) { faces.motion[faces.involved[i]] = motion_of(s, faces.involved[i]); }, 32);
  }
  const int count = static_cast<int>(faces.all.size());
  std::vector<float> speed(count);
  s.cpu->for_each(
      count, [&](int i) { speed[i] = look(s, i, dt); }, 32);
  float fastest = 0;
  for (const float v : speed) fastest = std::max(fastest, v);
  list_active(s);
  faces.until_look = std::min(kLongest * dt, kMoved * s.scene.cell_size / std::max(fastest, 1e-6f));
  faces.since_look = 0;
}

/// Whether bonds lead from a point to another close by, never away from it: then no cut parts them.
bool are_bound(const MpmState& s, std::int32_t p, std::int32_t q) {
  constexpr int kFar = 4;  // points
  const Points::Site &from = s.points.site[p], &to = s.points.site[q];
  const LatticeBody& body = s.bodies[from.body];
  const int d[3] = {to.x - from.x, to.y - from.y, to.z - from.z};
  int bond[3], step[3], length[3];
  for (int a = 0; a < 3; ++a) {
    length[a] = std::abs(d[a]);
    step[a] = d[a] < 0 ? -1 : 1;
    bond[a] = d[a] < 0 ? kForwardBond - 1 - a : kForwardBond + a;
    if (length[a] > kFar) return false;
  }
  bool reached[kFar + 1][kFar + 1][kFar + 1] = {};
  reached[0][0][0] = true;
  for (int z = 0; z <= length[2]; ++z) {
    for (int y = 0; y <= length[1]; ++y) {
      for (int x = 0; x <= length[0]; ++x) {
        if (!reached[z][y][x]) continue;
        const std::int32_t at =
            body.point(from.x + step[0] * x, from.y + step[1] * y, from.z + step[2] * z);
        const unsigned bonds = s.points.bonds[at];
        if (x < length[0] && (bonds >> bond[0] & 1) != 0) reached[z][y][x + 1] = true;
        if (y < length[1] && (bonds >> bond[1] & 1) != 0) reached[z][y + 1][x] = true;
        if (z < length[2] && (bonds >> bond[2] & 1) != 0) reached[z + 1][y][x] = true;
      }
    }
  }
  return reached[length[2]][length[1]][length[0]];
}

/// Whether two facets belong to the same bit of a piece, as at an edge of it or on the two sides of
/// a slice.
bool are_one(const MpmState& s, const Pieces& pieces, std::int32_t a, std::int32_t b) {
  const std::int32_t p = facet_of(s, a).point, q = facet_of(s, b).point;
  return pieces.of_point[p] == pieces.of_point[q] && are_bound(s, p, q);
}

/// Finds the facets that may meet until the next search, and when that is.
void search(MpmState& s, const Pieces& pieces) {
  FaceContacts& faces = s.faces;
  const int block_count = static_cast<int>(s.blocks.all.size());
  const auto facet_count = static_cast<std::int32_t>(faces.block_of.size());
  s.cpu->for_each(block_count, [&](int b) {
    for (std::int32_t f = faces.first_facet[b]; f < faces.first_facet[b + 1]; ++f) {
      faces.motion[f] = motion_of(s, f);
    }
  });
  Vec3 mean = Vec3::Zero();
  for (const FacetMotion& f : faces.motion) mean += Vec3(f.v[0], f.v[1], f.v[2]);
  mean /= std::max(1, facet_count);
  const auto cell = static_cast<float>(s.scene.cell_size);
  std::vector<float> reach(facet_count);
  double fastest = 0;
  for (std::int32_t f = 0; f < facet_count; ++f) {
    const float* v = faces.motion[f].v;
    reach[f] = static_cast<float>((Vec3(v[0], v[1], v[2]) - mean).norm());
    fastest = std::max(fastest, static_cast<double>(reach[f]));
  }
  if (!(fastest < 1e4)) {  // out of control, as the end of the frame will say
    faces.all.clear();
    faces.until_search = kHorizon;
    return;
  }
  const double horizon = std::min(kHorizon, kLargestReach * cell / (1.5 * fastest + 1e-9));
  for (float& r : reach) r = kSearch * cell + static_cast<float>(1.5 * horizon) * r;
  std::vector<int> size(pieces.next_id, 0);
  for (const Fragment& f : pieces.all) size[f.id] = f.point_count;
  auto pairs = facing_pairs(faces.motion, reach, 3 * cell, *s.cpu);
  const auto one = [&](const auto& pair) { return are_one(s, pieces, pair.first, pair.second); };
  pairs.erase(std::remove_if(pairs.begin(), pairs.end(), one), pairs.end());
  // Of two pieces the smaller one's facets touch the other's face; of one, both.
  const auto touches = [&](std::int32_t a, std::int32_t b) {
    const int p = pieces.of_point[facet_of(s, a).point], q = pieces.of_point[facet_of(s, b).point];
    if (p == q) return true;
    const int m = size[p], n = size[q];
    return m != n ? m < n : p > q;
  };
  std::vector<std::int32_t> count(facet_count, 0), contact(facet_count, -1);
  std::vector<bool> involved(facet_count, false);
  faces.involved.clear();
  for (const auto& [a, b] : pairs) {
    if (touches(a, b)) ++count[a];
    if (touches(b, a)) ++count[b];
    involved[a] = involved[b] = true;
  }
  for (const FaceContact& c : faces.all) {
    if (c.other >= 0) involved[c.other] = true;
  }
  for (std::int32_t f = 0; f < facet_count; ++f) {
    if (involved[f]) faces.involved.push_back(f);
  }
  for (std::size_t i = 0; i < faces.all.size(); ++i) {
    contact[faces.all[i].facet] = static_cast<std::int32_t>(i);
  }
  std::vector<FaceContact> all;
  faces.first_near.assign(1, 0);
  for (std::int32_t f = 0; f < facet_count; ++f) {
    if (count[f] == 0) continue;
    if (contact[f] >= 0) {
      all.push_back(faces.all[contact[f]]);
    } else {
      all.emplace_back();
      all.back().facet = f;
      all.back().nodes = CellNodes(block_of(s, f), facet_of(s, f).cell);
      all.back().weights = AxisWeights(facet_of(s, f).center);
    }
    contact[f] = static_cast<std::int32_t>(all.size() - 1);
    faces.first_near.push_back(faces.first_near.back() + count[f]);
  }
  faces.all = std::move(all);
  faces.near.resize(faces.first_near.back());
  std::vector<std::int32_t> next(faces.first_near.begin(), faces.first_near.end() - 1);
  for (const auto& [a, b] : pairs) {
    if (touches(a, b)) faces.near[next[contact[a]]++] = b;
    if (touches(b, a)) faces.near[next[contact[b]]++] = a;
  }
  faces.until_search = horizon;
}

/// Takes up what touched before blocks were made anew.
void take_up(MpmState& s, double dt) {
  FaceContacts& faces = s.faces;
  for (std::size_t i = 0; i < faces.all.size() && !faces.kept.empty(); ++i) {
    FaceContact& c = faces.all[i];
    const Facet& facet = facet_of(s, c.facet);
    const auto kept = std::lower_bound(
        faces.kept.begin(), faces.kept.end(), facet, [](const KeptContact& k, const Facet& f) {
          return k.point != f.point ? k.point < f.point : k.direction < f.direction;
        });
    if (kept == faces.kept.end() || kept->point != facet.point ||
        kept->direction != facet.direction) {
      continue;
    }
    c.touching = true;
    c.depth = kept->depth;
    const std::int32_t other = choose_other(s, static_cast<int>(i));
    c.touching = false;
    if (other < 0 || block_of(s, other).body != kept->other_body) continue;
    c.stiffness = kept->stiffness;
    std::copy(kept->apart, kept->apart + 3, c.apart);
    c.begun = kept->begun;
    go_on(s, c, other, kept->hold, dt);
  }
  faces.kept.clear();
}

}  // namespace

int find_face_contacts(MpmState& s, const Pieces& pieces, double dt, int at_most) {
  FaceContacts& faces = s.faces;
  const bool searched = faces.until_search <= 0;
  if (searched) {
    search(s, pieces);
    take_up(s, dt);
  }
  if (!faces.all.empty() && (searched || faces.until_look <= 0)) look_at_all(s, dt, !searched);
  if (faces.all.empty()) faces.active.clear();
  int substeps = 0;
  do {
    faces.until_search -= dt;
    faces.until_look -= dt;
    faces.since_look += dt;
    ++substeps;
  } while (substeps < at_most && faces.until_search > 0 &&
           (faces.all.empty() || faces.until_look > 0));
  return substeps;
}

void keep_face_contacts(MpmState& s) {
  FaceContacts& faces = s.faces;
  faces.kept.clear();
  for (const FaceContact& c : faces.all) {
    if (c.other < 0 || !c.touching) continue;
    const Facet& facet = facet_of(s, c.facet);
    faces.kept.push_back({facet.point,
                          facet.direction,
                          block_of(s, c.other).body,
                          place_held(s, c),
                          c.depth,
                          c.begun,
                          c.stiffness,
                          {c.apart[0], c.apart[1], c.apart[2]}});
  }
  std::sort(faces.kept.begin(), faces.kept.end(), [](const KeptContact& a, const KeptContact& b) {
    return a.point != b.point ? a.point < b.point : a.direction < b.direction;
  });
}

void list_facets(MpmState& s) {
  FaceContacts& faces = s.faces;
  faces.first_facet.assign(1, 0);
  faces.block_of.clear();
  for (std::size_t b = 0; b < s.blocks.all.size(); ++b) {
    const std::size_t count = s.blocks.all[b]->facets.size();
    faces.block_of.insert(faces.block_of.end(), count, static_cast<std::int32_t>(b));
    faces.first_facet.push_back(static_cast<std::int32_t>(faces.block_of.size()));
  }
  faces.motion.resize(faces.block_of.size());
  faces.all.clear();
  faces.active.clear();
  faces.until_search = 0;
}

}  // namespace tissue_sim
