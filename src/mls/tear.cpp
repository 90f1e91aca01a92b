#include "mls/tear.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "math/draw.h"

namespace tissue_sim {
namespace {

/// Largest stretch that a node bears; 0 where it bears any.
float limit_of(const MlsState& s, std::int32_t i) {
  const Material& m = s.nodes.material_of(i);
  if (m.tear_stretch == 0 || s.inv_mass[i] == 0) return 0;
  const double scatter = m.tear_scatter * draw(s.scene.seed, i);
  return static_cast<float>(1 + (m.tear_stretch - 1) * (1 + scatter));
}

struct Furthest {
  float past = 1;  ///< stretch over its limit
  std::int32_t entry = -1;
};

/// Adds the other pairs that cross where the pair `torn` does: a disc across it of about the room
/// that a node has. They are stretched less than the pair, for they lie askew, and would hold the
/// sides of a crack together until these are far apart.
void add_crossing(const MlsState& s, std::int32_t torn, std::vector<std::int32_t>& entries) {
  const MlsPairs& p = s.pairs;
  const std::int32_t ends[] = {p.other[p.twin[torn]], p.other[torn]};
  const auto place = [&s](std::int32_t i) {
    return Vec3(s.place[4 * i], s.place[4 * i + 1], s.place[4 * i + 2]);
  };
  const Vec3 middle = 0.5 * (place(ends[0]) + place(ends[1]));
  const Vec3 normal = (place(ends[1]) - place(ends[0])).normalized();
  const double room = 0.5 * (s.nodes.volume[ends[0]] + s.nodes.volume[ends[1]]);
  const double radius = 0.75 * std::cbrt(room);
  std::vector<std::int32_t> near;
  for (const std::int32_t i : ends) {
    near.push_back(i);
    for (std::int32_t e = p.begin[i]; e < p.begin[i + 1]; ++e) near.push_back(p.other[e]);
  }
  std::sort(near.begin(), near.end());
  near.erase(std::unique(near.begin(), near.end()), near.end());
  for (const std::int32_t i : near) {
    const Vec3 from = place(i) - middle;
    const double below = from.dot(normal);
    if (below >= 0) continue;
    for (std::int32_t e = p.begin[i]; e < p.begin[i + 1]; ++e) {
      if (p.crossed[e] != 0 || s.nodes.material_of(p.other[e]).tear_stretch == 0) continue;
      const Vec3 to = place(p.other[e]) - middle;
      const double above = to.dot(normal);
      if (above <= 0) continue;
      const Vec3 at = from + below / (below - above) * (to - from);
      if (at.norm() < radius) entries.push_back(e);
    }
  }
}

/// Of nodes taken as one.
struct Together {
  double mass = 0;                                 ///< [kg]
  Vec3 place = Vec3::Zero(), rate = Vec3::Zero();  ///< [m], [m/s]
  Together(const MlsState& s, const std::vector<std::int32_t>& nodes) {
    for (const std::int32_t i : nodes) {
      mass += s.mass[i];
      place += s.mass[i] * s.position(i);
      rate += s.mass[i] * s.velocity(i);
    }
    place /= mass;
    rate /= mass;
  }
};

/// What is beside takes the momentum as a rigid body does, so that both momenta stay, unless a node
/// of it would come to be as fast by it.
bool slow_down(MlsState& s, const std::vector<std::int32_t>& bit) {
  const MlsPairs& p = s.pairs;
  const Material& material = s.nodes.material_of(bit.front());
  std::vector<std::int32_t> beside;
  for (const std::int32_t i : bit) {
    if (s.inv_mass[i] == 0) return false;
    for (std::int32_t e = p.begin[i]; e < p.begin[i + 1]; ++e) {
      if (std::find(bit.begin(), bit.end(), p.other[e]) == bit.end()) beside.push_back(p.other[e]);
    }
  }
  std::sort(beside.begin(), beside.end());
  beside.erase(std::unique(beside.begin(), beside.end()), beside.end());
  if (beside.size() < 4) return false;
  const Together own(s, bit), others(s, beside);
  const double most =
      (material.tear_stretch - 1) * std::sqrt(material.young_modulus / material.density);
  const Vec3 off = own.rate - others.rate;
  if (off.norm() <= most) return false;
  const Vec3 momentum =
      own.mass * others.mass / (own.mass + others.mass) * (1 - most / off.norm()) * off;
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  for (const std::int32_t i : beside) {
    const Vec3 r = s.position(i) - others.place;
    inertia += s.mass[i] * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
  }
  const Vec3 spin = inertia.ldlt().solve((own.place - others.place).cross(momentum));
  const auto gain = [&](std::int32_t i) -> Vec3 {
    return momentum / others.mass + spin.cross(s.position(i) - others.place);
  };
  const auto gains_little = [&](std::int32_t i) { return gain(i).norm() < most; };
  if (!std::all_of(beside.begin(), beside.end(), gains_little)) return false;
  const auto add = [&s](std::int32_t i, const Vec3& v) {
    for (int a = 0; a < 3 && s.inv_mass[i] != 0; ++a) s.v[4 * i + a] += static_cast<float>(v[a]);
  };
  for (const std::int32_t i : bit) add(i, -momentum / own.mass);
  for (const std::int32_t i : beside) add(i, gain(i));
  return true;
}

}  // namespace

bool can_tear(const MlsState& s) {
  return std::any_of(s.nodes.materials.begin(), s.nodes.materials.end(),
                     [](const Material& m) { return m.tear_stretch > 0; });
}

std::vector<std::int32_t> find_tearing(MlsState& s) {
  const MlsPairs& p = s.pairs;
  std::vector<Furthest> furthest(s.count());
  s.cpu->for_each(
      s.count(),
      [&](int i) {
        const float own = limit_of(s, i);
        if (own == 0) return;
        for (std::int32_t e = p.begin[i]; e < p.begin[i + 1]; ++e) {
          if (p.crossed[e] != 0) continue;
          const std::int32_t j = p.other[e];
          const float other = limit_of(s, j);
          if (other == 0) continue;
          float r2 = 0, x2 = 0;
          for (int a = 0; a < 3; ++a) {
            const float r = s.place[4 * j + a] - s.place[4 * i + a];
            const float x = r + (s.u[4 * j + a] - s.u[4 * i + a]);
            r2 += r * r;
            x2 += x * x;
          }
          const float past = std::sqrt(x2 / r2) / (0.5f * (own + other));
          if (past > furthest[i].past) furthest[i] = {past, e};
        }
      },
      kMlsGroup);
  std::vector<std::int32_t> entries;
  for (std::int32_t i = 0; i < s.count(); ++i) {
    const std::int32_t e = furthest[i].entry;
    if (e < 0 || p.other[e] < i) continue;
    if (furthest[p.other[e]].entry == p.twin[e]) add_crossing(s, e, entries);
  }
  return entries;
}

bool slow_torn_bits(MlsState& s, const std::vector<std::int32_t>& piece_of,
                    const std::vector<int>& pieces) {
  constexpr std::size_t kBit = 8;  // nodes of what is one
  bool any = false;
  for (const int piece : pieces) {
    std::vector<std::int32_t> bit;
    for (std::int32_t i = 0; i < s.count() && bit.size() <= kBit; ++i) {
      if (piece_of[i] == piece) bit.push_back(i);
    }
    any = (!bit.empty() && bit.size() <= kBit && slow_down(s, bit)) || any;
  }
  return any;
}

}  // namespace tissue_sim
