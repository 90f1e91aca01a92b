#include "mls/node_contact.h"

#include <algorithm>
#include <cmath>

#include "geometry/near_grid.h"

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

struct Found {
  std::int32_t other;  ///< by number among those that may touch, then of the node
  float rest;
};

/// What is found goes to both: it was looked for from the one with the larger skin.
std::vector<std::vector<Found>> both_ways(std::vector<std::vector<Found>> of,
                                          const std::vector<std::int32_t>& outer) {
  std::vector<std::vector<Found>> all(outer.size());
  for (std::size_t k = 0; k < outer.size(); ++k) {
    for (const Found& f : of[k]) {
      all[k].push_back({outer[f.other], f.rest});
      all[f.other].push_back({outer[k], f.rest});
    }
  }
  for (auto& some : all) {
    std::sort(some.begin(), some.end(),
              [](const Found& a, const Found& b) { return a.other < b.other; });
  }
  return all;
}

void find_node_contacts(MlsState& s, const std::vector<std::int32_t>& piece, float dt) {
  MlsNodeContacts& contacts = s.node_contacts;
  std::vector<std::int32_t> outer;
  std::vector<Vec3> places;
  double widest = 0;
  for (std::int32_t i = 0; i < s.count(); ++i) {
    if (s.outer[i] == 0) continue;
    outer.push_back(i);
    places.push_back(s.position(i));
    widest = std::max<double>(widest, s.edge[i]);
  }
  const MlsNodeContacts before = std::move(contacts);
  contacts = {};
  contacts.begin.assign(s.count() + 1, 0);
  if (outer.empty()) return;
  for (const std::int32_t i : outer) {
    contacts.skin.push_back(skin_of(s, i, dt));
    contacts.u_found.insert(contacts.u_found.end(), &s.u[4 * i], &s.u[4 * i] + 3);
  }
  const std::vector<float>& skin = contacts.skin;
  const NearGrid grid(places, (1 + 2 * kLeastSkin) * widest);
  std::vector<std::vector<Found>> of(outer.size());
  s.cpu->for_each(
      static_cast<int>(outer.size()),
      [&](int k) {
        const std::int32_t i = outer[k];
        const auto look_at = [&](std::int32_t other, double distance2) {
          if (skin[other] > skin[k] || (skin[other] == skin[k] && other <= k)) return;
          const std::int32_t j = outer[other];
          const float edge = 0.5f * (s.edge[i] + s.edge[j]);
          const auto distance = static_cast<float>(std::sqrt(distance2));
          if (distance > edge + skin[k] + skin[other] || !may_touch(s, piece, i, j)) return;
          of[k].push_back({other, std::min(edge, distance)});
        };
        grid.for_each_within(places[k], widest + 2 * skin[k], look_at);
      },
      16);
  of = both_ways(std::move(of), outer);
  for (std::size_t k = 0; k < outer.size(); ++k) {
    contacts.begin[outer[k] + 1] = static_cast<std::int32_t>(of[k].size());
    if (before.begin.empty()) continue;
    auto known = before.begin[outer[k]];
    const auto last = before.begin[outer[k] + 1];
    for (Found& f : of[k]) {  // both by number
      while (known < last && before.other[known] < f.other) ++known;
      if (known == last) break;
      if (before.other[known] == f.other) f.rest = std::max(f.rest, before.rest[known]);
    }
  }
  for (std::int32_t i = 0; i < s.count(); ++i) contacts.begin[i + 1] += contacts.begin[i];
  for (const auto& some : of) {
    for (const Found& f : some) {
      contacts.other.push_back(f.other);
      contacts.rest.push_back(f.rest);
    }
  }
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

void add_node_contact(const MlsState& s, std::int32_t i, float* force) {
  const MlsNodeContacts& contacts = s.node_contacts;
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
