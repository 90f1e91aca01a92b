#include "mls/node_contact.h"

#include <algorithm>
#include <cmath>

#include "geometry/near_grid.h"
#include "material/laws.h"
#include "mls/faces.h"

namespace tissue_sim {
namespace {

constexpr double kFar = 2.5;  // reference distance from which a piece may touch itself [edges]
constexpr double kLeastSkin = 0.25, kMostSkin = 2;  // [edges]
constexpr double kFasterThanSeen = 1.5;             // than when that was seen last
constexpr int kMeant = 24;                          // substeps that a skin is meant for
constexpr int kMostSubsteps = 200;                  // until it is seen again how far nodes moved
constexpr int kFewestSubsteps = 4;                  // else they are looked for at once

bool may_touch(const MlsState& s, const std::vector<std::int32_t>& piece, std::int32_t i,
               std::int32_t j) {
  if (piece[i] != piece[j]) return true;
  const double far = kFar * 0.5 * (s.edge[i] + s.edge[j]);
  if ((s.nodes.place[i] - s.nodes.place[j]).squaredNorm() > far * far) return true;
  if (s.cut[i] == 0 || s.cut[j] == 0) return false;
  const std::int32_t e = s.pairs.find(i, j);
  return e >= 0 && s.pairs.crossed[e] != 0;
}

/// Substeps for which the list lasts at least, until a node has moved by its skin.
int lasts(const MlsState& s, float dt) {
  const MlsNodeContacts& contacts = s.node_contacts;
  double least = kMostSubsteps;
  std::size_t k = 0;
  for (std::int32_t i = 0; i < s.count(); ++i) {
    if (s.outer[i] == 0) continue;
    double d2 = 0, v2 = 0;
    for (int a = 0; a < 3; ++a) {
      const double d = static_cast<double>(s.u[4 * i + a]) - contacts.u_found[3 * k + a];
      d2 += d * d;
      v2 += static_cast<double>(s.v[4 * i + a]) * s.v[4 * i + a];
    }
    const double left = contacts.skin[k++] - std::sqrt(d2);
    const double step = kFasterThanSeen * std::sqrt(v2) * dt;
    if (!(left > step * least)) least = step > 0 ? left / step : 0;
  }
  return static_cast<int>(std::max(0.0, least));
}

/// How far a node may move until the list is void: those that are fast, farther.
float skin_of(const MlsState& s, std::int32_t i, float dt) {
  const double edge = s.edge[i], meant = kMeant * kFasterThanSeen * s.velocity(i).norm() * dt;
  return static_cast<float>(std::max(kLeastSkin * edge, std::min(kMostSkin * edge, meant)));
}

/// What is found goes to both: it was looked for from the one with the larger skin.
/// Numbers among those that may touch become those of nodes.
using Found = std::vector<std::vector<std::int32_t>>;
Found both_ways(const Found& of, const std::vector<std::int32_t>& outer) {
  Found all(outer.size());
  for (std::size_t k = 0; k < outer.size(); ++k) {
    for (const std::int32_t other : of[k]) {
      all[k].push_back(outer[other]);
      all[other].push_back(outer[k]);
    }
  }
  for (auto& some : all) std::sort(some.begin(), some.end());
  return all;
}

const float* face_of(const MlsState& s, std::int32_t i) { return &s.face[4 * i]; }

MlsContactSide side_of(const MlsState& s, std::int32_t i) {
  const MlsNodeContacts& contacts = s.node_contacts;
  return {&s.place[4 * i],   &s.u[4 * i], face_of(s, i),     &contacts.face[contacts.at[i]],
          node_spring(s, i), s.edge[i],   s.root_friction[i]};
}

/// From node i to node j [m].
void way(const MlsState& s, std::int32_t i, std::int32_t j, float (&d)[3]) {
  for (int a = 0; a < 3; ++a) {
    d[a] = (s.place[4 * j + a] - s.place[4 * i + a]) + (s.u[4 * j + a] - s.u[4 * i + a]);
  }
}

/// Takes force (x) M^-1 arm from Q of a node.
void take_couple(MlsState& s, std::int32_t i, const float (&couple)[9]) {
  float m[6], Q[9];
  for (int k = 0; k < 6; ++k) m[k] = s.inverse_moment[k][i];
  times_symmetric(couple, m, Q);
  for (int a = 0; a < 3; ++a) {
    for (int k = 0; k < 3; ++k) {
      const float q = Q[3 * a + k];
      if (s.lanes.any_slots) s.lanes.row(kMlsStressRow + 3 * a + k)[i] -= q;
      if (s.lanes.any_entries) s.stress[16 * static_cast<std::size_t>(i) + 4 * k + a] -= q;
    }
  }
}

void find_node_contacts(MlsState& s, const std::vector<std::int32_t>& piece, float dt) {
  MlsNodeContacts& contacts = s.node_contacts;
  std::vector<std::int32_t> outer;
  std::vector<Vec3> places;
  double edge = 0, depth = 0;  // of the largest
  for (std::int32_t i = 0; i < s.count(); ++i) {
    if (s.outer[i] == 0) continue;
    outer.push_back(i);
    places.push_back(s.position(i));
    edge = std::max<double>(edge, s.edge[i]);
    depth = std::max<double>(depth, s.face[4 * i + 3]);
  }
  const bool faces = touches_by_faces(s);
  const double widest =
      faces ? std::sqrt(4 * depth * depth + std::pow(mls_contact::kAside * edge, 2)) : edge;
  const MlsNodeContacts before = std::move(contacts);
  contacts = {};
  contacts.begin.assign(s.count() + 1, 0);
  number_node_contacts(s);
  if (outer.empty()) return;
  const float first_gap = before.u_found.empty() ? kMlsFresh : kMlsApart;
  for (const std::int32_t i : outer) {
    contacts.skin.push_back(skin_of(s, i, dt));
    contacts.u_found.insert(contacts.u_found.end(), &s.u[4 * i], &s.u[4 * i] + 3);
  }
  const std::vector<float>& skin = contacts.skin;
  const NearGrid grid(places, widest + 2 * kLeastSkin * edge);
  Found of(outer.size());
  s.cpu->for_each(
      static_cast<int>(outer.size()),
      [&](int k) {
        const std::int32_t i = outer[k];
        const auto look_at = [&](std::int32_t other, double distance2) {
          if (skin[other] > skin[k] || (skin[other] == skin[k] && other <= k)) return;
          const std::int32_t j = outer[other];
          const float mean_edge = 0.5f * (s.edge[i] + s.edge[j]);
          const float reach =
              faces ? std::sqrt(mls_contact::reach2(face_of(s, i), face_of(s, j), mean_edge))
                    : mean_edge;
          const auto distance = static_cast<float>(std::sqrt(distance2));
          if (distance > reach + skin[k] + skin[other] || !may_touch(s, piece, i, j)) return;
          of[k].push_back(other);
        };
        grid.for_each_within(places[k], widest + 2 * skin[k], look_at);
      },
      16);
  of = both_ways(of, outer);
  for (std::size_t k = 0; k < outer.size(); ++k) {
    contacts.begin[outer[k] + 1] = static_cast<std::int32_t>(of[k].size());
  }
  for (std::int32_t i = 0; i < s.count(); ++i) contacts.begin[i + 1] += contacts.begin[i];
  for (std::size_t k = 0; k < outer.size(); ++k) {
    auto known = before.begin.empty() ? 0 : before.begin[outer[k]];
    const auto last = before.begin.empty() ? 0 : before.begin[outer[k] + 1];
    for (const std::int32_t other : of[k]) {  // both by number
      while (known < last && before.other[known] < other) ++known;
      contacts.other.push_back(other);
      const bool was = known < last && before.other[known] == other;
      if (faces) {
        contacts.slip.push_back(was ? before.slip[known] : MlsSlip{{}, {}, {}, first_gap, 0});
        continue;
      }
      // One edge, or less where they were nearer when they were found: a fresh cut is free of
      // stress.
      const float mean_edge = 0.5f * (s.edge[outer[k]] + s.edge[other]);
      const float rest = std::min(
          mean_edge, static_cast<float>((s.position(outer[k]) - s.position(other)).norm()));
      contacts.rest.push_back(was ? std::max(rest, before.rest[known]) : rest);
    }
  }
  number_node_contacts(s);
}

}  // namespace

bool update_node_contacts(MlsState& s, const std::vector<std::int32_t>& piece, float dt) {
  MlsNodeContacts& contacts = s.node_contacts;
  if (contacts.until_look-- > 0) return false;
  if (!contacts.u_found.empty() && !contacts.begin.empty()) {
    contacts.until_look = lasts(s, dt);
    if (contacts.until_look >= kFewestSubsteps) return false;
  }
  find_node_contacts(s, piece, dt);
  contacts.until_look = lasts(s, dt);
  return true;
}

void number_node_contacts(MlsState& s) {
  MlsNodeContacts& contacts = s.node_contacts;
  contacts.node.clear();
  contacts.at.assign(s.count(), -1);
  contacts.in_chunk.assign(s.chunks(), 0);
  const bool any = touches_by_faces(s) && !contacts.begin.empty();
  for (std::int32_t i = 0; i < s.count() && any; ++i) {
    if (contacts.begin[i] == contacts.begin[i + 1]) continue;
    contacts.at[i] = static_cast<std::int32_t>(contacts.node.size());
    contacts.node.push_back(i);
    contacts.in_chunk[i / kMlsChunk] = 1;
  }
  const std::size_t count = contacts.node.size();
  if (count == 0) return;
  contacts.knows.resize(count);
  s.cpu->for_each(
      static_cast<int>(count), [&](int k) { contacts.knows[k] = knows_face(s, contacts.node[k]); },
      64);
  contacts.face.resize(count);
  contacts.force.assign(4 * count, 0.0f);
  s.deformation.resize(9 * static_cast<std::size_t>(s.chunks()) * kMlsChunk);
}

void find_contact_face(MlsState& s, int k) {
  MlsNodeContacts& contacts = s.node_contacts;
  const std::int32_t i = contacts.node[k];
  float F[9];
  for (int c = 0; c < 9; ++c) {
    F[c] = s.deformation[(9 * static_cast<std::size_t>(i / kMlsChunk) + c) * kMlsChunk +
                         i % kMlsChunk];
  }
  MlsContactFace& face = contacts.face[k];
  set_mls_contact_face(F, face_of(s, i), contacts.knows[k], face);
  float sum = 0;
  for (std::int32_t c = contacts.begin[i]; c < contacts.begin[i + 1]; ++c) {
    const std::int32_t j = contacts.other[c];
    float d[3];
    way(s, i, j, d);
    sum += mls_contact_weight(d, face_of(s, i), face_of(s, j), 0.5f * (s.edge[i] + s.edge[j]));
  }
  face.weights = std::max(1.0f, sum);
}

void push_node(MlsState& s, int k) {
  MlsNodeContacts& contacts = s.node_contacts;
  const std::int32_t i = contacts.node[k];
  const MlsContactSide own = side_of(s, i);
  float sum[3] = {}, couple[9] = {};
  bool any = false;
  for (std::int32_t c = contacts.begin[i]; c < contacts.begin[i + 1]; ++c) {
    const std::int32_t j = contacts.other[c];
    const MlsContactSide other = side_of(s, j);
    float force[3], at[3];
    if (!(i < j ? touch_mls_faces(own, other, s.dt, contacts.slip[c], force, at)
                : touch_mls_faces(other, own, s.dt, contacts.slip[c], force, at))) {
      continue;
    }
    any = true;
    float d[3] = {};
    if (i > j) way(s, j, i, d);
    const float sign = i < j ? 1.0f : -1.0f;
    float arm[3];  // in reference space
    for (int a = 0; a < 3; ++a) at[a] -= d[a];
    for (int a = 0; a < 3; ++a) arm[a] = mls_contact::dot(own.of->inverse + 3 * a, at);
    for (int a = 0; a < 3; ++a) {
      force[a] *= sign;
      sum[a] += force[a];
      for (int b = 0; b < 3; ++b) couple[3 * a + b] += force[a] * arm[b];
    }
  }
  for (int a = 0; a < 3; ++a) contacts.force[4 * k + a] = sum[a];
  if (any && own.of->couples > 0) take_couple(s, i, couple);
}

void add_node_contact(const MlsState& s, std::int32_t i, float* force) {
  const MlsNodeContacts& contacts = s.node_contacts;
  if (touches_by_faces(s)) {
    const std::int32_t k = contacts.at[i];
    for (int a = 0; a < 3 && k >= 0; ++a) force[a] += contacts.force[4 * k + a];
    return;
  }
  for (std::int32_t c = contacts.begin[i]; c < contacts.begin[i + 1]; ++c) {
    const std::int32_t j = contacts.other[c];
    float d[3], d2 = 0;
    for (int a = 0; a < 3; ++a) {
      d[a] = (s.place[4 * j + a] - s.place[4 * i + a]) + (s.u[4 * j + a] - s.u[4 * i + a]);
      d2 += d[a] * d[a];
    }
    const float rest = contacts.rest[c];
    if (d2 >= rest * rest) continue;
    const float distance = std::max(std::sqrt(d2), 1e-12f);
    float approach = 0;
    for (int a = 0; a < 3; ++a) approach += (s.v[4 * j + a] - s.v[4 * i + a]) * d[a];
    approach /= -distance;
    const ContactSpring own = node_spring(s, i), other = node_spring(s, j);
    const float k = own.stiffness * other.stiffness / (own.stiffness + other.stiffness);
    const float c_both = own.damping * other.damping / (own.damping + other.damping);
    const float push = std::max(0.0f, k * (rest - distance) + c_both * approach);
    for (int a = 0; a < 3; ++a) force[a] -= push * d[a] / distance;
  }
}

}  // namespace tissue_sim
