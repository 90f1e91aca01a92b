#include "mls/node_contact.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "mls/face_substep.h"
#include "mls/faces.h"
#include "mls/near_nodes.h"

namespace tissue_sim {
namespace {

constexpr double kLeastSkin = 0.25, kMostSkin = 2;  // [edges]
constexpr double kFasterThanSeen = 1.5;             // than when that was seen last
constexpr int kMeant = 24;                          // substeps that a skin is meant for
constexpr int kMostSubsteps = 200;                  // until it is seen again how far nodes moved
constexpr int kFewestSubsteps = 4;                  // else they are looked for at once

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

void find_node_contacts(MlsState& s, const std::vector<std::int32_t>& piece, float dt) {
  MlsNodeContacts& contacts = s.node_contacts;
  return_slips(contacts);
  const MlsNodeContacts before = std::move(contacts);
  contacts = {};
  std::vector<std::int32_t> outer;
  for (std::int32_t i = 0; i < s.count(); ++i) {
    if (s.outer[i] == 0) continue;
    outer.push_back(i);
    contacts.skin.push_back(skin_of(s, i, dt));
    contacts.u_found.insert(contacts.u_found.end(), &s.u[4 * i], &s.u[4 * i] + 3);
  }
  // Each pair goes to both; by number.
  contacts.begin.assign(s.count() + 1, 0);
  const std::vector<MlsNear> near = find_near_nodes(s, piece, outer, contacts.skin);
  for (const MlsNear& pair : near) {
    ++contacts.begin[pair.low + 1];
    ++contacts.begin[pair.high + 1];
  }
  std::partial_sum(contacts.begin.begin(), contacts.begin.end(), contacts.begin.begin());
  std::vector<std::int32_t> next(contacts.begin.begin(), contacts.begin.end() - 1);
  contacts.other.resize(2 * near.size());
  for (const MlsNear& pair : near) {
    contacts.other[next[pair.low]++] = pair.high;
    contacts.other[next[pair.high]++] = pair.low;
  }
  const bool faces = touches_by_faces(s);
  const float first_gap = before.u_found.empty() ? kMlsFresh : kMlsApart;
  if (faces) contacts.slip.assign(contacts.other.size(), MlsSlip{{}, {}, {}, first_gap, 0});
  if (!faces) contacts.rest.resize(contacts.other.size());
  for (const std::int32_t i : outer) {
    const auto first = contacts.other.begin() + contacts.begin[i],
               last = contacts.other.begin() + contacts.begin[i + 1];
    std::sort(first, last);
    std::int32_t known = before.begin.empty() ? 0 : before.begin[i];
    const std::int32_t known_end = before.begin.empty() ? 0 : before.begin[i + 1];
    for (std::int32_t c = contacts.begin[i]; c < contacts.begin[i + 1]; ++c) {
      const std::int32_t other = contacts.other[c];
      while (known < known_end && before.other[known] < other) ++known;
      const bool was = known < known_end && before.other[known] == other;
      if (faces) {
        if (was) contacts.slip[c] = before.slip[known];
        continue;
      }
      // One edge, or less where they were nearer when they were found: a fresh cut is free of
      // stress.
      const float rest = std::min(0.5f * (s.edge[i] + s.edge[other]),
                                  static_cast<float>((s.position(i) - s.position(other)).norm()));
      contacts.rest[c] = was ? std::max(rest, before.rest[known]) : rest;
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
  contacts.pairs.made = false;
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
