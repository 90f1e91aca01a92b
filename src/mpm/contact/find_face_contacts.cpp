#include <algorithm>
#include <cmath>

#include "fragments/pieces.h"
#include "mpm/contact/face_contact.h"
#include "mpm/contact/face_places.h"

namespace tissue_sim {
namespace {

/// Whether two facets of a piece belong to the same bit of it, as at an edge of it or on the two
/// sides of a slice.
bool are_one(const TouchingTissue& s, std::int32_t a, std::int32_t b) {
  const Points::Site &from = s.points.site[facet_of(s, a).point],
                     &to = s.points.site[facet_of(s, b).point];
  const LatticeBody& body = s.bodies[from.body];
  return are_bound({from.x, from.y, from.z}, {to.x, to.y, to.z},
                   [&](int x, int y, int z) { return s.points.bonds[body.point(x, y, z)]; });
}

Vec3 velocity(const FacetMotion& f) { return {f.v[0], f.v[1], f.v[2]}; }

/// Whether no facet has left its skin since the pairs were listed (Verlet 1967), nor will when it
/// travels on by so much [m]; those that travel less than 0 take no part.
bool pairs_last(const FaceContacts& faces, const std::vector<float>& travel) {
  if (faces.listed.size() != travel.size()) return false;
  Vec3 mean = Vec3::Zero();
  int count = 0;
  const auto moved = [&faces](std::size_t f) {
    const float *x = faces.motion[f].x, *from = faces.listed[f].x;
    return Vec3(x[0] - from[0], x[1] - from[1], x[2] - from[2]);
  };
  for (std::size_t f = 0; f < travel.size(); ++f) {
    if (travel[f] < 0) continue;
    mean += moved(f);
    ++count;
  }
  mean /= std::max(1, count);
  for (std::size_t f = 0; f < travel.size(); ++f) {
    if (travel[f] < 0) continue;
    if ((moved(f) - mean).norm() + travel[f] > faces.listed[f].skin) return false;
  }
  return true;
}

/// How fast facets move against their mean [m/s]; -1 for those that fly and take no part.
std::vector<float> speeds(const TouchingTissue& s, const std::vector<PieceSize>& piece) {
  const FaceContacts& faces = s.faces;
  const std::size_t count = faces.motion.size();
  const double cell = s.scene.cell_size;
  std::vector<float> speed(count, 0);
  SweptBox others;
  std::fill_n(others.min, 3, 1e30f);
  std::fill_n(others.max, 3, -1e30f);
  for (std::size_t f = 0; f < count; ++f) {
    const FacetMotion& m = faces.motion[f];
    const SweptBox box(m, cell);
    if (flies(m, piece[f].points, cell)) {
      speed[f] = -1;
      continue;
    }
    for (int a = 0; a < 3; ++a) {
      others.min[a] = std::min(others.min[a], box.min[a]);
      others.max[a] = std::max(others.max[a], box.max[a]);
    }
  }
  Vec3 mean = Vec3::Zero();
  int involved = 0;
  for (std::size_t f = 0; f < count; ++f) {
    if (speed[f] < 0 && SweptBox(faces.motion[f], cell).meets(others)) speed[f] = 0;
    if (speed[f] < 0) continue;
    mean += velocity(faces.motion[f]);
    ++involved;
  }
  mean /= std::max(1, involved);
  for (std::size_t f = 0; f < count; ++f) {
    if (speed[f] < 0) continue;
    speed[f] = static_cast<float>((velocity(faces.motion[f]) - mean).norm());
  }
  return speed;
}

/// Brings the motion of all facets up to date. Returns the piece of each.
std::vector<PieceSize> move_facets(TouchingTissue& s, const Pieces& pieces) {
  FaceContacts& faces = s.faces;
  std::vector<int> size(pieces.next_id, 0);
  for (const Fragment& f : pieces.all) size[f.id] = f.point_count;
  std::vector<PieceSize> piece(faces.block_of.size());
  s.cpu->for_each(static_cast<int>(s.blocks.all.size()), [&](int b) {
    for (std::int32_t f = faces.first_facet[b]; f < faces.first_facet[b + 1]; ++f) {
      const int id =
          pieces.all.size() == 1 ? pieces.all[0].id : pieces.of_point[facet_of(s, f).point];
      piece[f] = {id, size[id]};
      faces.motion[f] = motion_of(s, f);
    }
  });
  return piece;
}

/// Lists all facets anew. Returns the pairs that may meet while each travels so far [m].
std::vector<FacetPair> pairs_within(TouchingTissue& s, const std::vector<PieceSize>& piece,
                                    const std::vector<float>& travel) {
  FaceContacts& faces = s.faces;
  const std::size_t facet_count = piece.size();
  const auto cell = static_cast<float>(s.scene.cell_size);
  faces.listed.resize(facet_count);
  std::vector<float> reach(facet_count);
  std::vector<std::uint8_t> is_debris(facet_count);
  for (std::size_t f = 0; f < facet_count; ++f) {
    ListedFacet& listed = faces.listed[f];
    std::copy_n(faces.motion[f].x, 3, listed.x);
    listed.skin = travel[f] < 0 ? -1 : travel[f] + kSkin * cell;
    reach[f] = travel[f] < 0 ? 0 : kSearchReach * cell + listed.skin;
    is_debris[f] = piece[f].is_debris() ? 1 : 0;
  }
  auto pairs = facing_pairs(faces.motion, reach, is_debris, faces.first_facet, 6 * cell, *s.cpu);
  std::vector<std::uint8_t> one(pairs.size());
  s.cpu->for_each(
      static_cast<int>(pairs.size()),
      [&](int i) {
        const auto& [a, b] = pairs[i];
        one[i] = piece[a].id == piece[b].id &&
                 (are_back_to_back(faces.motion[a], faces.motion[b], cell) || are_one(s, a, b));
      },
      64);
  std::size_t left = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (one[i] == 0) pairs[left++] = pairs[i];
  }
  pairs.resize(left);
  // What presses stays listed, also where it has turned the other face away.
  for (const FaceContact& c : faces.all) {
    if (c.other < 0 || !c.touching || piece[c.facet].id == piece[c.other].id) continue;
    if (travel[c.facet] < 0 || travel[c.other] < 0) continue;
    const std::pair<std::int32_t, std::int32_t> here = std::minmax(c.facet, c.other);
    if (!std::binary_search(pairs.begin(), pairs.begin() + left, here)) pairs.push_back(here);
  }
  return pairs;
}

/// Makes contacts of the facets in pairs that touch; those that were go on.
void make_contacts(TouchingTissue& s, const std::vector<PieceSize>& piece,
                   const std::vector<FacetPair>& pairs) {
  FaceContacts& faces = s.faces;
  const auto facet_count = static_cast<std::int32_t>(piece.size());
  std::vector<std::int32_t> count(facet_count, 0), contact(facet_count, -1);
  for (const auto& [a, b] : pairs) {
    if (touches(piece[a], piece[b])) ++count[a];
    if (touches(piece[b], piece[a])) ++count[b];
  }
  for (std::size_t i = 0; i < faces.all.size(); ++i) {
    contact[faces.all[i].facet] = static_cast<std::int32_t>(i);
  }
  std::vector<FaceContact> all;
  all.reserve(facet_count - std::count(count.begin(), count.end(), 0));
  faces.first_near.assign(1, 0);
  for (std::int32_t f = 0; f < facet_count; ++f) {
    if (count[f] == 0) continue;
    if (contact[f] >= 0) {
      all.push_back(faces.all[contact[f]]);
    } else {
      all.emplace_back();
      all.back().facet = f;
      find_nodes(s, all.back());
      all.back().looked_at = s.time;
    }
    contact[f] = static_cast<std::int32_t>(all.size() - 1);
    faces.first_near.push_back(faces.first_near.back() + count[f]);
  }
  faces.all = std::move(all);
  faces.near.resize(faces.first_near.back());
  std::vector<std::int32_t> next(faces.first_near.begin(), faces.first_near.end() - 1);
  for (const auto& [a, b] : pairs) {
    if (touches(piece[a], piece[b])) faces.near[next[contact[a]]++] = b;
    if (touches(piece[b], piece[a])) faces.near[next[contact[b]]++] = a;
  }
}

/// Finds the facets that may meet until the next search, and when that is. Returns whether the
/// contacts were listed anew.
bool search(TouchingTissue& s, const Pieces& pieces) {
  FaceContacts& faces = s.faces;
  const std::vector<PieceSize> piece = move_facets(s, pieces);
  std::vector<float> travel = speeds(s, piece);  // until the next search; first in a second
  double fastest = 0;
  bool finite = true;
  for (const float t : travel) {
    fastest = std::max(fastest, static_cast<double>(t));
    finite = finite && t < kOutOfControl;
  }
  if (!finite) {  // as the end of the frame will say
    faces.listed.clear();
    faces.all.clear();
    faces.until_search = kHorizon;
    return false;
  }
  const double horizon = search_horizon(fastest, static_cast<float>(s.scene.cell_size));
  faces.until_search = horizon;
  faces.fastest = fastest_block(s);
  for (float& t : travel) t = t < 0 ? -1 : t * static_cast<float>(kForesight * horizon);
  if (pairs_last(faces, travel)) return false;
  make_contacts(s, piece, pairs_within(s, piece, travel));
  return true;
}

/// Takes up what touched before blocks were made anew.
void take_up_kept(TouchingTissue& s, double dt) {
  FaceContacts& faces = s.faces;
  for (std::size_t i = 0; i < faces.all.size() && !faces.kept.empty(); ++i) {
    const Facet& facet = facet_of(s, faces.all[i].facet);
    const KeptContact* kept =
        find_kept(faces.kept.data(), static_cast<int>(faces.kept.size()), facet);
    if (kept == nullptr) continue;
    ContactFaces contact(s, static_cast<int>(i));
    take_up(contact, faces.all[i], *kept, static_cast<float>(dt));
    faces.all[i].looked_at = kept->looked_at;
  }
  faces.kept.clear();
}

/// Springs were made soft for a shorter substep.
void soften_all(TouchingTissue& s, double dt) {
  for (std::size_t i = 0; i < s.faces.all.size(); ++i) {
    FaceContact& c = s.faces.all[i];
    if (c.other < 0) continue;
    c.soften(ContactFaces(s, static_cast<int>(i)).held_mobility(), static_cast<float>(dt));
  }
}

}  // namespace

