#include "mls/node_contact.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "mls/face_substep.h"
#include "mls/faces.h"
#include "mls/near_nodes.h"

namespace tissue_sim {
namespace {

constexpr double kMostSkin = 2;          // [edges]
constexpr double kFasterThanSeen = 1.5;  // than when that was seen last
constexpr int kActive = 16;              // substeps for which those that may touch are listed ...
constexpr float kActiveSkin = 0.125f;    // ... with room for each, besides its speed [edges]
constexpr int kMostSubsteps = 200;       // until it is seen again how far nodes moved
constexpr int kFewestSubsteps = 4;       // else they are looked for at once

/// Of node j from node i as they are, into `d`; squared.
float distance2(const MlsState& s, std::int32_t i, std::int32_t j, float (&d)[3]) {
  float d2 = 0;
  for (int a = 0; a < 3; ++a) {
    d[a] = (s.place[4 * j + a] - s.place[4 * i + a]) + (s.u[4 * j + a] - s.u[4 * i + a]);
    d2 += d[a] * d[a];
  }
  return d2;
}

/// Substeps for which the list lasts, until a node has moved by its skin.
struct Lasts {
  int meant;  ///< where each goes on as it does
  int least;  ///< where each is pushed to the speed of the fastest, node or tool
};

Lasts lasts(const MlsState& s, float dt, double fastest) {
  const MlsNodeContacts& contacts = s.node_contacts;
  double least = kMostSubsteps, least_left = 1e30;
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
    if (!(left > least_left)) least_left = left;
    if (!(v2 <= fastest * fastest)) fastest = std::sqrt(v2);
  }
  const double most = kFasterThanSeen * fastest * dt;
  const double pushed = least_left > most * least ? least : least_left / most;
  return {static_cast<int>(std::max(0.0, least)), static_cast<int>(std::max(0.0, pushed))};
}

/// How far a node may move until the list is void: those that are fast, farther. Two nodes that do
/// not touch cost less than two faces.
float skin_of(const MlsState& s, std::int32_t i, float dt) {
  const bool faces = touches_by_faces(s);
  const double least = faces ? 0.25 : 0.5;  // [edges]
  const int meant_for = faces ? 24 : 60;    // substeps
  const double edge = s.edge[i], meant = meant_for * kFasterThanSeen * s.velocity(i).norm() * dt;
  return static_cast<float>(std::max(least * edge, std::min(kMostSkin * edge, meant)));
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

bool update_node_contacts(MlsState& s, const std::vector<std::int32_t>& piece, float dt,
                          double fastest) {
  MlsNodeContacts& contacts = s.node_contacts;
  if (contacts.until_look-- > 0) return false;
  if (!contacts.u_found.empty() && !contacts.begin.empty()) {
    const Lasts still = lasts(s, dt, fastest);
    contacts.until_look = still.least;
    if (still.meant >= kFewestSubsteps) return false;
  }
  find_node_contacts(s, piece, dt);
  contacts.until_look = lasts(s, dt, fastest).least;
  return true;
}

void number_node_contacts(MlsState& s) {
  MlsNodeContacts& contacts = s.node_contacts;
  contacts.pairs.made = false;
  contacts.active = {};
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

void list_active(MlsState& s, float dt) {
  const MlsNodeContacts& contacts = s.node_contacts;
  MlsActive& active = s.node_contacts.active;
  if (touches_by_faces(s) || contacts.begin.empty()) return;
  if (!active.begin.empty() && active.left-- > 0) return;
  active.left = kActive - 1;
  active.pairs.clear();
  active.begin.assign(s.chunks() + 1, 0);
  const float passes = kActive * static_cast<float>(kFasterThanSeen) * dt;
  const auto speed = [&](std::int32_t i) { return static_cast<float>(s.velocity(i).norm()); };
  for (std::int32_t i = 0; i < s.count(); ++i) {
    for (std::int32_t c = contacts.begin[i]; c < contacts.begin[i + 1]; ++c) {
      const std::int32_t j = contacts.other[c];
      if (j < i) continue;
      float d[3];
      const float reach =
          contacts.rest[c] + kActiveSkin * (s.edge[i] + s.edge[j]) + passes * (speed(i) + speed(j));
      if (distance2(s, i, j, d) > reach * reach) continue;
      active.pairs.push_back({i, j, contacts.rest[c]});
      ++active.begin[i / kMlsChunk + 1];
      ++active.begin[j / kMlsChunk + 1];
    }
  }
  std::partial_sum(active.begin.begin(), active.begin.end(), active.begin.begin());
  active.entries.resize(2 * active.pairs.size());
  active.push.assign(4 * active.pairs.size(), 0.0f);
  std::vector<std::int32_t> next(active.begin.begin(), active.begin.end() - 1);
  for (std::size_t k = 0; k < active.pairs.size(); ++k) {
    for (const std::int32_t i : {active.pairs[k].low, active.pairs[k].high}) {
      active.entries[next[i / kMlsChunk]++] = {i, static_cast<std::int32_t>(k)};
    }
  }
}

void push_active(MlsState& s, int pair) {
  MlsActive& active = s.node_contacts.active;
  const std::int32_t i = active.pairs[pair].low, j = active.pairs[pair].high;
  float* out = &active.push[4 * static_cast<std::size_t>(pair)];
  float d[3];
  const float d2 = distance2(s, i, j, d), rest = active.pairs[pair].rest;
  out[3] = d2 < rest * rest ? 1.0f : 0.0f;
  if (out[3] == 0) return;
  const float distance = std::max(std::sqrt(d2), 1e-12f);
  float approach = 0;
  for (int a = 0; a < 3; ++a) approach += (s.v[4 * j + a] - s.v[4 * i + a]) * d[a];
  approach /= -distance;
  const ContactSpring own = node_spring(s, i), other = node_spring(s, j);
  const float k = own.stiffness * other.stiffness / (own.stiffness + other.stiffness);
  const float c_both = own.damping * other.damping / (own.damping + other.damping);
  const float push = std::max(0.0f, k * (rest - distance) + c_both * approach);
  for (int a = 0; a < 3; ++a) out[a] = push * d[a] / distance;
}

void add_node_contact(const MlsState& s, int chunk, float* force) {
  const MlsNodeContacts& contacts = s.node_contacts;
  const int first = chunk * kMlsChunk, last = std::min(s.count(), first + kMlsChunk);
  if (touches_by_faces(s)) {
    for (std::int32_t i = first; i < last && contacts.in_chunk[chunk] != 0; ++i) {
      const std::int32_t k = contacts.at[i];
      for (int a = 0; a < 3 && k >= 0; ++a) force[4 * (i - first) + a] += contacts.force[4 * k + a];
    }
    return;
  }
  const MlsActive& active = contacts.active;
  for (std::int32_t e = active.begin[chunk]; e < active.begin[chunk + 1]; ++e) {
    const MlsActive::Entry entry = active.entries[e];
    const float* push = &active.push[4 * static_cast<std::size_t>(entry.pair)];
    if (push[3] == 0) continue;
    const float sign = entry.node == active.pairs[entry.pair].high ? 1.0f : -1.0f;
    for (int a = 0; a < 3; ++a) force[4 * (entry.node - first) + a] += sign * push[a];
  }
}

}  // namespace tissue_sim
