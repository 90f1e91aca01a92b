#include "mpm/region_shares.h"

#include <algorithm>
#include <iterator>
#include <numeric>

namespace tissue_sim {
namespace {

/// Bonds that lead out of a cell from the point at sub-position s.
constexpr unsigned leaving(int s) {
  unsigned bonds = 0;
  for (int a = 0; a < 3; ++a)
    bonds |= 1u << ((s >> a & 1) != 0 ? kForwardBond + a : kForwardBond - 1 - a);
  return bonds;
}

}  // namespace

RegionShares::RegionShares(const BlockRegion& r, const LatticeBody& b, const Points& points,
                           const NodeFields& fields)
    : r_(r), points_(points), step_{-r.nx * r.ny, -r.nx, -1, 1, r.nx, r.nx * r.ny} {
  const int px = r.nx + 2, py = r.ny + 2, pz = r.nz + 2;
  const std::size_t n = static_cast<std::size_t>(px) * py * pz;
  split_.resize(n);
  for (int z = 0; z < pz; ++z) {
    for (int y = 0; y < py; ++y) {
      const int row = (z * py + y) * px, x0 = r.x - 1;
      b.for_each_node_in_row(x0, x0 + px, r.y + y - 1, r.z + z - 1,
                             [&](int x, int node, int count, int) {
                               for (int i = 0; i < count; ++i) {
                                 const NodeFields::Split* split = fields.split(node + i);
                                 split_[row + x - x0 + i] = split;
                                 any_split_ = any_split_ || split != nullptr;
                               }
                             });
    }
  }
  split_in_row_.assign(n, 0);
  for (std::size_t i = 0; any_split_ && i + 2 < n; ++i) {
    split_in_row_[i] = split_[i] != nullptr || split_[i + 1] != nullptr || split_[i + 2] != nullptr;
  }
  near_split_ = split_in_row_;
  for (const int step : {px, px * py}) {
    for (std::size_t i = 0; any_split_ && i + 2 * step < n; ++i) {
      near_split_[i] |= near_split_[i + step] | near_split_[i + 2 * step];
    }
  }
  cells_.resize(static_cast<std::size_t>(r.nx) * r.ny * r.nz);
  all_.reserve(cells_.size());
  const int row = 2 * r.nx, plane = 2 * r.ny * row;
  std::vector<std::int32_t> point_at(8 * cells_.size(), -1);
  for (int z = 0; z < 2 * r.nz; ++z) {
    for (int y = 0; y < 2 * r.ny; ++y) {
      b.for_each_point_in_row(
          2 * r.x, 2 * r.x + row, 2 * r.y + y, 2 * r.z + z, [&](int x, int point, int count) {
            const auto to = point_at.begin() + z * plane + y * row + x - 2 * r.x;
            std::iota(to, to + count, point);
          });
    }
  }
  std::size_t cell = 0;
  for (int z = 0; z < r.nz; ++z) {
    for (int y = 0; y < r.ny; ++y) {
      for (int x = 0; x < r.nx; ++x, ++cell) {
        const std::int32_t* lowest = point_at.data() + 2 * z * plane + 2 * y * row + 2 * x;
        std::int32_t point[8];
        bool any = false;
        for (int s = 0; s < 8; ++s) {
          point[s] = lowest[(s >> 2) * plane + (s >> 1 & 1) * row + (s & 1)];
          any = any || point[s] >= 0;
        }
        if (any) add_cell(x, y, z, point, cells_[cell]);
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
    const Cell& cell = cells_[(c.z * r_.ny + c.y) * r_.nx + c.x];
    if (has_even_faces(cell)) {
      // In the order of the points' bonds.
      for (unsigned faces = cell.faces; faces != 0; faces &= faces - 1) {
        const int k = __builtin_ctz(faces);
        reach((&cell)[step_[k]].first, k);
      }
      continue;
    }
    for (int s = 0; s < 8; ++s) {
      if (c.point[s] < 0) continue;
      // Points of a cell that are bound see the same fields: they are of one share.
      for (unsigned bonds = points_.bonds[c.point[s]] & leaving(s); bonds != 0;
           bonds &= bonds - 1) {
        const int k = __builtin_ctz(bonds);
        const Cell* other = next_cell(c, k);
        if (other == nullptr) continue;
        const int axis = k < 3 ? 2 - k : k - 3;
        std::int32_t share = other->first;
        while (all_[share].point[s ^ 1 << axis] < 0) ++share;
        reach(share, k);
      }
    }
  }
  return order;
}

RegionShares::Cell RegionShares::cell_of(int x, int y, int z,
                                         const std::int32_t (&point)[8]) const {
  Cell cell;
  unsigned held = 0, missing = 0;
  for (int s = 0; s < 8; ++s) {
    if (point[s] < 0) {
      cell.whole = false;
      cell.faces = Cell::kUneven;
      return cell;
    }
    const unsigned bonds = points_.bonds[point[s]];
    held |= bonds & leaving(s);
    missing |= ~bonds & leaving(s);
    cell.whole = cell.whole && (bonds | leaving(s)) == kAllBonds;
  }
  const bool within[kBondCount] = {z > 0,         y > 0,         x > 0,
                                   x + 1 < r_.nx, y + 1 < r_.ny, z + 1 < r_.nz};
  for (int k = 0; k < kBondCount; ++k) held &= ~(within[k] ? 0 : 1u << k);
  cell.faces = (held & missing) != 0 ? Cell::kUneven : static_cast<std::uint8_t>(held);
  return cell;
}

void RegionShares::add_cell(int x, int y, int z, const std::int32_t (&point)[8], Cell& cell) {
  cell = cell_of(x, y, z, point);
  cell.first = static_cast<std::int32_t>(all_.size());
  const auto add = [&] {
    all_.push_back({static_cast<std::int16_t>(x),
                    static_cast<std::int16_t>(y),
                    static_cast<std::int16_t>(z),
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
  constexpr int kMiddle = 13;  // where points differ the most
  for (int i = 0; i < 27; ++i) {
    const int k = (i + kMiddle) % 27, dx = k % 3, dy = k / 3 % 3, dz = k / 9;
    const NodeFields::Split* split = split_[node_at(x + dx, y + dy, z + dz)];
    const auto field = [&](int sub) {
      return split->field_at((sub >> 2) - 2 * dz + 4,
                             bit_in_plane((sub & 1) - 2 * dx + 4, (sub >> 1 & 1) - 2 * dy + 4));
    };
    if (split != nullptr && field(s) != field(t)) return false;
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

const RegionShares::Cell* RegionShares::next_cell(const CellShare& c, int bond) const {
  const BondOffset o = bond_offset(bond);
  const int x = c.x + o.x, y = c.y + o.y, z = c.z + o.z;
  if (x < 0 || y < 0 || z < 0 || x >= r_.nx || y >= r_.ny || z >= r_.nz) return nullptr;
  return &cells_[(z * r_.ny + y) * r_.nx + x];
}

bool RegionShares::has_even_faces(const Cell& cell) const {
  if (cell.faces == Cell::kUneven || cell.count != 1) return false;
  for (unsigned faces = cell.faces; faces != 0; faces &= faces - 1) {
    if ((&cell)[step_[__builtin_ctz(faces)]].count != 1) return false;
  }
  return true;
}

}  // namespace tissue_sim
