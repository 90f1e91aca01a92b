// Checks of a state that was read: bags and files come from strangers, and what indices, counts and
// places say is believed from there on. All throw std::runtime_error with what is wrong.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "fragments/pieces.h"
#include "tissue_sim/scene.h"

namespace tissue_sim {

inline void check_state(bool right, const char* what) {
  if (!right) {
    throw std::runtime_error(std::string("the state cannot be restored: its ") + what +
                             " cannot be so");
  }
}

/// That all of `indices`, or of their elements, lie from `begin` to before `end`.
template <class Indices>
void check_indices(const Indices& indices, std::int64_t begin, std::int64_t end, const char* what) {
  for (const auto& i : indices) {
    if constexpr (std::is_integral_v<std::decay_t<decltype(i)>>) {
      check_state(static_cast<std::int64_t>(i) >= begin && static_cast<std::int64_t>(i) < end,
                  what);
    } else {
      check_indices(i, begin, end, what);
    }
  }
}

/// That numbers are finite and less than `most`.
template <class Numbers>
void check_numbers(const Numbers& numbers, double most, const char* what) {
  for (const auto& x : numbers) {
    if constexpr (std::is_arithmetic_v<std::decay_t<decltype(x)>>) {
      check_state(std::abs(static_cast<double>(x)) <= most, what);  // nor is NaN
    } else {
      check_numbers(x, most, what);
    }
  }
}

/// That there are as many of each as of the first.
template <class First, class... Others>
void check_sizes(const char* what, const First& first, const Others&... others) {
  check_state(((others.size() == first.size()) && ...), what);
}

/// That `first` says where the `count` elements of each of `of` begin, and ends with their number.
template <class Index>
void check_begins(const std::vector<Index>& first, std::size_t of, std::size_t count,
                  const char* what) {
  check_state(first.size() == of + 1 && first.front() == 0 &&
                  static_cast<std::size_t>(first.back()) == count,
              what);
  for (std::size_t i = 0; i < of; ++i) check_state(first[i] <= first[i + 1], what);
}

inline constexpr double kFarthest = 1e4, kFastestTissue = 1e6;  ///< of what is there [m, m/s]

inline void check_pieces(const Pieces& pieces, std::size_t points, std::size_t bodies) {
  const auto count = static_cast<std::int64_t>(pieces.all.size());
  check_state(pieces.of_point.size() == points && pieces.next_id == count &&
                  pieces.lowest.size() == pieces.all.size(),
              "pieces");
  check_indices(pieces.of_point, 0, count, "pieces");
  check_indices(pieces.lowest, -1, static_cast<std::int64_t>(points), "pieces");
  check_indices(pieces.anchored, 0, static_cast<std::int64_t>(points), "anchored points");
  for (std::int64_t i = 0; i < count; ++i) {
    const Fragment& f = pieces.all[static_cast<std::size_t>(i)];
    check_state(f.id == i && f.parent >= -1 && f.parent < count && f.body >= 0 &&
                    static_cast<std::size_t>(f.body) < bodies && f.point_count >= 0 &&
                    static_cast<std::size_t>(f.point_count) <= points,
                "pieces");
  }
  std::vector<std::int32_t> points_of(pieces.all.size(), 0);
  for (const std::int32_t piece : pieces.of_point) ++points_of[static_cast<std::size_t>(piece)];
  for (std::size_t i = 0; i < points_of.size(); ++i) {
    check_state(points_of[i] == pieces.all[i].point_count, "pieces");
    const std::int32_t lowest = pieces.lowest[i];
    check_state(
        points_of[i] == 0 || (lowest >= 0 && pieces.of_point[static_cast<std::size_t>(lowest)] ==
                                                 static_cast<std::int32_t>(i)),
        "pieces");
  }
}

}  // namespace tissue_sim
