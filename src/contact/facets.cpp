#include "contact/facets.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "contact/known_facets.h"
#include "cutting/bonds.h"
#include "mpm/block.h"
#include "mpm/lattice_body.h"

namespace tissue_sim {
namespace {

using Place = std::array<int, 3>;  // a site of the lattice, from the lowest of the cell's

enum class End { kNone, kCut, kOuter };

/// The bonds of the points around a cell, as far out as the end of tissue is looked for.
class Surroundings {
 public:
  Surroundings(const LatticeBody& body, const Points& points, const Place& corner) {
    const int x = corner[0] + kFrom, sx = 2 * body.nx;
    for (int k = 0, i = 0; k < kWidth; ++k) {
      for (int j = 0; j < kWidth; ++j, i += kWidth) {
        const int y = corner[1] + kFrom + j, z = corner[2] + kFrom + k;
        const bool inside = y >= 0 && z >= 0 && y < 2 * body.ny && z < 2 * body.nz;
        const std::ptrdiff_t row = (static_cast<std::ptrdiff_t>(z) * 2 * body.ny + y) * sx + x;
        for (int n = 0; n < kWidth; ++n) {
          const std::int32_t p = inside && x + n >= 0 && x + n < sx ? body.point_at[row + n] : -1;
          bonds_[i + n] = p < 0 ? kNoPoint : points.bonds[p];
        }
      }
    }
  }

  bool has_point(const Place& at) const { return bonds_[index(at)] != kNoPoint; }

  /// How many sites above or below `lower` tissue ends next in that way, within two; 9 where it
  /// does not, or in both directions.
  int nearest_end(const Place& lower, int axis, End end) const {
    const int at = index(lower);
    if (end_at(at, axis) == end) return 0;
    for (int m = 1; m <= 2; ++m) {
      const bool above = end_at(at + m * kStep[axis], axis) == end,
                 below = end_at(at - m * kStep[axis], axis) == end;
      if (above || below) return above && below ? 9 : above ? m : -m;
    }
    return 9;
  }

 private:
  static constexpr int kFrom = -3, kWidth = 8;  // sites
  static constexpr int kStep[3] = {1, kWidth, kWidth* kWidth};
  static constexpr std::uint8_t kNoPoint = 0xff;

  static int index(const Place& p) {
    return ((p[2] - kFrom) * kWidth + p[1] - kFrom) * kWidth + p[0] - kFrom;
  }
  /// How tissue ends between a site and the next along `axis`: their bond is broken, or one is
  /// empty.
  End end_at(int lower, int axis) const {
    const std::uint8_t p = bonds_[lower], q = bonds_[lower + kStep[axis]];
    if (p == kNoPoint || q == kNoPoint) return p == q ? End::kNone : End::kOuter;
    return (p >> (kForwardBond + axis) & 1) == 0 ? End::kCut : End::kNone;
  }

