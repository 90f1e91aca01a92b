#include "mpm/block_sheets.h"

#include <algorithm>

#include "cutting/bonds.h"

namespace tissue_sim {
namespace {

std::vector<Placed> points_of(const BlockRegion& r, const LatticeBody& b) {
  std::vector<Placed> result;
  for (int z = 0; z < 2 * r.nz; ++z) {
    for (int y = 0; y < 2 * r.ny; ++y) {
      for (int x = 0; x < 2 * r.nx; ++x) {
        const int p = b.point(2 * r.x + x, 2 * r.y + y, 2 * r.z + z);
        if (p < 0) continue;
        result.push_back({p, static_cast<std::int16_t>(x / 2), static_cast<std::int16_t>(y / 2),
                          static_cast<std::int16_t>(z / 2),
                          static_cast<std::int16_t>((x & 1) + 2 * (y & 1) + 4 * (z & 1))});
      }
    }
  }
  return result;
}

/// The points in the order in which the bonds reach them: sides of a cut one after the other.
std::vector<Placed> by_connection(const BlockRegion& r, const Points& points,
                                  const std::vector<Placed>& all) {
  const int sx = 2 * r.nx, sy = 2 * r.ny, sz = 2 * r.nz;
  std::vector<std::int32_t> at(static_cast<std::size_t>(sx) * sy * sz, -1);  // index into `all`
  const auto site = [sx, sy](int x, int y, int z) { return (z * sy + y) * sx + x; };
  const auto place = [](const Placed& p, int axis) {
    const int cell = axis == 0 ? p.x : axis == 1 ? p.y : p.z;
    return 2 * cell + (p.s >> axis & 1);
  };
  for (std::size_t i = 0; i < all.size(); ++i) {
    at[site(place(all[i], 0), place(all[i], 1), place(all[i], 2))] = static_cast<std::int32_t>(i);
  }
  std::vector<Placed> order;
  order.reserve(all.size());
  for (std::size_t start = 0; start < all.size(); ++start) {
    std::int32_t& first =
        at[site(place(all[start], 0), place(all[start], 1), place(all[start], 2))];
    if (first < 0) continue;
    first = -1;
    std::size_t next = order.size();
    order.push_back(all[start]);
    for (; next < order.size(); ++next) {
      const Placed p = order[next];
      for (unsigned bonds = points.bonds[p.point]; bonds != 0; bonds &= bonds - 1) {
        const BondOffset o = bond_offset(__builtin_ctz(bonds));
        const int x = place(p, 0) + o.x, y = place(p, 1) + o.y, z = place(p, 2) + o.z;
        if (x < 0 || y < 0 || z < 0 || x >= sx || y >= sy || z >= sz) continue;
        std::int32_t& neighbour = at[site(x, y, z)];
        if (neighbour < 0) continue;
        order.push_back(all[neighbour]);
        neighbour = -1;
      }
    }
  }
  return order;
}

}  // namespace

std::vector<Sheet> sheets_of(const BlockRegion& r, const LatticeBody& b, const Points& points,
                             const NodeFields& fields) {
  const int px = r.nx + 2, py = r.ny + 2, pz = r.nz + 2;
  std::vector<const NodeFields::Split*> split(px * py * pz, nullptr);
  bool any = false;
  for (int z = 0, n = 0; z < pz; ++z) {
    for (int y = 0; y < py; ++y) {
      for (int x = 0; x < px; ++x, ++n) {
        split[n] = fields.split(b.node(r.x + x - 1, r.y + y - 1, r.z + z - 1));
        any = any || split[n] != nullptr;
      }
    }
  }
  std::vector<Sheet> sheets(1);
  if (!any) {
    sheets[0].points = points_of(r, b);
    return sheets;
  }
  sheets[0].node.assign(split.size(), -1);
  for (const Placed& p : by_connection(r, points, points_of(r, b))) {
    int local[27], seen[27], count = 0;
    for (int k = 0; k < 27; ++k) {
      const int x = p.x + k % 3, y = p.y + k / 3 % 3, z = p.z + k / 9;
      const int n = (z * py + y) * px + x;
      if (split[n] == nullptr) continue;
      local[count] = n;
      seen[count++] =
          split[n]->seen_by(points.site[p.point], r.x + x - 1, r.y + y - 1, r.z + z - 1);
    }
    const auto fits = [&](const Sheet& sheet) {
      for (int i = 0; i < count; ++i) {
        const int there = sheet.node[local[i]];
        if (there != -1 && there != seen[i]) return false;
      }
      return true;
    };
    auto sheet = std::find_if(sheets.begin(), sheets.end(), fits);
    if (sheet == sheets.end()) {
      sheets.emplace_back();
      sheet = sheets.end() - 1;
      sheet->node.assign(split.size(), -1);
    }
    for (int i = 0; i < count; ++i) sheet->node[local[i]] = seen[i];
    sheet->points.push_back(p);
  }
  return sheets;
}

}  // namespace tissue_sim
