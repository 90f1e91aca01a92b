#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "compute/eight_bytes.h"
#include "mpm/blocks/known_facets.h"
#include "mpm/lattice/bonds.h"
#include "mpm/lattice/lattice_body.h"
#include "mpm/lattice/nodes.h"
#include "mpm/surface/block.h"
#include "mpm/surface/surroundings.h"

namespace tissue_sim {
namespace {

constexpr float kOneFace = 0.5f;  // cosine between normals

// A cell's upper points along each axis, a bit each; how many bits are set, which would be a call.
constexpr unsigned kUpper[3] = {0xaa, 0xcc, 0xf0};
constexpr auto kCount = [] {
  std::array<std::uint8_t, 256> count{};
  for (int i = 1; i < 256; ++i) count[i] = static_cast<std::uint8_t>(count[i / 2] + i % 2);
  return count;
}();

/// Bonds of a cell's points that are gone in one direction, on one level of the cell.
struct Side {
  int direction, axis, sign, level;
  int lateral[2];

  Side(int direction, int level) : direction(direction), level(level) {
    const BondOffset o = bond_offset(direction);
    axis = o.x != 0 ? 0 : o.y != 0 ? 1 : 2;
    sign = o.x + o.y + o.z;
    lateral[0] = (axis + 1) % 3;
    lateral[1] = (axis + 2) % 3;
  }
  /// The points of the level, a bit each.
  unsigned points() const { return level == 1 ? kUpper[axis] : 0xff & ~kUpper[axis]; }
};

/// How a face lies where bonds are gone.
struct Plane {
  double height;  ///< above the bonds' middle, in the middle of their columns [cells]
  Vec3 normal;    ///< unit, outward
};

/// The plane through the ends of the 4 x 4 columns around a cell's 2 x 2 that fits best, at
/// `middle` of the columns [cells].
Plane fitted_plane(const Surroundings& around, const Side& side, End how,
                   const double (&middle)[2]) {
  Place lower = {};
  lower[side.axis] = side.sign > 0 ? side.level : side.level - 1;
  int count = 0, first[2] = {}, second[3] = {}, ends[3] = {};  // sums, of quarters of a cell
  for (int b = -1; b <= 2; ++b) {
    for (int a = -1; a <= 2; ++a) {
      Place column = lower;
      column[side.lateral[0]] += a;
      column[side.lateral[1]] += b;
      const int end = around.nearest_end(column, side.axis, how);
      if (end == 9) continue;
      const int at[2] = {2 * a - 1, 2 * b - 1};
      ++count;
      for (int l = 0; l < 2; ++l) {
        first[l] += at[l];
        second[l] += at[l] * at[l];
        ends[1 + l] += end * at[l];
      }
      second[2] += at[0] * at[1];
      ends[0] += end;
    }
  }
  Eigen::Matrix3d normal;                           // a row of columns is level across
  normal << count, first[0] / 4.0, first[1] / 4.0,  //
      first[0] / 4.0, second[0] / 16.0 + 1e-2, second[2] / 16.0,  //
      first[1] / 4.0, second[2] / 16.0, second[1] / 16.0 + 1e-2;
  const Eigen::Vector3d c =
      normal.ldlt().solve(Eigen::Vector3d(ends[0] / 2.0, ends[1] / 8.0, ends[2] / 8.0));
  Plane plane{c[0], Vec3::Zero()};
  plane.normal[side.axis] = side.sign;
  for (int l = 0; l < 2; ++l) {
    const double slope = std::clamp(c[1 + l], -2.0, 2.0);
    plane.height += slope * middle[l];
    plane.normal[side.lateral[l]] = -side.sign * slope;
  }
  plane.normal.normalize();
  return plane;
}

/// The facet of the points `members` of a cell; plane(middle of their columns) is how it lies.
template <class PlaneAt>
Facet make_facet(double cell_size, int cell, const Side& side, const std::int32_t (&around)[8],
                 unsigned members, const PlaneAt& plane_at) {
  Facet f;
  f.point = around[__builtin_ctz(members)];  // numbered along x, then y, then z
  f.cell = cell;
  f.direction = static_cast<std::uint8_t>(side.direction);
  const int count = kCount[members];
  double middle[2];
  for (int l = 0; l < 2; ++l) {
    const int upper = kCount[members & kUpper[side.lateral[l]]];
    middle[l] = 0.25 * (2 * upper - count) / count;
    f.center[side.lateral[l]] = static_cast<float>(middle[l]);
    f.extent[side.lateral[l]] = 0.25f * (1 + static_cast<int>(upper > 0 && upper < count));
  }
  const Plane plane = plane_at(middle);
  const double face = 0.5 * (side.level - static_cast<int>(side.sign < 0));
  f.center[side.axis] = static_cast<float>(face + std::clamp(plane.height, -0.4, 0.4));
  f.extent[side.axis] = 0;
  for (int a = 0; a < 3; ++a) f.normal[a] = static_cast<float>(plane.normal[a]);
  f.area =
      static_cast<float>(count * 0.25 * cell_size * cell_size * std::fabs(plane.normal[side.axis]));
  return f;
}

/// The bonds that points of a cell miss.
struct Missing {
  unsigned points[2 * kBondCount];     ///< 2 k: whose bond k broke; 2 k + 1: that never had it
  std::int32_t beyond[kBondCount][8];  ///< where it broke: the other point
  unsigned any = 0;                    ///< which of `points` there are, a bit each

