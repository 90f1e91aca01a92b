// What becomes of parted nodes that are split for good.
#include <cmath>
#include <utility>

#include "mpm/mpm_state.h"
#include "mpm/split/front.h"
#include "mpm/tear/debris.h"

namespace tissue_sim {
namespace {

/// The point next to a parted node, of those that move with it.
std::int32_t point_beside(const LatticeBody& body, const FrontNode& of) {
  std::int32_t point[216], nearest = -1;
  points_around(body, of.x, of.y, of.z, point);
  double least = 1e9;
  for (int i = 0; i < 216; ++i) {
    const int x = i % 6, y = i / 6 % 6, z = i / 36;
    if ((of.all[z] >> bit_in_plane(x, y) & 1) == 0) continue;
    const double far = std::hypot(x - 2.5, y - 2.5, z - 2.5);
    if (far >= least) continue;
    least = far;
    nearest = point[i];
  }
  return nearest;
}

}  // namespace

void split_front(MpmState& s) {
  Front& front = s.front;
  std::vector<FrontNode> kept;
  std::size_t to = 0;
  for (std::size_t n = 0; n < front.nodes.size(); ++n) {
    const FrontNode& of = front.nodes[n];
    const LatticeBody& body = s.bodies[of.body];
    const NodeFields::Split* split = s.fields->split(body.node(of.x, of.y, of.z));
    struct Now {
      std::int32_t node;
      double side, mass;
    };
    std::vector<Now> now;
    bool whole = split == nullptr;
    for (std::size_t f = 0; split != nullptr && f < split->fields.size(); ++f) {
      const Planes& points = split->fields[f].points;
      int first = 0, other = 0;
      for (int z = 0; z < 6; ++z) {
        const std::uint64_t here = points[z] & of.all[z];
        first += __builtin_popcountll(here & of.first_side[z]);
        other += __builtin_popcountll(here & ~of.first_side[z]);
      }
      if (first + other == 0) continue;
      whole = whole || points == of.all;
      const std::int32_t node = split->fields[f].node;
      const double side = (other * of.first - first * of.other) / (first + other);
      now.push_back({node, side, s.nodes.mass[node]});
    }
    if (whole) {
      kept.push_back(of);
      for (int a = 0; a < 3; ++a) {
        front.d[a][to] = front.d[a][n];
        front.rate[a][to] = front.rate[a][n];
      }
      ++to;
      continue;
    }
    double mass = 0, mean = 0;  // so that momentum stays where they are not the two sides
    for (const Now& field : now) {
      mass += field.mass;
      mean += field.mass * field.side;
    }
    mean = mass > 0 ? mean / mass : 0;
    double left = of.mass;  // of the mass that d had: what fields of both sides do not take over
    for (const Now& field : now) left -= field.mass * (field.side - mean) * (field.side - mean);
    for (const Now& field : now) {
      if (s.nodes.inv_mass[field.node] == 0) continue;
      const auto by = static_cast<float>(field.side - mean);
      for (int a = 0; a < 3; ++a) {
        s.nodes.u[a][field.node] += by * front.d[a][n];
        s.nodes.v[a][field.node] += by * front.rate[a][n];
      }
    }
    const std::int32_t beside = point_beside(body, of);
    if (beside < 0) continue;
    const Vec3 d(front.d[0][n], front.d[1][n], front.d[2][n]);
    const Vec3 rate(front.rate[0][n], front.rate[1][n], front.rate[2][n]);
    turn(s, beside, left * d.cross(rate));
  }
  front.nodes = std::move(kept);
  for (int a = 0; a < 3; ++a) {
    front.d[a].resize(to);
    front.rate[a].resize(to);
  }
}

}  // namespace tissue_sim