void find_face_contacts(TouchingTissue& s, const Pieces& pieces, double dt) {
  FaceContacts& faces = s.faces;
  const bool searched = is_due(faces.until_search, dt);
  if (searched && search(s, pieces)) take_up_kept(s, dt);
  if (!faces.all.empty() && (searched || is_due(faces.until_look, dt))) {
    look_at_due(s, dt, searched);
  }
  if (faces.all.empty()) faces.forget_active();
  if (dt > faces.dt) soften_all(s, dt);
  faces.dt = dt;
  faces.until_search -= dt;
  faces.until_look -= dt;
}

void keep_face_contacts(TouchingTissue& s) {
  FaceContacts& faces = s.faces;
  faces.kept.clear();
  for (const FaceContact& c : faces.all) {
    if (c.other < 0 || !c.touching) continue;
    const Facet& facet = facet_of(s, c.facet);
    const Vec3 held = reference_place(body_of(s, c.other), block_of(s, c.other),
                                      facet_of(s, c.other).cell, c.hold);
    faces.kept.push_back({facet.point,
                          facet.direction,
                          block_of(s, c.other).body,
                          {held[0], held[1], held[2]},
                          c.depth,
                          c.begun,
                          c.stiffness,
                          {c.apart[0], c.apart[1], c.apart[2]},
                          c.looked_at});
  }
  std::sort(faces.kept.begin(), faces.kept.end(), [](const KeptContact& a, const KeptContact& b) {
    return a.is_before(b.point, b.direction);
  });
}

void number_facets(FaceContacts& faces, const Blocks& blocks) {
  faces.first_facet.assign(1, 0);
  faces.block_of.clear();
  for (std::size_t b = 0; b < blocks.all.size(); ++b) {
    const std::size_t count = blocks.all[b]->facets.size();
    faces.block_of.insert(faces.block_of.end(), count, static_cast<std::int32_t>(b));
    faces.first_facet.push_back(static_cast<std::int32_t>(faces.block_of.size()));
  }
}

void list_facets(TouchingTissue& s) {
  FaceContacts& faces = s.faces;
  ++faces.version;
  number_facets(faces, s.blocks);
  faces.motion.clear();  // not to be moved to new room
  faces.motion.resize(faces.block_of.size());
  faces.listed.clear();
  faces.all.clear();
  faces.forget_active();
  faces.until_search = 0;
}

}  // namespace tissue_sim
