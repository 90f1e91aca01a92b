// Pieces after a cut, from what is around the bonds that broke: most cuts leave all in one piece or
// take a crumb off.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <unordered_map>

#include "cutting/bonds.h"
#include "fragments/pieces.h"

namespace tissue_sim {
namespace {

constexpr int kFew = 256;  // points that are followed before a part is large

/// Small parts around the points that lost bonds.
class SmallParts {
 public:
  SmallParts(const std::vector<LatticeBody>& bodies, const Points& points)
      : bodies_(bodies), points_(points) {}

  /// Follows the bonds from a point, until they end or lead to what is large.
  void follow(std::int32_t from) {
    if (part_of_.count(from) > 0) return;
    const int part = static_cast<int>(all_.size());
    std::vector<std::int32_t> reached = {from};
    part_of_[from] = part;
    bool large = false;
    for (std::size_t i = 0; i < reached.size() && !large; ++i) {
      const Points::Site& s = points_.site[reached[i]];
      for (unsigned bonds = points_.bonds[reached[i]]; bonds != 0; bonds &= bonds - 1) {
        const BondOffset o = bond_offset(__builtin_ctz(bonds));
        const std::int32_t next = bodies_[s.body].point(s.x + o.x, s.y + o.y, s.z + o.z);
        const auto [at, is_new] = part_of_.emplace(next, part);
        if (is_new) reached.push_back(next);
        large = large || at->second == kLarge;
      }
      large = large || reached.size() > kFew;
    }
    if (large) {
      for (const std::int32_t p : reached) part_of_[p] = kLarge;
      return;
    }
    std::sort(reached.begin(), reached.end());
    all_.push_back(std::move(reached));
  }
  bool is_small(std::int32_t point) const {
    const auto found = part_of_.find(point);
    return found != part_of_.end() && found->second != kLarge;
  }
  /// Each with its points in order.
  const std::vector<std::vector<std::int32_t>>& all() const { return all_; }

 private:
  static constexpr int kLarge = -1;
  const std::vector<LatticeBody>& bodies_;
  const Points& points_;
  std::unordered_map<std::int32_t, int> part_of_;
  std::vector<std::vector<std::int32_t>> all_;
};

/// Whether the ends of a broken bond hold together by a way around, close by.
class WayAround {
 public:
  WayAround(const Points& points) : points_(points) {}

  bool leads(const LatticeBody& body, const Points::Site& from, const BondOffset& to) {
    const int goal = place(to.x, to.y, to.z);
    int count = 0;
    ++search_;
    way_[count++] = place(0, 0, 0);
    seen_[way_[0]] = search_;
    for (int i = 0; i < count && seen_[goal] != search_; ++i) {
      const int x = way_[i] % kWidth - kReach, y = way_[i] / kWidth % kWidth - kReach,
                z = way_[i] / (kWidth * kWidth) - kReach;
      const std::int32_t at = body.point(from.x + x, from.y + y, from.z + z);
      for (unsigned bonds = points_.bonds[at]; bonds != 0; bonds &= bonds - 1) {
        const BondOffset o = bond_offset(__builtin_ctz(bonds));
        const int next[3] = {x + o.x, y + o.y, z + o.z};
        if (std::max({std::abs(next[0]), std::abs(next[1]), std::abs(next[2])}) > kReach) continue;
        std::int32_t& seen = seen_[place(next[0], next[1], next[2])];
        if (seen == search_) continue;
        seen = search_;
        way_[count++] = place(next[0], next[1], next[2]);
      }
    }
    return seen_[goal] == search_;
  }

 private:
  static constexpr int kReach = 4, kWidth = 2 * kReach + 1, kCount = kWidth * kWidth * kWidth;
  static int place(int x, int y, int z) {
    return ((z + kReach) * kWidth + y + kReach) * kWidth + x + kReach;
  }
  const Points& points_;
  std::int32_t search_ = 0;
  std::vector<std::int32_t> seen_ = std::vector<std::int32_t>(kCount, 0);  // in which search
  std::vector<std::int32_t> way_ = std::vector<std::int32_t>(kCount);
};

/// Whether the bonds that broke between points of a piece left all large parts of it in one.
bool large_parts_hold(const std::vector<LatticeBody>& bodies, const Points& points,
                      const std::vector<std::int32_t>& changed, const Pieces& pieces,
                      const SmallParts& parts) {
  WayAround way(points);
  for (const std::int32_t p : changed) {
    const Points::Site& s = points.site[p];
    const LatticeBody& body = bodies[s.body];
    const unsigned broken = whole_bonds(body, s) & ~unsigned{points.bonds[p]};
    for (unsigned left = broken >> kForwardBond; left != 0; left &= left - 1) {
      const BondOffset to = bond_offset(kForwardBond + __builtin_ctz(left));
      const std::int32_t q = body.point(s.x + to.x, s.y + to.y, s.z + to.z);
      if (pieces.of_point[p] != pieces.of_point[q]) continue;  // parted before
      if (parts.is_small(p) || parts.is_small(q)) continue;
      if (!way.leads(body, s, to)) return false;
    }
  }
  return true;
}

}  // namespace

std::vector<int> update_pieces(const std::vector<LatticeBody>& bodies, const Points& points,
                               const std::vector<std::int32_t>& changed, Pieces& pieces) {
  SmallParts parts(bodies, points);
  for (const std::int32_t p : changed) parts.follow(p);
  if (!large_parts_hold(bodies, points, changed, pieces, parts)) {
    return update_pieces(bodies, points, pieces);
  }
  std::unordered_map<int, std::size_t> index;  // of pieces, by id
  for (std::size_t i = 0; i < pieces.all.size(); ++i) index[pieces.all[i].id] = i;
  std::vector<const std::vector<std::int32_t>*> off;
  std::unordered_map<int, int> left;  // points of a piece without its small parts
  for (const auto& part : parts.all()) {
    const int id = pieces.of_point[part.front()];
    const Fragment& piece = pieces.all[index[id]];
    if (piece.point_count == static_cast<int>(part.size())) continue;  // it was a piece before
    left.emplace(id, piece.point_count).first->second -= static_cast<int>(part.size());
    off.push_back(&part);
  }
  for (const auto* part : off) {
    // What is left must be the largest part, and hold on to all anchors that there were.
    const bool anchored = std::any_of(part->begin(), part->end(),
                                      [&](std::int32_t p) { return points.anchored[p] != 0; });
    if (anchored || left[pieces.of_point[part->front()]] <= static_cast<int>(part->size())) {
      return update_pieces(bodies, points, pieces);
    }
  }
  std::sort(off.begin(), off.end(), [&](const auto* a, const auto* b) {
    const int p = pieces.of_point[a->front()], q = pieces.of_point[b->front()];
    return p != q ? p < q : a->front() < b->front();
  });
  std::vector<int> fresh;
  for (const auto* part : off) {
    Fragment f;
    f.id = pieces.next_id++;
    f.parent = pieces.of_point[part->front()];
    f.body = points.site[part->front()].body;
    f.loose = true;
    f.point_count = static_cast<int>(part->size());
    f.volume = 0;
    for (const std::int32_t p : *part) {
      f.volume += points.volume[p];
      pieces.of_point[p] = f.id;
    }
    Fragment& rest = pieces.all[index[f.parent]];
    rest.point_count -= f.point_count;
    rest.volume -= f.volume;
    fresh.push_back(f.id);
    pieces.all.push_back(f);
  }
  return fresh;
}

}  // namespace tissue_sim
