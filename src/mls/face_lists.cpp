#include "mls/face_lists.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "mls/face_search.h"
#include "mls/face_substep.h"
#include "mls/faces.h"

namespace tissue_sim {
namespace {

constexpr double kLeastSkin = 0.25, kMostSkin = 2;  // [edges]
constexpr int kMeantFor = 24;                       // substeps
constexpr double kFasterThanSeen = 1.5;             // than when that was seen last
constexpr int kMostSubsteps = 200;                  // until it is seen again how far nodes moved
constexpr int kFewestSubsteps = 4;                  // else they are looked for at once

/// Substeps for which the list lasts, until a node has moved by its skin.
struct Lasts {
  int meant;  ///< where each goes on as it does
  int least;  ///< where each is pushed to the speed of the fastest, node or tool
};

Lasts lasts(const MlsState& s, float dt, double fastest) {
  const MlsFaceContacts& contacts = s.face_contacts;
  double least = kMostSubsteps, least_left = 1e30;
  std::size_t k = 0;
  for (std::int32_t i = 0; i < s.count(); ++i) {
    if (!touches(s, i)) continue;
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

/// How far a node may move until the list is void: those that are fast, farther.
float skin_of(const MlsState& s, std::int32_t i, float dt) {
  const double edge = s.edge[i], meant = kMeantFor * kFasterThanSeen * s.velocity(i).norm() * dt;
  return static_cast<float>(std::max(kLeastSkin * edge, std::min(kMostSkin * edge, meant)));
}

void find_faces(MlsState& s, const std::vector<std::int32_t>& piece, float dt) {
  MlsFaceContacts& contacts = s.face_contacts;
  return_slips(contacts);
  const MlsFaceContacts before = std::move(contacts);
  contacts = {};
  std::vector<std::int32_t> outer;
  for (std::int32_t i = 0; i < s.count(); ++i) {
    if (!touches(s, i)) continue;
    outer.push_back(i);
    contacts.skin.push_back(skin_of(s, i, dt));
    contacts.u_found.insert(contacts.u_found.end(), &s.u[4 * i], &s.u[4 * i] + 3);
  }
  // Each pair goes to both; by number.
  contacts.begin.assign(s.count() + 1, 0);
  const std::vector<MlsNearFaces> near = find_near_faces(s, piece, outer, contacts.skin);
  for (const MlsNearFaces& pair : near) {
    ++contacts.begin[pair.low + 1];
    ++contacts.begin[pair.high + 1];
  }
  std::partial_sum(contacts.begin.begin(), contacts.begin.end(), contacts.begin.begin());
  std::vector<std::int32_t> next(contacts.begin.begin(), contacts.begin.end() - 1);
  contacts.other.resize(2 * near.size());
  for (const MlsNearFaces& pair : near) {
    contacts.other[next[pair.low]++] = pair.high;
    contacts.other[next[pair.high]++] = pair.low;
  }
  const float first_gap = before.u_found.empty() ? kMlsFresh : kMlsApart;
  contacts.slip.assign(contacts.other.size(), MlsSlip{{}, {}, {}, first_gap, 0});
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
      if (was) contacts.slip[c] = before.slip[known];
    }
  }
  number_faces(s);
}

}  // namespace

bool update_face_lists(MlsState& s, const std::vector<std::int32_t>& piece, float dt,
                       double fastest) {
  MlsFaceContacts& contacts = s.face_contacts;
  if (contacts.until_look-- > 0) return false;
  if (!contacts.u_found.empty() && !contacts.begin.empty()) {
    const Lasts still = lasts(s, dt, fastest);
    contacts.until_look = still.least;
    if (still.meant >= kFewestSubsteps) return false;
  }
  find_faces(s, piece, dt);
  contacts.until_look = lasts(s, dt, fastest).least;
  return true;
}

void number_faces(MlsState& s) {
  MlsFaceContacts& contacts = s.face_contacts;
  contacts.pairs.made = false;
  contacts.node.clear();
  contacts.at.assign(s.count(), -1);
  contacts.in_chunk.assign(s.chunks(), 0);
  const bool any = !contacts.begin.empty();
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

void add_face_contact(const MlsState& s, int chunk, float* force) {
  const MlsFaceContacts& contacts = s.face_contacts;
  const int first = chunk * kMlsChunk, last = std::min(s.count(), first + kMlsChunk);
  for (std::int32_t i = first; i < last && contacts.in_chunk[chunk] != 0; ++i) {
    const std::int32_t k = contacts.at[i];
    for (int a = 0; a < 3 && k >= 0; ++a) force[4 * (i - first) + a] += contacts.force[4 * k + a];
  }
}

}  // namespace tissue_sim
