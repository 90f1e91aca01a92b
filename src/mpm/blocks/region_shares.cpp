#include "mpm/blocks/region_shares.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <iterator>
#include <numeric>

namespace tissue_sim {
namespace {

constexpr int axis_of(int bond) { return bond < 3 ? 2 - bond : bond - 3; }

/// Bonds that lead out of a cell from the point at sub-position s.
constexpr auto kLeaving = [] {
  std::array<unsigned, 8> bonds{};
  for (int i = 0; i < 8 * 3; ++i) {
    const int s = i / 3, a = i % 3;
    bonds[s] |= 1u << ((s >> a & 1) != 0 ? kForwardBond + a : kForwardBond - 1 - a);
  }
  return bonds;
}();

/// All bonds between a cell's points, a byte for each; with those that lead on along x.
constexpr std::uint64_t bonds_within(bool along_x) {
  std::uint64_t all = 0;
  for (int s = 0; s < 8; ++s) {
    std::uint64_t bonds = kAllBonds & ~kLeaving[s];
    if (along_x) bonds |= 1u << kForwardBond | 1u << opposite_bond(kForwardBond);
    all |= bonds << 8 * s;
  }
  return all;
}
constexpr std::uint64_t kWithin = bonds_within(false), kWithinRun = bonds_within(true);

/// Sets to[i] where from[i], or the one a step or two further on, is set.
void spread_back(const std::vector<std::uint8_t>& from, std::size_t step,
                 std::vector<std::uint8_t>& to) {
  const std::uint8_t* of = from.data();
  std::uint8_t* out = to.data();
  for (std::size_t i = 0; i + 2 * step < from.size(); ++i) {
    out[i] = of[i] | of[i + step] | of[i + 2 * step];
  }
}

}  // namespace

RegionShares::RegionShares(const BlockRegion& r, const LatticeBody& b, const Points& points,
                           const NodeFields& fields)
    : r_(r), points_(points), step_{-r.nx * r.ny, -r.nx, -1, 1, r.nx, r.nx * r.ny} {
  const int px = r.nx + 2, py = r.ny + 2, pz = r.nz + 2;
  const std::size_t n = static_cast<std::size_t>(px) * py * pz;
  split_.resize(n);
  std::vector<std::uint8_t> is_split(n, 0);
  for (int z = 0; z < pz; ++z) {
    for (int y = 0; y < py; ++y) {
      const int row = (z * py + y) * px, x0 = r.x - 1;
      b.for_each_node_in_row(x0, x0 + px, r.y + y - 1, r.z + z - 1,
                             [&](int x, int node, int count) {
                               for (int i = 0; i < count; ++i) {
                                 const NodeFields::Split* split = fields.split(node + i);
                                 split_[row + x - x0 + i] = split;
                                 is_split[row + x - x0 + i] = split != nullptr;
                                 any_split_ = any_split_ || split != nullptr;
                               }
                             });
    }
  }
  split_in_row_.assign(n, 0);
  near_split_ = split_in_row_;
  if (any_split_) {
    spread_back(is_split, 1, split_in_row_);
    spread_back(split_in_row_, px, is_split);
    spread_back(is_split, px * py, near_split_);
  }
  cells_.resize(static_cast<std::size_t>(r.nx) * r.ny * r.nz);
  all_.reserve(cells_.size());
  // The four rows of points through a row of cells, and their bonds.
  const int length = 2 * r.nx;
  std::vector<std::int32_t> point_at(4 * length);
  std::vector<std::uint8_t> bonds_at(4 * length);
  std::size_t i = 0;
  for (int z = 0; z < r.nz; ++z) {
    for (int y = 0; y < r.ny; ++y) {
      std::fill(point_at.begin(), point_at.end(), -1);
      std::fill(bonds_at.begin(), bonds_at.end(), kNoPoint);
      for (int k = 0; k < 4; ++k) {
        b.for_each_point_in_row(2 * r.x, 2 * r.x + length, 2 * (r.y + y) + k % 2,
                                2 * (r.z + z) + k / 2, [&](int x, int point, int count) {
                                  const int at = k * length + x - 2 * r.x;
                                  std::iota(&point_at[at], &point_at[at] + count, point);
                                  std::copy_n(&points.bonds[point], count, &bonds_at[at]);
                                });
      }
      CellBonds of_run = 0;  // of each of the cells in the last share, if that may go on
      for (int x = 0; x < r.nx; ++x, ++i) {
        CellBonds bonds = 0;
        for (int k = 0; k < 4; ++k) {
          std::uint16_t pair;  // of points along x
          std::memcpy(&pair, &bonds_at[k * length + 2 * x], sizeof(pair));
          bonds |= CellBonds{pair} << 16 * k;
        }
        const bool near_split = near_split_[node_at(x, y, z)] != 0;
        if (bonds == of_run && !near_split) {
          ++all_.back().cells;
          cells_[i] = cells_[i - 1];
          continue;
        }
        of_run = 0;
        if (bonds == ~CellBonds{0}) continue;  // no points
        std::int32_t point[8];
        for (int s = 0; s < 8; ++s) point[s] = point_at[(s >> 1) * length + 2 * x + (s & 1)];
        add_cell(x, y, z, point, bonds, cells_[i]);
        const bool may_go_on = (bonds & kWithinRun) == kWithinRun && !near_split;
        if (may_go_on && cells_[i].faces != Cell::kUneven) of_run = bonds;
      }
    }
  }
}

AllSeen RegionShares::seen(const Reached& r) const {
  const CellShare& c = all_[r.share];
  AllSeen none;  // not {}, which would clear all of it
  if (near_split_[node_at(c.x, c.y, c.z)] == 0) return none;
  int s = 0;
  while (c.point[s] < 0) ++s;
  return seen(c.x, c.y, c.z, s, r.bond);
}

std::vector<RegionShares::Reached> RegionShares::connected(
    std::int32_t start, std::vector<std::uint8_t>& reached) const {
  std::vector<Reached> order;
  order.reserve(count());
  order.push_back({start, kNoBond});
  reached[start] = 1;
  const auto reach = [&](std::int32_t share, int bond) {
    if (reached[share] != 0) return;
    reached[share] = 1;
    order.push_back({share, bond});
  };
  for (std::size_t next = 0; next < order.size(); ++next) {
    const CellShare& c = all_[order[next].share];
    const Cell* cell = &cells_[(c.z * r_.ny + c.y) * r_.nx + c.x];
    // Bonds that stay within the region, a bit each.
    const unsigned within = unsigned{c.z > 0} | unsigned{c.y > 0} << 1 | unsigned{c.x > 0} << 2 |
                            unsigned{c.x + c.cells < r_.nx} << 3 | unsigned{c.y + 1 < r_.ny} << 4 |
                            unsigned{c.z + 1 < r_.nz} << 5;
    if (cell->count == 1 && cell->faces != Cell::kUneven) {
      for (unsigned faces = cell->faces & within; faces != 0; faces &= faces - 1) {
        const int k = __builtin_ctz(faces);
        const Cell* other = k == kForwardBond ? cell + c.cells : cell + step_[k];
        const Cell* const end = other + (axis_of(k) == 0 ? 1 : c.cells);
        for (; other < end; ++other) {
          if (other->count == 1) {
            reach(other->first, k);
            continue;
          }
          for (int s = 0; s < 8; ++s) {
            if ((kLeaving[s] >> opposite_bond(k) & 1) != 0) reach(share_with(*other, s), k);
          }
        }
      }
      continue;
    }
    unsigned leaving[kBondCount] = {};  // in each direction: points that hold on to others there
    for (int s = 0; s < 8; ++s) {
      if (c.point[s] < 0) continue;
      for (unsigned bonds = points_.bonds[c.point[s]] & kLeaving[s] & within; bonds != 0;
           bonds &= bonds - 1) {
        leaving[__builtin_ctz(bonds)] |= 1u << s;
      }
    }
    for (int k = 0; k < kBondCount; ++k) {
      if (leaving[k] == 0) continue;
      const Cell& other = cell[step_[k]];
      if (other.count == 1) {
        reach(other.first, k);
        continue;
      }
      for (unsigned points = leaving[k]; points != 0; points &= points - 1) {
        reach(share_with(other, __builtin_ctz(points) ^ 1 << axis_of(k)), k);
      }
    }
  }
  return order;
}

RegionShares::Cell RegionShares::cell_of(CellBonds of_points) {
  Cell cell;
  unsigned held = 0, missing = 0;
  for (int s = 0; s < 8; ++s) {
    const unsigned bonds = of_points >> 8 * s & 0xff;
    if (bonds == kNoPoint) {
      cell.whole = false;
      cell.faces = Cell::kUneven;
      return cell;
    }
    held |= bonds & kLeaving[s];
    missing |= ~bonds & kLeaving[s];
  }
  cell.whole = (of_points & kWithin) == kWithin;
  cell.faces = (held & missing) != 0 ? Cell::kUneven : static_cast<std::uint8_t>(held);
  return cell;
}

void RegionShares::add_cell(int x, int y, int z, const std::int32_t (&point)[8], CellBonds bonds,
                            Cell& cell) {
  cell = cell_of(bonds);
  cell.first = static_cast<std::int32_t>(all_.size());
  const auto add = [&] {
    all_.push_back({static_cast<std::int16_t>(x),
                    static_cast<std::int16_t>(y),
                    static_cast<std::int16_t>(z),
                    1,
                    0,
                    {}});
    ++cell.count;
    return std::begin(all_.back().point);
  };
  // Points that hold on to each other see the same.
  if (cell.whole || near_split_[node_at(x, y, z)] == 0) {
    std::copy_n(point, 8, add());
    return;
  }
  int first_of[8], share_of[8];  // sub-position of each share's first point; share of each point
  for (int s = 0; s < 8; ++s) {
    if (point[s] < 0) continue;
    int& i = share_of[s] = cell.count;
    for (int a = 0; a < 3; ++a) {  // that of a point before it in the cell that it holds on to
      if ((s >> a & 1) != 0 && (points_.bonds[point[s]] >> (2 - a) & 1) != 0) {
        i = share_of[s ^ 1 << a];
      }
    }
    if (i == cell.count) {
      i = 0;
      while (i < cell.count && !see_the_same(x, y, z, first_of[i], s)) ++i;
      if (i == cell.count) {
        first_of[i] = s;
        std::fill_n(add(), 8, -1);
      }
    }
    all_[cell.first + i].point[s] = point[s];
  }
}

bool RegionShares::see_the_same(int x, int y, int z, int s, int t) const {
  const auto same_at = [&](int dx, int dy, int dz) {
    const NodeFields::Split* split = split_[node_at(x + dx, y + dy, z + dz)];
    const auto field = [&](int sub) {
      return split->field_at((sub >> 2) - 2 * dz + 4,
                             bit_in_plane((sub & 1) - 2 * dx + 4, (sub >> 1 & 1) - 2 * dy + 4));
    };
    return split == nullptr || field(s) == field(t);
  };
  if (!same_at(1, 1, 1)) return false;  // where points differ the most
  for (int dz = 0; dz < 3; ++dz) {
    for (int dy = 0; dy < 3; ++dy) {
      if (split_in_row_[node_at(x, y + dy, z + dz)] == 0) continue;
      for (int dx = 0; dx < 3; ++dx) {
        if (!same_at(dx, dy, dz)) return false;
      }
    }
  }
  return true;
}

AllSeen RegionShares::seen(int x, int y, int z, int s, int bond) const {
  int first[3] = {0, 0, 0}, last[3] = {2, 2, 2};
  if (bond != kNoBond) {
    const int axis = bond < 3 ? 2 - bond : bond - 3;
    first[axis] = last[axis] = bond < 3 ? 0 : 2;
  }
  AllSeen result;
  for (int k = first[2]; k <= last[2]; ++k) {
    for (int j = first[1]; j <= last[1]; ++j) {
      const int n = node_at(x, y + j, z + k);
      if (split_in_row_[n] == 0) continue;
      // Its place in the 6 x 6 x 6 box of the row's first node (NodeFields::Split).
      const int plane = (s >> 2) - 2 * k + 4;
      const int in_plane = bit_in_plane((s & 1) + 4, (s >> 1 & 1) - 2 * j + 4);
      for (int i = first[0]; i <= last[0]; ++i) {
        const NodeFields::Split* split = split_[n + i];
        if (split == nullptr) continue;
        result.of[result.count++] = {n + i, split->field_at(plane, in_plane - 2 * i)};
      }
    }
  }
  return result;
}

}  // namespace tissue_sim
