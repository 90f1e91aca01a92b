#include "mpm/block_sheets.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "cutting/bonds.h"

namespace tissue_sim {
namespace {

/// Shares of a region's cells and the fields that each sees.
struct Shares {
  std::vector<CellShare> all;
  std::vector<std::int32_t> of_site;  ///< [2 nz][2 ny][2 nx], index into `all` or -1
  /// Split nodes that the share sees are first[i] .. first[i + 1] - 1 of these.
  std::vector<std::int32_t> first, local, seen;
};

int site_of(const BlockRegion& r, const CellShare& c, int s) {
  return ((2 * c.z + (s >> 2)) * 2 * r.ny + 2 * c.y + (s >> 1 & 1)) * 2 * r.nx + 2 * c.x + (s & 1);
}

/// The points of cell (x, y, z) of the region; false where there is none.
bool points_in(const BlockRegion& r, const LatticeBody& b, int x, int y, int z,
               std::int32_t (&point)[8]) {
  const std::ptrdiff_t row = 2 * b.nx, plane = 2 * b.ny * row;
  const std::int32_t* lowest =
      b.point_at.data() + 2 * (r.z + z) * plane + 2 * (r.y + y) * row + 2 * (r.x + x);
  bool any = false;
  for (int s = 0; s < 8; ++s) {
    point[s] = lowest[(s >> 2) * plane + (s >> 1 & 1) * row + (s & 1)];
    any = any || point[s] >= 0;
  }
  return any;
}

/// Calls f(x, y, z, points) for each cell of the region that holds any.
template <class F>
void for_each_cell(const BlockRegion& r, const LatticeBody& b, const F& f) {
  std::int32_t point[8];
  for (int z = 0; z < r.nz; ++z) {
    for (int y = 0; y < r.ny; ++y) {
      for (int x = 0; x < r.nx; ++x) {
        if (points_in(r, b, x, y, z, point)) f(x, y, z, point);
      }
    }
  }
}

CellShare share_at(int x, int y, int z) {
  CellShare c{static_cast<std::int16_t>(x),
              static_cast<std::int16_t>(y),
              static_cast<std::int16_t>(z),
              0,
              {}};
  std::fill_n(c.point, 8, -1);
  return c;
}

/// Place of a cell's points in the 6 x 6 x 6 box of each of its 27 nodes (NodeFields::Split).
struct PlaceInBox {
  std::uint8_t of[27][8] = {};
  PlaceInBox() {
    for (int k = 0; k < 27; ++k) {
      for (int s = 0; s < 8; ++s) {
        const int x = (s & 1) - 2 * (k % 3) + 4, y = (s >> 1 & 1) - 2 * (k / 3 % 3) + 4,
                  z = (s >> 2) - 2 * (k / 9) + 4;
        of[k][s] = static_cast<std::uint8_t>((z * 6 + y) * 6 + x);
      }
    }
  }
};
const PlaceInBox kPlaceInBox;

/// Whether the box gives a cell's eight points, from its lowest on, the same component.
bool is_uniform(const std::uint8_t* lowest) {
  std::uint16_t pair[4];
  for (int i = 0; i < 4; ++i) std::memcpy(&pair[i], lowest + 36 * (i / 2) + 6 * (i % 2), 2);
  return lowest[0] == lowest[1] && pair[0] == pair[1] && pair[0] == pair[2] && pair[0] == pair[3];
}

Shares shares_of(const BlockRegion& r, const LatticeBody& b,
                 const std::vector<const NodeFields::Split*>& split) {
  Shares shares;
  shares.all.reserve(static_cast<std::size_t>(r.nx) * r.ny * r.nz);
  shares.first.reserve(shares.all.capacity());
  shares.of_site.assign(static_cast<std::size_t>(8) * r.nx * r.ny * r.nz, -1);
  std::vector<std::uint8_t> any_in_row(split.size(), 0);  // in this node and the next two
  for (std::size_t n = 2; n < split.size(); ++n) {
    any_in_row[n - 2] = split[n - 2] != nullptr || split[n - 1] != nullptr || split[n] != nullptr;
  }
  for_each_cell(r, b, [&](int x, int y, int z, const std::int32_t(&point)[8]) {
    const std::size_t first_of_cell = shares.all.size();
    int local[27], k_of[27], count = 0;
    bool uniform = true;  // all of the cell's points see the same
    for (int row = 0; row < 9; ++row) {
      const int n = ((z + row / 3) * (r.ny + 2) + y + row % 3) * (r.nx + 2) + x;
      if (any_in_row[n] == 0) continue;
      for (int i = 0; i < 3; ++i) {
        if (split[n + i] == nullptr) continue;
        local[count] = n + i;
        k_of[count++] = 3 * row + i;
        uniform = uniform && is_uniform(&split[n + i]->component[kPlaceInBox.of[3 * row + i][0]]);
      }
    }
    for (int s = 0; s < 8; ++s) {
      if (point[s] < 0) continue;
      std::size_t i = first_of_cell;
      if (!uniform || i == shares.all.size()) {
        std::int32_t seen[27];
        for (int n = 0; n < count; ++n) {
          const NodeFields::Split& of = *split[local[n]];
          seen[n] = of.field[of.component[kPlaceInBox.of[k_of[n]][s]]];
        }
        while (i < shares.all.size() &&
               !std::equal(seen, seen + count, shares.seen.begin() + shares.first[i])) {
          ++i;
        }
        if (i == shares.all.size()) {
          shares.all.push_back(share_at(x, y, z));
          shares.first.push_back(static_cast<std::int32_t>(shares.seen.size()));
          shares.local.insert(shares.local.end(), local, local + count);
          shares.seen.insert(shares.seen.end(), seen, seen + count);
        }
      }
      shares.all[i].point[s] = point[s];
      shares.of_site[site_of(r, shares.all[i], s)] = static_cast<std::int32_t>(i);
    }
  });
  shares.first.push_back(static_cast<std::int32_t>(shares.seen.size()));
  return shares;
}

/// Bonds that lead out of a cell from the point at sub-position s.
constexpr unsigned leaving(int s) {
  unsigned bonds = 0;
  for (int a = 0; a < 3; ++a)
    bonds |= 1u << ((s >> a & 1) != 0 ? kForwardBond + a : kForwardBond - 1 - a);
  return bonds;
}

/// All shares that bonds within the region reach from `start`, in the order in which they do: sides
/// of a cut one after the other. Marks them as `reached`.
std::vector<std::int32_t> connected(const BlockRegion& r, const Points& points,
                                    const Shares& shares, std::int32_t start,
                                    std::vector<std::uint8_t>& reached) {
  const int sx = 2 * r.nx, sy = 2 * r.ny, sz = 2 * r.nz;
  std::vector<std::int32_t> order{start};
  reached[start] = 1;
  for (std::size_t next = 0; next < order.size(); ++next) {
    const CellShare& c = shares.all[order[next]];
    for (int s = 0; s < 8; ++s) {
      if (c.point[s] < 0) continue;
      const int x = 2 * c.x + (s & 1), y = 2 * c.y + (s >> 1 & 1), z = 2 * c.z + (s >> 2);
      // Points of a cell that are bound see the same fields: they are of one share.
      for (unsigned bonds = points.bonds[c.point[s]] & leaving(s); bonds != 0; bonds &= bonds - 1) {
        const BondOffset o = bond_offset(__builtin_ctz(bonds));
        const int i = x + o.x, j = y + o.y, k = z + o.z;
        if (i < 0 || j < 0 || k < 0 || i >= sx || j >= sy || k >= sz) continue;
        const std::int32_t other = shares.of_site[(k * sy + j) * sx + i];
        if (reached[other] != 0) continue;
        reached[other] = 1;
        order.push_back(other);
      }
    }
  }
  return order;
}

bool fits(const Shares& shares, std::int32_t share, const Sheet& sheet) {
  for (int i = shares.first[share]; i < shares.first[share + 1]; ++i) {
    const int there = sheet.node[shares.local[i]];
    if (there != -1 && there != shares.seen[i]) return false;
  }
  return true;
}

void put(const Shares& shares, std::int32_t share, Sheet& sheet) {
  for (int i = shares.first[share]; i < shares.first[share + 1]; ++i) {
    sheet.node[shares.local[i]] = shares.seen[i];
  }
  sheet.cells.push_back(shares.all[share]);
}

/// Puts all the shares or, where not all fit, none; returns which.
bool put_all(const Shares& shares, const std::vector<std::int32_t>& part, Sheet& sheet) {
  if (!std::all_of(part.begin(), part.end(),
                   [&](std::int32_t share) { return fits(shares, share, sheet); })) {
    return false;
  }
  Sheet trial = sheet;  // they may not fit with one another
  for (const std::int32_t share : part) {
    if (!fits(shares, share, trial)) return false;
    put(shares, share, trial);
  }
  sheet = std::move(trial);
  return true;
}

void count_points(Sheet& sheet) {
  for (CellShare& c : sheet.cells) {
    c.count = static_cast<std::int16_t>(8 - std::count(c.point, c.point + 8, -1));
  }
}

}  // namespace

std::vector<Sheet> sheets_of(const BlockRegion& r, const LatticeBody& b, const Points& points,
                             const NodeFields& fields) {
  const int px = r.nx + 2, py = r.ny + 2, pz = r.nz + 2;
  std::vector<const NodeFields::Split*> split(static_cast<std::size_t>(px) * py * pz, nullptr);
  bool any = false;
  for (int z = 0, n = 0; z < pz; ++z) {
    for (int y = 0; y < py; ++y) {
      for (int x = 0; x < px; ++x, ++n) {
        split[n] = fields.split(b.node(r.x + x - 1, r.y + y - 1, r.z + z - 1));
        any = any || split[n] != nullptr;
      }
    }
  }
  if (!any) {
    Sheet whole;
    for_each_cell(r, b, [&whole](int x, int y, int z, const std::int32_t(&point)[8]) {
      whole.cells.push_back(share_at(x, y, z));
      std::copy_n(point, 8, whole.cells.back().point);
    });
    count_points(whole);
    return {whole};
  }
  const Shares shares = shares_of(r, b, split);
  std::vector<std::uint8_t> reached(shares.all.size(), 0);
  std::vector<Sheet> sheets;
  for (std::int32_t start = 0; start < static_cast<std::int32_t>(shares.all.size()); ++start) {
    if (reached[start] != 0) continue;
    const std::vector<std::int32_t> part = connected(r, points, shares, start, reached);
    if (std::any_of(sheets.begin(), sheets.end(),
                    [&](Sheet& sheet) { return put_all(shares, part, sheet); })) {
      continue;
    }
    const std::size_t first = sheets.size();
    for (const std::int32_t share : part) {
      auto sheet = std::find_if(sheets.begin() + first, sheets.end(),
                                [&](const Sheet& s) { return fits(shares, share, s); });
      if (sheet == sheets.end()) {
        sheets.emplace_back();
        sheet = sheets.end() - 1;
        sheet->node.assign(split.size(), -1);
      }
      put(shares, share, *sheet);
    }
  }
  for (Sheet& sheet : sheets) count_points(sheet);
  return sheets;
}

}  // namespace tissue_sim
