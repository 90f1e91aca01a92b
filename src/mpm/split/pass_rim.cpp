// How much of the area that bonds at the rim of a cut stand for edges have passed.
#include <algorithm>

#include "cutting/blade_sweep.h"
#include "math/bspline.h"
#include "mpm/lattice/bonds.h"
#include "mpm/split/front.h"
#include "mpm/split/lattice_tissue.h"

namespace tissue_sim {
namespace {

/// Places of the area, -1/2 to 1/2 of its side: a lattice no two of which have a coordinate in
/// common, so that a front that goes along the lattice passes them one by one.
struct Probe {
  double a, b;
};
constexpr Probe probe(int i) {
  return {(i + 0.5) / kRimProbes - 0.5, (i * 13 % kRimProbes + 0.5) / kRimProbes - 0.5};
}
// By how much of the bond probes are longer than it at either end: an oblique cut leaves it within
// the area that it stands for.
constexpr double kProbeBeyond = 0.5;

/// Where a point is and how the tissue is deformed there.
struct Placed {
  Vec3 x;
  Eigen::Matrix3d F;
};
Placed placed_point(const LatticeTissue& s, const Array<float>* u, std::int32_t p) {
  const Points::Site& site = s.points.site[p];
  const LatticeBody& body = s.bodies[site.body];
  Placed at{body.site_position(site.x, site.y, site.z), Eigen::Matrix3d::Identity()};
  const int half[3] = {site.x & 1, site.y & 1, site.z & 1};
  for (int k = 0; k < 27; ++k) {
    const int node = s.fields->node(body, site, k), d[3] = {k % 3, k / 3 % 3, k / 9};
    float w[3], slope[3];
    for (int a = 0; a < 3; ++a) {
      w[a] = lattice_weight(half[a], d[a]);
      slope[a] = lattice_slope(half[a], d[a]);
    }
    const Vec3 moved(u[0][node], u[1][node], u[2][node]);
    at.x += static_cast<double>(w[0] * w[1] * w[2]) * moved;
    at.F +=
        moved *
        Vec3(slope[0] * w[1] * w[2], w[0] * slope[1] * w[2], w[0] * w[1] * slope[2]).transpose() /
        body.cell_size;
  }
  return at;
}

std::int32_t bond_beside(const LatticeBody& body, const Points::Site& site, int axis, int step) {
  return body.point(site.x + (axis == 0 ? step : 0), site.y + (axis == 1 ? step : 0),
                    site.z + (axis == 2 ? step : 0));
}

/// Whether a bond is at the rim of a cut: of it and the four beside it across it some are broken
/// and some are not.
bool is_at_rim(const LatticeTissue& s, const LatticeBody& body, std::int32_t p, int axis) {
  const Points::Site& site = s.points.site[p];
  if (body.next_point(site, axis) < 0) return false;
  const bool broken = is_broken(s.points, p, axis);
  for (int across = 0; across < 3; ++across) {
    if (across == axis) continue;
    for (const int step : {-1, 1}) {
      const std::int32_t q = bond_beside(body, site, across, step);
      if (q < 0 || body.next_point(s.points.site[q], axis) < 0) continue;
      if (is_broken(s.points, q, axis) != broken) return true;
    }
  }
  return false;
}

/// The rim again of bonds beside points that lost some.
void update_rim(LatticeTissue& s, const std::vector<std::int32_t>& broken) {
  std::vector<std::int32_t> beside;
  for (const std::int32_t p : broken) {
    const Points::Site& site = s.points.site[p];
    const LatticeBody& body = s.bodies[site.body];
    for (int i = 0; i < 27; ++i) {
      const std::int32_t q =
          body.point(site.x + i % 3 - 1, site.y + i / 3 % 3 - 1, site.z + i / 9 - 1);
      if (q >= 0) beside.push_back(q);
    }
  }
  std::sort(beside.begin(), beside.end());
  beside.erase(std::unique(beside.begin(), beside.end()), beside.end());
  for (const std::int32_t q : beside) {
    for (int axis = 0; axis < 3; ++axis) {
      const std::int64_t key = 3 * static_cast<std::int64_t>(q) + axis;
      if (is_at_rim(s, s.bodies[s.points.site[q].body], q, axis)) {
        s.front.rim.try_emplace(key, 0u);
      } else {
        s.front.rim.erase(key);
      }
    }
  }
}

/// What the path passes of a bond beside what was passed already.
std::uint32_t passed_of(const LatticeTissue& s, const std::vector<SweepPart>& parts,
                        const Array<float>* u_begin, const Array<float>* u_end, std::int32_t p,
                        int axis, std::uint32_t already) {
  const LatticeBody& body = s.bodies[s.points.site[p].body];
  const std::int32_t q = body.next_point(s.points.site[p], axis);
  const Placed end = placed_point(s, u_end, p), end_q = placed_point(s, u_end, q);
  const double reach = kRimReach * body.cell_size;
  const MovingSegment there{end.x, end_q.x, end.x, end_q.x};
  const auto is_far = [&](const SweepPart& part) {
    return std::all_of(part.edges.begin(), part.edges.end(),
                       [&](const SweptEdge& e) { return stays_aside(e, there, reach); });
  };
  if (std::all_of(parts.begin(), parts.end(), is_far)) return 0;
  const bool moves = u_begin != u_end;
  const Placed begin = moves ? placed_point(s, u_begin, p) : end;
  const Placed begin_q = moves ? placed_point(s, u_begin, q) : end_q;
  const double side = 0.5 * body.cell_size;
  std::uint32_t result = 0;
  for (int i = 0; i < kRimProbes; ++i) {
    if ((already >> i & 1) != 0) continue;
    Vec3 off = Vec3::Zero();
    off[(axis + 1) % 3] = side * probe(i).a;
    off[(axis + 2) % 3] = side * probe(i).b;
    const auto ends = [&off](const Placed& at, const Placed& at_q, Vec3& a, Vec3& b) {
      const Vec3 moved = at.F * off, along = kProbeBeyond * (at_q.x - at.x);
      a = at.x + moved - along;
      b = at_q.x + moved + along;
    };
    MovingSegment all;
    ends(begin, begin_q, all.a0, all.b0);
    ends(end, end_q, all.a1, all.b1);
    const bool is_passed = std::any_of(parts.begin(), parts.end(), [&](const SweepPart& part) {
      const MovingSegment then = all.during(part.begin, part.end);
      return std::any_of(part.edges.begin(), part.edges.end(), [&](const SweptEdge& e) {
        return !stays_aside(e, then) && edge_passes(e, then);
      });
    });
    if (is_passed) result |= 1u << i;
  }
  return result;
}

}  // namespace

void pass_rim(LatticeTissue& s, const BladePath& path, const Array<float>* u_begin,
              const Array<float>* u_end, const std::vector<std::int32_t>& broken,
              const std::uint8_t* near, std::vector<std::int32_t>& touched) {
  update_rim(s, broken);
  if (s.front.rim.empty()) return;
  const std::vector<SweepPart> parts = sweep_parts(path);
  std::vector<std::pair<std::int64_t, std::uint32_t*>> rim;
  for (auto& [key, mask] : s.front.rim) {
    if (mask == 0xffffffffu || (near != nullptr && near[key / 3] == 0)) continue;
    rim.emplace_back(key, &mask);
  }
  std::vector<std::uint32_t> more(rim.size());
  s.cpu->for_each(
      static_cast<int>(rim.size()),
      [&](int i) {
        const auto p = static_cast<std::int32_t>(rim[i].first / 3);
        more[i] = passed_of(s, parts, u_begin, u_end, p, static_cast<int>(rim[i].first % 3),
                            *rim[i].second);
      },
      32);
  for (std::size_t i = 0; i < rim.size(); ++i) {
    if (more[i] == 0) continue;
    *rim[i].second |= more[i];
    touched.push_back(static_cast<std::int32_t>(rim[i].first / 3));
  }
}

}  // namespace tissue_sim
