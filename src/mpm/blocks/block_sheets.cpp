
#include <algorithm>
#include <iterator>
#include <utility>

#include "mpm/blocks/region_shares.h"

namespace tissue_sim {
namespace {

/// What a set of shares sees of the region's nodes.
struct NodesSeen {
  std::vector<std::int32_t> node;  // as Sheet::node
  std::vector<Seen> seen;

  /// False where they see different fields of a node.
  bool add(const AllSeen& more) {
    for (const Seen& s : more) {
      if (node[s.local] == s.field) continue;
      if (node[s.local] != -1) return false;
      node[s.local] = s.field;
      seen.push_back(s);
    }
    return true;
  }
  void clear() {
    for (const Seen& s : seen) node[s.local] = -1;
    seen.clear();
  }
};

template <class AnySeen>
bool fits(const AnySeen& seen, const Sheet& sheet) {
  return std::all_of(std::begin(seen), std::end(seen), [&](const Seen& s) {
    return sheet.node[s.local] == -1 || sheet.node[s.local] == s.field;
  });
}

template <class AnySeen>
Sheet& sheet_for(const AnySeen& seen, std::size_t first, std::size_t node_count,
                 std::vector<Sheet>& sheets) {
  auto sheet = std::find_if(sheets.begin() + static_cast<std::ptrdiff_t>(first), sheets.end(),
                            [&](const Sheet& s) { return fits(seen, s); });
  if (sheet == sheets.end()) {
    sheets.emplace_back();
    sheet = sheets.end() - 1;
    sheet->node.assign(node_count, -1);
  }
  for (const Seen& s : seen) sheet->node[s.local] = s.field;
  return *sheet;
}

void count_points(Sheet& sheet) {
  for (CellShare& c : sheet.cells) {
    c.count = static_cast<std::int16_t>(8 - std::count(c.point, c.point + 8, -1));
  }
}

}  // namespace

std::vector<Sheet> sheets_of(const BlockRegion& r, const LatticeBody& b, const Points& points,
                             const NodeFields& fields) {
  const RegionShares shares(r, b, points, fields);
  const auto count = static_cast<std::int32_t>(shares.count());
  std::vector<Sheet> sheets;
  std::vector<std::uint8_t> reached(count, 0);
  NodesSeen whole_part{std::vector<std::int32_t>(shares.node_count(), -1), {}};
  if (!shares.any_split()) {
    sheets.emplace_back();
    for (std::int32_t i = 0; i < count; ++i) sheets[0].cells.push_back(shares[i]);
  }
  for (std::int32_t start = 0; shares.any_split() && start < count; ++start) {
    if (reached[start] != 0) continue;
    const std::vector<RegionShares::Reached> part = shares.connected(start, reached);
    whole_part.clear();
    if (std::all_of(part.begin(), part.end(), [&](const RegionShares::Reached& r) {
          return whole_part.add(shares.seen(r));
        })) {
      Sheet& sheet = sheet_for(whole_part.seen, 0, shares.node_count(), sheets);
      sheet.cells.reserve(sheet.cells.size() + part.size());
      for (const RegionShares::Reached& r : part) sheet.cells.push_back(shares[r.share]);
      continue;
    }
    const std::size_t first = sheets.size();
    for (const RegionShares::Reached& r : part) {
      const AllSeen seen = shares.seen({r.share, RegionShares::kNoBond});
      sheet_for(seen, first, shares.node_count(), sheets).cells.push_back(shares[r.share]);
    }
  }
  for (Sheet& sheet : sheets) count_points(sheet);
  return sheets;
}

}  // namespace tissue_sim