  /// `gone`: a byte for each point.
  Missing(const LatticeBody& body, const Place& corner, std::uint64_t gone) {
    for (int k = 0; k < kBondCount; ++k) {
      // The bytes' lowest bits, side by side.
      const auto all = static_cast<unsigned>((gone >> k & eight(1)) * 0x0102040810204080 >> 56);
      const BondOffset o = bond_offset(k);
      unsigned cut = 0;
      for (unsigned rest = all; rest != 0; rest &= rest - 1) {
        const int s = __builtin_ctz(rest);
        beyond[k][s] = body.point(corner[0] + (s & 1) + o.x, corner[1] + (s >> 1 & 1) + o.y,
                                  corner[2] + (s >> 2) + o.z);
        cut |= unsigned{beyond[k][s] >= 0} << s;
      }
      points[2 * k] = cut;
      points[2 * k + 1] = all & ~cut;
      any |= (unsigned{cut != 0} | unsigned{cut != all} << 1) << 2 * k;
    }
  }
  bool any_cut() const { return (any & 0x555) != 0; }
};

/// Appends the facets of the points `members`, whose bonds blades went through: one for each of
/// their cuts. Returns those whose bonds have no crossing.
unsigned add_crossed(const LatticeBody& body, const Points& points, int cell, const Side& side,
                     const std::int32_t (&around)[8], const std::int32_t (&beyond)[8],
                     unsigned members, std::vector<Facet>& facets) {
  Vec3 normal[8];
  double place[8];
  unsigned left = 0;
  for (unsigned rest = members; rest != 0; rest &= rest - 1) {
    const int s = __builtin_ctz(rest);
    const Crossing* crossing =
        points.crossings.find(side.sign > 0 ? around[s] : beyond[s], side.axis);
    if (crossing == nullptr) continue;
    normal[s] = Vec3(crossing->normal[0], crossing->normal[1], crossing->normal[2]);
    if (normal[s][side.axis] * side.sign < 0) normal[s] = -normal[s];
    place[s] = crossing->place;
    left |= 1u << s;
  }
  const unsigned unknown = members & ~left;
  while (left != 0) {
    const Vec3 first = normal[__builtin_ctz(left)];
    Plane plane{0, Vec3::Zero()};
    unsigned cut = 0;
    for (unsigned rest = left; rest != 0; rest &= rest - 1) {
      const int s = __builtin_ctz(rest);
      if (normal[s].dot(first) < kOneFace) continue;
      cut |= 1u << s;
      plane.height += 0.5 * (place[s] - 0.5);
      plane.normal += normal[s];
    }
    plane.height /= kCount[cut];
    plane.normal.normalize();
    facets.push_back(make_facet(body.cell_size, cell, side, around, cut,
                                [&plane](const double(&)[2]) { return plane; }));
    left &= ~cut;
  }
  return unknown;
}

/// Whether the points `around` are all that the cell has, and bonds of the uncut cell hold them
/// together: then they always were of one block.
bool is_one_part(const LatticeBody& body, const Place& corner, const std::int32_t (&around)[8]) {
  unsigned all = 0;
  for (int s = 0; s < 8; ++s) all |= around[s] >= 0 ? 1u << s : 0u;
  unsigned part = all & -all;
  for (int axis : {0, 1, 2, 0, 1, 2}) {
    constexpr unsigned kLower[3] = {0x55, 0x33, 0x0f};
    const int step = 1 << axis;
    part |= ((part & kLower[axis]) << step | (part >> step & kLower[axis])) & all;
  }
  int count = 0;
  for (int k = 0; k < 4; ++k) {
    body.for_each_point_in_row(corner[0], corner[0] + 2, corner[1] + k % 2, corner[2] + k / 2,
                               [&count](int, int, int of_row) { count += of_row; });
  }
  return part == all && count == kCount[all];
}

/// Whether any of the nodes around a cell moves.
bool sees_moving_nodes(const Nodes& nodes, const Block& block, int cell) {
  for (int k = 0; k < 27; ++k) {
    const int node = block.node[cell + k / 9 * block.plane + k / 3 % 3 * block.pitch + k % 3];
    if (node >= 0 && nodes.inv_mass[node] > 0) return true;
  }
  return false;
}

/// Takes the facets of one cell that belong to one face together, from `first` on.
void merge(std::vector<Facet>& facets, std::size_t first) {
  constexpr float kOneLayer = 0.25f;  // [cells] along the normal; points are half a cell apart
  for (std::size_t i = first; i < facets.size(); ++i) {
    for (std::size_t j = i + 1; j < facets.size();) {
      Facet &f = facets[i], g = facets[j];
      float cosine = 0, off = 0;
      for (int a = 0; a < 3; ++a) {
        cosine += f.normal[a] * g.normal[a];
        off += f.normal[a] * (g.center[a] - f.center[a]);
      }
      if (cosine < kOneFace || std::fabs(off) > kOneLayer) {
        ++j;
        continue;
      }
      const float area = f.area + g.area;
      float length = 0;
      for (int a = 0; a < 3; ++a) {
        const float low = std::min(f.center[a] - f.extent[a], g.center[a] - g.extent[a]);
        const float high = std::max(f.center[a] + f.extent[a], g.center[a] + g.extent[a]);
        f.center[a] = (f.area * f.center[a] + g.area * g.center[a]) / area;
        f.extent[a] = std::min(0.5f, std::max(high - f.center[a], f.center[a] - low));
        f.normal[a] = (f.area * f.normal[a] + g.area * g.normal[a]) / area;
        length += f.normal[a] * f.normal[a];
      }
      for (float& n : f.normal) n /= std::sqrt(length);
      f.area = area;
      if (g.point < f.point) {
        f.point = g.point;
        f.direction = g.direction;
      }
      facets.erase(facets.begin() + static_cast<std::ptrdiff_t>(j));
    }
  }
}

}  // namespace

std::vector<Facet> facets_of(const LatticeBody& body, const Points& points, const Nodes& nodes,
                             const Block& block, const KnownFacets& known) {
  std::vector<Facet> facets;
  for (int z = 0; z < block.nz; ++z) {
    for (const Block::Run& run : block.runs) {
      const int first_x = block.cell_x(run.x), y = block.y + run.y;
      for (int i = 0; i < run.count; ++i) {
        const int lane = run.lane + i, x = first_x + i;
        if (known.is_bare(x, y, block.z + z)) continue;
        const int cell = z * block.plane + block.cell[lane];
        std::int32_t around[8];
        for (int s = 0; s < 8; ++s) {
          around[s] = block.point[(static_cast<std::size_t>(z) * 8 + s) * block.stride + lane];
        }
        if (!known.is_stale(x, y, block.z + z)) {
          known.take(x, y, block.z + z, around, cell, facets);
          continue;
        }
        std::uint64_t gone = 0;
        for (int s = 0; s < 8; ++s) {
          const unsigned bonds = points.bonds[std::max(around[s], 0)];
          gone |= std::uint64_t{around[s] < 0 ? 0 : kAllBonds & ~bonds} << 8 * s;
        }
        if (gone != 0 && !points.free_volume.empty() && sees_moving_nodes(nodes, block, cell)) {
          for (int s = 0; s < 8; ++s) {
            if (around[s] < 0 || points.free_volume[around[s]] > 0) continue;
            gone &= ~(std::uint64_t{0xff} << 8 * s);
          }
        }
        if (gone == 0) continue;
        const Place corner = {2 * x, 2 * y, 2 * (block.z + z)};
        const Missing missing(body, corner, gone);
        if (!missing.any_cut() && !known.none() && is_one_part(body, corner, around)) {
          known.take(x, y, block.z + z, around, cell, facets);
          continue;
        }
        std::optional<Surroundings> surroundings;  // where a plane is to be fitted
        const std::size_t first = facets.size();
        for (unsigned any = missing.any; any != 0; any &= any - 1) {
          const int j = __builtin_ctz(any);
          const End how = j % 2 == 0 ? End::kCut : End::kOuter;
          for (int level = 0; level < 2; ++level) {
            const Side side(j / 2, level);
            unsigned members = missing.points[j] & side.points();
            if (how == End::kCut && members != 0) {
              members = add_crossed(body, points, cell, side, around,
                                    missing.beyond[side.direction], members, facets);
            }
            if (members == 0) continue;
            if (!surroundings) surroundings.emplace(body, points, corner);
            facets.push_back(make_facet(body.cell_size, cell, side, around, members,
                                        [&](const double(&middle)[2]) {
                                          return fitted_plane(*surroundings, side, how, middle);
                                        }));
          }
        }
        merge(facets, first);
      }
    }
  }
  return facets;
}

}  // namespace tissue_sim