  std::uint8_t bonds_[kWidth * kWidth * kWidth];
};

struct Plane {
  double height = 0, slope[2] = {};  // at the middle of the cell's columns; per cell
};

/// The plane through the ends of the 4 x 4 columns around a cell's 2 x 2 that fits best. `lower` is
/// the site below the facet in the cell's first column.
Plane fit(const Surroundings& around, const Place& lower, int axis, const int (&lateral)[2],
          End how) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  normal(1, 1) = normal(2, 2) = 1e-2;  // a row of columns is level across
  for (int b = -1; b <= 2; ++b) {
    for (int a = -1; a <= 2; ++a) {
      Place column = lower;
      column[lateral[0]] += a;
      column[lateral[1]] += b;
      const int end = around.nearest_end(column, axis, how);
      if (end == 9) continue;
      const Eigen::Vector3d row(1, 0.5 * (a - 0.5), 0.5 * (b - 0.5));
      normal += row * row.transpose();
      right += 0.5 * end * row;
    }
  }
  const Eigen::Vector3d c = normal.ldlt().solve(right);
  return {c[0], {std::clamp(c[1], -2.0, 2.0), std::clamp(c[2], -2.0, 2.0)}};
}

Facet make_facet(const Surroundings& surroundings, double cell_size, int cell, int direction,
                 int level, const std::int32_t (&around)[8], unsigned members, End how) {
  const BondOffset o = bond_offset(direction);
  const int axis = o.x != 0 ? 0 : o.y != 0 ? 1 : 2, sign = o.x + o.y + o.z;
  const int lateral[2] = {(axis + 1) % 3, (axis + 2) % 3};
  Place lower = {};
  lower[axis] = sign > 0 ? level : level - 1;
  const Plane plane = fit(surroundings, lower, axis, lateral, how);
  Facet f;
  f.point = std::numeric_limits<std::int32_t>::max();
  f.cell = cell;
  f.direction = static_cast<std::uint8_t>(direction);
  double low[2] = {1, 1}, high[2] = {-1, -1}, middle[2] = {};
  int count = 0;
  for (int s = 0; s < 8; ++s) {
    if ((members >> s & 1) == 0) continue;
    f.point = std::min(f.point, around[s]);
    ++count;
    for (int l = 0; l < 2; ++l) {
      const double at = s >> lateral[l] & 1 ? 0.25 : -0.25;
      low[l] = std::min(low[l], at - 0.25);
      high[l] = std::max(high[l], at + 0.25);
      middle[l] += at;
    }
  }
  const double face = 0.5 * (level - 1) + (sign > 0 ? 0.5 : 0.0);
  double height = plane.height;
  for (int l = 0; l < 2; ++l) {
    middle[l] /= count;
    height += plane.slope[l] * middle[l];
    f.center[lateral[l]] = static_cast<float>(middle[l]);
    f.extent[lateral[l]] = static_cast<float>(0.5 * (high[l] - low[l]));
  }
  f.center[axis] = static_cast<float>(face + std::clamp(height, -0.4, 0.4));
  f.extent[axis] = 0;
  Vec3 n = Vec3::Zero();
  n[axis] = sign;
  for (int l = 0; l < 2; ++l) n[lateral[l]] = -sign * plane.slope[l];
  n.normalize();
  for (int a = 0; a < 3; ++a) f.normal[a] = static_cast<float>(n[a]);
  f.area = static_cast<float>(count * 0.25 * cell_size * cell_size * std::fabs(n[axis]));
  return f;
}

/// Takes the facets of one cell that belong to one face together, from `first` on.
void merge(std::vector<Facet>& facets, std::size_t first) {
  constexpr float kOneFace = 0.5f;    // cosine between normals
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

std::vector<Facet> facets_of(const LatticeBody& body, const Points& points, const Block& block,
                             const KnownFacets& known) {
  std::vector<Facet> facets;
  for (int z = 0; z < block.nz; ++z) {
    for (const Block::Run& run : block.runs) {
      for (int i = 0; i < run.count; ++i) {
        const int lane = run.lane + i;
        const int x = block.x + run.x + i, y = block.y + run.y;
        const int cell = z * block.plane + block.cell[lane];
        std::int32_t around[8];
        for (int s = 0; s < 8; ++s) {
          around[s] = block.point[(static_cast<std::size_t>(z) * 8 + s) * block.stride + lane];
        }
        if (known.take(x, y, block.z + z, around, cell, facets)) continue;
        const auto is_whole = [&points](std::int32_t p) {
          return p < 0 || points.bonds[p] == kAllBonds;
        };
        if (std::all_of(std::begin(around), std::end(around), is_whole)) continue;
        const Surroundings surroundings(body, points, {2 * x, 2 * y, 2 * (block.z + z)});
        unsigned missing[2][kBondCount] = {};  // the cell's points without a bond: cut, never had
        for (int s = 0; s < 8; ++s) {
          if (is_whole(around[s])) continue;
          for (int k = 0; k < kBondCount; ++k) {
            if ((points.bonds[around[s]] >> k & 1) != 0) continue;
            const BondOffset o = bond_offset(k);
            const Place next = {(s & 1) + o.x, (s >> 1 & 1) + o.y, (s >> 2) + o.z};
            missing[surroundings.has_point(next) ? 0 : 1][k] |= 1u << s;
          }
        }
        const std::size_t first = facets.size();
        for (int j = 0; j < 4 * kBondCount; ++j) {
          constexpr unsigned kUpper[3] = {0xaa, 0xcc, 0xf0};  // points above along x, y, z
          const int outer = j / 2 % 2, level = j % 2, k = j / 4;
          const int axis = k < kForwardBond ? kForwardBond - 1 - k : k - kForwardBond;
          const unsigned members = missing[outer][k] & (level == 1 ? kUpper[axis] : ~kUpper[axis]);
          if (members == 0) continue;
          facets.push_back(make_facet(surroundings, body.cell_size, cell, k, level, around, members,
                                      outer == 1 ? End::kOuter : End::kCut));
        }
        merge(facets, first);
      }
    }
  }
  return facets;
}

}  // namespace tissue_sim
