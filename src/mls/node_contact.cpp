#include "mls/node_contact.h"

#include <algorithm>
#include <cmath>

#include "geometry/nearest.h"

namespace tissue_sim {
namespace {

constexpr double kSkin = 0.5;  // of an edge: how much farther than they touch nodes are listed
constexpr double kFar = 2.5;   // reference distance from which a piece may touch itself [edges]
constexpr double kFasterThanSeen = 1.5;  // than when that was seen last
constexpr int kMostSubsteps = 200;       // until it is seen again how far nodes moved
constexpr int kFewestSubsteps = 4;       // else they are looked for at once

bool may_touch(const MlsState& s, const std::vector<std::int32_t>& piece, std::int32_t i,
               std::int32_t j) {
  const std::int32_t e = s.pairs.find(i, j);
  if (e >= 0) return s.pairs.crossed[e] != 0;
  if (piece[i] != piece[j]) return true;
  const double far = kFar * 0.5 * (s.edge[i] + s.edge[j]);
  return (s.nodes.place[i] - s.nodes.place[j]).squaredNorm() > far * far;
}

/// Of the nodes that may touch.
struct Motion {
  double moved = 0;    ///< how far any did since the search [m]
  double fastest = 0;  ///< [m/s]
};

Motion motion_of(const MlsState& s) {
  Motion most;
  const float* from = s.node_contacts.u_found.data();
  for (std::int32_t i = 0; i < s.count(); ++i) {
    if (s.outer[i] == 0) continue;
    double d2 = 0, v2 = 0;
    for (int a = 0; a < 3; ++a) {
      const double d = static_cast<double>(s.u[4 * i + a]) - *from++;
      d2 += d * d;
      v2 += static_cast<double>(s.v[4 * i + a]) * s.v[4 * i + a];
    }
    most.moved = std::max(most.moved, d2);
    most.fastest = std::max(most.fastest, v2);
  }
  return {std::sqrt(most.moved), std::sqrt(most.fastest)};
}

/// Substeps for which a list lasts at least of whose skin so much is left.
int lasts(double left, double fastest, float dt) {
  const double step = kFasterThanSeen * fastest * dt;
  return static_cast<int>(std::min<double>(kMostSubsteps, step > 0 ? left / step : 1e9));
}

void find_node_contacts(MlsState& s, const std::vector<std::int32_t>& piece) {
  MlsNodeContacts& contacts = s.node_contacts;
  std::vector<std::int32_t> outer;
  std::vector<Vec3> places;
  double widest = 0, least = 1e300;
  for (std::int32_t i = 0; i < s.count(); ++i) {
    if (s.outer[i] == 0) continue;
    outer.push_back(i);
    places.push_back(s.position(i));
    widest = std::max<double>(widest, s.edge[i]);
    least = std::min<double>(least, s.edge[i]);
  }
  const MlsNodeContacts before = std::move(contacts);
  contacts = {};
  contacts.begin.assign(s.count() + 1, 0);
  if (outer.empty()) return;
  contacts.skin = static_cast<float>(0.5 * kSkin * least);
  contacts.u_found.reserve(3 * outer.size());
  for (const std::int32_t i : outer) {
    contacts.u_found.insert(contacts.u_found.end(), &s.u[4 * i], &s.u[4 * i] + 3);
  }
  const NearestPoints tree(places);
  struct Found {
    std::int32_t other;
    float rest;
  };
  std::vector<std::vector<Found>> of(outer.size());
  s.cpu->for_each(
      static_cast<int>(outer.size()),
      [&](int k) {
        const std::int32_t i = outer[k];
        std::vector<Neighbour> near;
        tree.within(places[k], (1 + kSkin) * widest, near);
        for (const Neighbour& n : near) {
          const std::int32_t j = outer[n.index];
          const float edge = 0.5f * (s.edge[i] + s.edge[j]);
          const auto distance = static_cast<float>(std::sqrt(n.distance2));
          if (j == i || distance > (1 + static_cast<float>(kSkin)) * edge) continue;
          if (!may_touch(s, piece, i, j)) continue;
          float rest = std::min(edge, distance);
          if (!before.begin.empty()) {
            const auto first = before.other.begin() + before.begin[i],
                       last = before.other.begin() + before.begin[i + 1];
            const auto at = std::lower_bound(first, last, j);
            if (at != last && *at == j) {
              rest = std::max(rest, before.rest[at - before.other.begin()]);
            }
          }
          of[k].push_back({j, rest});
        }
      },
      16);
  for (std::size_t k = 0; k < outer.size(); ++k) {
    contacts.begin[outer[k] + 1] = static_cast<std::int32_t>(of[k].size());
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
    const Motion motion = motion_of(s);
    contacts.until_look = lasts(contacts.skin - motion.moved, motion.fastest, dt);
    if (contacts.until_look >= kFewestSubsteps) return false;
  }
  find_node_contacts(s, piece);
  contacts.until_look = lasts(contacts.skin, motion_of(s).fastest, dt);
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
