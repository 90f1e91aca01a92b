// Where vertices lie that others may touch.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <tuple>
#include <vector>

#include "tissue_sim/scene.h"

namespace tissue_sim {
namespace pbd {

/// Cells of lattices and the vertices in them: of a fine lattice, or for a box that has more than
/// kMostCells there, as of tissue that nothing holds in shape, of one as coarse as it takes.
class TouchCells {
 public:
  /// A vertex where all that is asked of it lies side by side.
  struct Entry {
    float x[3], normal[3];
    std::int32_t vertex, piece;
  };

  explicit TouchCells(double size) : size_(size) {}
  static Entry entry(std::int32_t vertex, std::int32_t piece, const Vec3& x, const Vec3& normal) {
    const Eigen::Vector3f at = x.cast<float>(), n = normal.stableNormalized().cast<float>();
    return {{at[0], at[1], at[2]}, {n[0], n[1], n[2]}, vertex, piece};
  }
  void add(const std::vector<Entry>& entries) {
    entries_.insert(entries_.end(), entries.begin(), entries.end());
  }
  bool empty() const { return entries_.empty(); }
  /// Which lattice a box is to be looked up in; -1 for none.
  int level_of(const Vec3& low, const Vec3& high) const {
    if (!low.allFinite() || !high.allFinite()) return -1;
    int level = 0;
    for (double size = size_; cells(size, low, high) > kMostCells; size *= 2) ++level;
    return level;
  }
  /// Before it is looked up in.
  void fill(int level) {
    if (static_cast<int>(levels_.size()) <= level) levels_.resize(level + 1);
    if (levels_[level].begin.empty()) fill(std::ldexp(size_, level), levels_[level]);
  }
  /// Vertices of other pieces in the cells that a box overlaps.
  template <class F>
  void each_in(int level, const Vec3& low, const Vec3& high, std::int32_t piece,
               const F& of) const {
    const Level& l = levels_[level];
    const double size = std::ldexp(size_, level);
    std::int64_t first[3], last[3];
    for (int a = 0; a < 3; ++a) {
      first[a] = cell(size, low[a]);
      last[a] = cell(size, high[a]);
    }
    for (std::int64_t i = first[0]; i <= last[0]; ++i) {
      for (std::int64_t j = first[1]; j <= last[1]; ++j) {
        for (std::int64_t k = first[2]; k <= last[2]; ++k) {
          const std::size_t slot = l.slot(i, j, k);
          for (std::int32_t r = l.begin[slot]; r < l.begin[slot + 1]; ++r) {
            const Run& run = l.runs[r];
            if (run.piece == piece || run.cell != key(i, j, k)) continue;
            for (std::int32_t e = run.begin; e < run.end; ++e) of(l.entries[e]);
          }
        }
      }
    }
  }

 private:
  static constexpr double kMostCells = 216;
  /// What a cell has of a piece.
  struct Run {
    std::uint64_t cell;
    std::int32_t piece, begin, end;
  };
  struct Level {
    std::vector<Entry> entries;       ///< by slot, then by cell, then by piece
    std::vector<Run> runs;            ///< in that order
    std::vector<std::int32_t> begin;  ///< first run of each slot, and the number of runs
    int bits = 1;                     ///< of each of a cell's numbers, in its slot

    /// Cells side by side have slots side by side; those far apart share them.
    std::size_t slot(std::int64_t i, std::int64_t j, std::int64_t k) const {
      const std::int64_t mask = (std::int64_t{1} << bits) - 1;
      return static_cast<std::size_t>((i & mask) << 2 * bits | (j & mask) << bits | (k & mask));
    }
  };
  static std::uint64_t key(std::int64_t i, std::int64_t j, std::int64_t k) {
    const auto part = [](std::int64_t v) { return static_cast<std::uint64_t>(v) & 0x1fffff; };
    return part(i) << 42 | part(j) << 21 | part(k);
  }
  static std::int64_t cell(double size, double x) {
    const double at = std::max(-1e15, std::min(1e15, x / size));
    const auto towards_zero = static_cast<std::int64_t>(at);  // std::floor() would be a call
    return towards_zero - (at < static_cast<double>(towards_zero) ? 1 : 0);
  }
  static double cells(double size, const Vec3& low, const Vec3& high) {
    double product = 1;
    for (int a = 0; a < 3; ++a)
      product *= 1.0 + static_cast<double>(cell(size, high[a]) - cell(size, low[a]));
    return product;
  }
  void fill(double size, Level& level) const {
    while (level.bits < 7 && std::size_t{1} << 3 * level.bits < entries_.size()) ++level.bits;
    struct Key {
      std::size_t slot;
      std::uint64_t cell;
      std::int32_t piece, entry;
      bool operator<(const Key& o) const {
        return std::tie(cell, piece, entry) < std::tie(o.cell, o.piece, o.entry);
      }
    };
    const std::size_t slots = std::size_t{1} << 3 * level.bits;
    std::vector<Key> keys, found;
    std::vector<std::int32_t> end(slots + 1, 0);  // of the keys of each slot
    found.reserve(entries_.size());
    for (const Entry& e : entries_) {
      const std::int64_t i = cell(size, e.x[0]), j = cell(size, e.x[1]), k = cell(size, e.x[2]);
      found.push_back(
          {level.slot(i, j, k), key(i, j, k), e.piece, static_cast<std::int32_t>(found.size())});
      ++end[found.back().slot + 1];
    }
    for (std::size_t slot = 1; slot <= slots; ++slot) end[slot] += end[slot - 1];
    keys.resize(found.size());
    for (const Key& k : found) keys[end[k.slot]++] = k;
    for (std::size_t slot = 0; slot < slots; ++slot) {
      std::sort(keys.begin() + (slot > 0 ? end[slot - 1] : 0), keys.begin() + end[slot]);
    }
    level.begin.assign(slots + 1, 0);
    for (const Key& k : keys) {
      const auto at = static_cast<std::int32_t>(level.entries.size());
      if (level.runs.empty() || level.runs.back().cell != k.cell ||
          level.runs.back().piece != k.piece) {
        level.runs.push_back({k.cell, k.piece, at, at});
        ++level.begin[k.slot + 1];
      }
      level.entries.push_back(entries_[k.entry]);
      level.runs.back().end = at + 1;
    }
    for (std::size_t slot = 1; slot < level.begin.size(); ++slot) {
      level.begin[slot] += level.begin[slot - 1];
    }
  }

  double size_;  ///< of the finest lattice's cells [m]
  std::vector<Entry> entries_;
  std::vector<Level> levels_;
};

}  // namespace pbd
}  // namespace tissue_sim
