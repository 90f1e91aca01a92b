// What becomes of parted nodes that are split for good.
#include <cmath>
#include <utility>

#include "mpm/split/front.h"
#include "mpm/split/lattice_tissue.h"
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

void split_front(LatticeTissue& s) {
  Front& front = s.front;
  std::vector<FrontNode> kept;
  Array<float> d[3], rate[3];
  const auto keep = [&](const FrontNode& node, std::size_t n) {
    kept.push_back(node);
    for (int a = 0; a < 3; ++a) {
      d[a].push_back(front.d[a][n]);
      rate[a].push_back(front.rate[a][n]);
    }
  };
  for (std::size_t n = 0; n < front.nodes.size(); ++n) {
    const FrontNode& of = front.nodes[n];
    const LatticeBody& body = s.bodies[of.body];
    const NodeFields::Split* split = s.fields->split(body.node(of.x, of.y, of.z));
    bool whole = split == nullptr;
    std::vector<FrontNode> parts;  // by the fields that it came apart into
    for (std::size_t f = 0; split != nullptr && f < split->fields.size(); ++f) {
      FrontNode part = of;
      part.node = split->fields[f].node;
      bool any = false;
      for (int z = 0; z < 6; ++z) {
        part.all[z] &= split->fields[f].points[z];
        part.first_side[z] &= part.all[z];
        any = any || part.all[z] != 0;
      }
      if (any) parts.push_back(part);
      whole = whole || split->fields[f].points == of.all;
    }
    if (whole) {
      keep(of, n);
      continue;
    }
    double left = of.mass;  // of what d moved: that nothing takes over
    for (FrontNode& part : parts) {
      const bool parted =
          weigh_sides(s, part) && s.nodes.inv_mass[part.node] != 0 && is_cut_between_sides(s, part);
      const float by = part.other - of.other;
      const double mass = s.nodes.mass[part.node];
      left -= mass * by * by + (parted ? part.mass : 0.0f);
      if (parted) keep(part, n);
      if (s.nodes.inv_mass[part.node] == 0) continue;
      for (int a = 0; a < 3; ++a) {
        s.nodes.u[a][part.node] += by * front.d[a][n];
        s.nodes.v[a][part.node] += by * front.rate[a][n];
      }
    }
    const std::int32_t beside = point_beside(body, of);
    if (beside < 0) continue;
    const Vec3 apart(front.d[0][n], front.d[1][n], front.d[2][n]);
    const Vec3 fast(front.rate[0][n], front.rate[1][n], front.rate[2][n]);
    push(s, beside, Vec3::Zero(), left * apart.cross(fast));
  }
  front.nodes = std::move(kept);
  for (int a = 0; a < 3; ++a) {
    std::swap(front.d[a], d[a]);
    std::swap(front.rate[a], rate[a]);
  }
}

}  // namespace tissue_sim
