// Numbers of the places of a lattice of which only some are there.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace tissue_sim {

/// Places in rows along x, each of which has some stretches. Numbered from 0 on, x fastest, then y,
/// then z: those of a stretch follow one another.
class LatticeRows {
 public:
  struct Stretch {
    int begin, end;  ///< x of its places
    int first;       ///< number of the one at `begin`
  };

  /// Without places; y from `lowest` to `lowest` + ny - 1 and z from `lowest` on.
  explicit LatticeRows(int lowest = 0, int ny = 0) : lowest_(lowest), ny_(ny) {}
  /// Goes on to the next row, y fastest. The first one, too, has to be started.
  void start_row() { first_.push_back(first_.back()); }
  /// Adds places begin .. end - 1 to the row, behind those that it has.
  void add(int begin, int end) {
    const bool joins = first_.back() > first_[first_.size() - 2] && stretches_.back().end == begin;
    if (joins) {
      stretches_.back().end = end;
    } else {
      stretches_.push_back({begin, end, count_});
      ++first_.back();
    }
    count_ += end - begin;
  }

  int count() const { return count_; }
  /// Number of a place, -1 where there is none.
  int number(int x, int y, int z) const {
    int result = -1;
    for_each_in_row(x, x + 1, y, z, [&](int, int number, int) { result = number; });
    return result;
  }
  /// Calls f(x, number, count) for the places x_begin .. x_end - 1 of a row that are there: `count`
  /// of them from x on, with numbers from `number` on.
  template <class F>
  void for_each_in_row(int x_begin, int x_end, int y, int z, const F& f) const {
    y -= lowest_;
    z -= lowest_;
    if (y < 0 || z < 0 || y >= ny_) return;
    const std::size_t row = static_cast<std::size_t>(z) * ny_ + y;
    if (row + 1 >= first_.size()) return;
    for (int i = first_[row]; i < first_[row + 1]; ++i) {
      const Stretch& s = stretches_[i];
      const int begin = std::max(x_begin, s.begin), end = std::min(x_end, s.end);
      if (begin < end) f(begin, s.first + begin - s.begin, end - begin);
    }
  }

 private:
  int lowest_, ny_, count_ = 0;
  std::vector<int> first_ = {0};  ///< stretches of each row, and their end
  std::vector<Stretch> stretches_;
};

}  // namespace tissue_sim
