#include "paper/cell_box.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string>

#include "compute/simd.h"

namespace tissue_sim {
namespace {

/// Lowest and highest of the values; false if one is not finite.
bool range_of(const float* x, std::int32_t count, float& low, float& high) {
  constexpr std::int32_t kInfinite = 0x7f800000;
  std::int32_t largest = 0;  // of the bits without their sign: sorted as the sizes are
  low = high = x[0];
  for (std::int32_t i = 0; i < count; ++i) {
    std::int32_t bits;
    std::memcpy(&bits, x + i, sizeof bits);
    bits &= 0x7fffffff;
    largest = bits > largest ? bits : largest;
    low = x[i] < low ? x[i] : low;
    high = x[i] > high ? x[i] : high;
  }
  return largest < kInfinite;
}

struct Line {
  float lowest, per_cell;
  std::int32_t n, step;
};

/// Adds to `cell` what one axis brings. The highest bit of the result: whether a point was outside.
TISSUE_SIM_INLINE std::uint32_t add(const float* x, std::int32_t count, const Line& line,
                                    std::int32_t* cell) {
  std::uint32_t outside = 0;
  const auto last = static_cast<std::uint32_t>(line.n - 1);
  for (std::int32_t i = 0; i < count; ++i) {
    const auto c = static_cast<std::int32_t>((x[i] - line.lowest) * line.per_cell);
    outside |= static_cast<std::uint32_t>(c) | (last - static_cast<std::uint32_t>(c));
    cell[i] += line.step * c;
  }
  return outside;
}
std::uint32_t add_sse2(const float* x, std::int32_t count, const Line& line, std::int32_t* cell) {
  return add(x, count, line, cell);
}
#if defined(__x86_64__)
TISSUE_SIM_TARGET_AVX2
#endif
std::uint32_t add_avx2(const float* x, std::int32_t count, const Line& line, std::int32_t* cell) {
  return add(x, count, line, cell);
}

}  // namespace

CellBox cell_box(const PointPlaces& places, double cell_size) {
  if (places.count <= 0) throw std::invalid_argument("there are no points to find fragments among");
  if (!(cell_size > 0)) {
    throw std::invalid_argument("the cell size is " + std::to_string(cell_size) +
                                ": it must be above 0");
  }
  CellBox box;
  box.cell_size = static_cast<float>(cell_size);
  for (int a = 0; a < 3; ++a) {
    if (places.x[a] == nullptr) continue;
    float low, high;
    if (!range_of(places.x[a], places.count, low, high)) {
      throw std::invalid_argument("a point's place is not finite: no cell holds it");
    }
    const double first = std::floor(low / cell_size) - 1;  // one more: what is rounded stays inside
    const double cells = std::floor(high / cell_size) + 2 - first;
    if (!(cells <= kMostCells)) {
      throw std::invalid_argument("points lie " + std::to_string(high - low) +
                                  " m apart: too far for cells of " + std::to_string(cell_size) +
                                  " m, of which a grid has " + std::to_string(kMostCells) +
                                  " along an axis; leave out what flew away");
    }
    box.lowest[a] = static_cast<float>(first * cell_size);
    box.n[a] = static_cast<int>(cells);
  }
  return box;
}

void find_cells(const PointPlaces& places, const CellBox& box, const CellOrder& order,
                std::int32_t begin, std::int32_t end, std::int32_t* cell) {
  static const bool avx2 = instruction_set() >= InstructionSet::kAvx2;
  const std::int32_t step[3] = {1, order.row, order.plane};
  std::uint32_t outside = 0;
  std::fill(cell, cell + (end - begin), order.first);
  for (int a = 0; a < 3; ++a) {
    if (places.x[a] == nullptr) continue;
    const Line line{box.lowest[a], 1 / box.cell_size, box.n[a], step[a]};
    outside |= (avx2 ? add_avx2 : add_sse2)(places.x[a] + begin, end - begin, line, cell);
  }
  if (outside >> 31 != 0) {
    throw std::invalid_argument("a point lies outside of the grid: make it larger");
  }
}

void mark_cells(const PointPlaces& places, const CellBox& box, const CellOrder& order, Cpu& cpu,
                std::vector<std::int32_t>& cell, std::vector<std::uint8_t>& held) {
  constexpr std::int32_t kPoints = 2048;  // so that their cells are near when they are marked
  cpu.for_each((places.count + kPoints - 1) / kPoints, [&](int i) {
    const std::int32_t begin = i * kPoints, end = std::min(begin + kPoints, places.count);
    std::int32_t* const to = &cell[begin];
    std::uint8_t* const mark = held.data();
    find_cells(places, box, order, begin, end, to);
    for (std::int32_t p = 0; p < end - begin; ++p) {  // several threads may: all write the same
      __atomic_store_n(mark + to[p], std::uint8_t{1}, __ATOMIC_RELAXED);
    }
  });
}

}  // namespace tissue_sim
