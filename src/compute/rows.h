// Rows of four floats, as x, y, z and one more of a point, into lanes and back.
#pragma once

#include <cstddef>
#include <cstdint>

#include "compute/simd.h"

#if !defined(__CUDACC__)
namespace tissue_sim {

/// Rows and columns change places, in each 16 bytes.
template <int W>
TISSUE_SIM_INLINE void transpose(Vec<W> (&r)[4]) {
  Mask<W> low, high, first, second;
  for (int i = 0; i < W; i += 4) {
    low[i] = i, low[i + 1] = i + W, low[i + 2] = i + 1, low[i + 3] = i + 1 + W;
    high[i] = i + 2, high[i + 1] = i + 2 + W, high[i + 2] = i + 3, high[i + 3] = i + 3 + W;
    first[i] = i, first[i + 1] = i + 1, first[i + 2] = i + W, first[i + 3] = i + 1 + W;
    second[i] = i + 2, second[i + 1] = i + 3, second[i + 2] = i + 2 + W, second[i + 3] = i + 3 + W;
  }
  const Vec<W> a = permute<W>(r[0], r[1], low), b = permute<W>(r[0], r[1], high);
  const Vec<W> c = permute<W>(r[2], r[3], low), d = permute<W>(r[2], r[3], high);
  r[0] = permute<W>(a, c, first);
  r[1] = permute<W>(a, c, second);
  r[2] = permute<W>(b, d, first);
  r[3] = permute<W>(b, d, second);
}

/// The 16 bytes of W / 4 of the rows by `index` side by side: i, i + 4, i + 8, i + 12. By
/// instructions, for GCC makes longer vectors of shorter ones number by number.
template <int W>
TISSUE_SIM_INLINE Vec<W> load_row(const float* x, const std::int32_t* index, int i) {
  const auto at = [x, index](int k) -> const Vec<4>& {
    return *reinterpret_cast<const Vec<4>*>(x + 4 * static_cast<std::ptrdiff_t>(index[k]));
  };
  Vec<W> row;
  if constexpr (W == 4) {
    row = at(i);
  } else {
#if defined(__x86_64__) && !defined(__clang__)
    if constexpr (W == 8) {
      asm("vbroadcastf128 %1, %0" : "=x"(row) : "m"(at(i)));
      asm("vinsertf128 $1, %1, %0, %0" : "+x"(row) : "m"(at(i + 4)));
    } else {
      asm("vbroadcastf32x4 %1, %0" : "=v"(row) : "m"(at(i)));
      asm("vinsertf32x4 $1, %1, %0, %0" : "+v"(row) : "m"(at(i + 4)));
      asm("vinsertf32x4 $2, %1, %0, %0" : "+v"(row) : "m"(at(i + 8)));
      asm("vinsertf32x4 $3, %1, %0, %0" : "+v"(row) : "m"(at(i + 12)));
    }
#else
    for (int l = 0; l < W; ++l) row[l] = at(i + l / 4 * 4)[l % 4];
#endif
  }
  return row;
}

}  // namespace tissue_sim
#endif
