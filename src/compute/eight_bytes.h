// Bytes of many points, eight at a time in a word.
#pragma once

#include <cstdint>
#include <cstring>

namespace tissue_sim {

/// The same byte eight times.
constexpr std::uint64_t eight(std::uint64_t byte) { return byte * 0x0101010101010101; }
/// The bytes of up to eight points from `first` on, that one's lowest.
template <class Bytes>
std::uint64_t bytes_of(const Bytes& points, std::int32_t first, int count) {
  std::uint64_t bytes = 0;
  if (count >= 8) {
    std::memcpy(&bytes, &points[first], 8);
  } else if (first + count >= 8) {  // a copy of so many bytes would be a call
    std::memcpy(&bytes, &points[first + count - 8], 8);
    bytes >>= 8 * (8 - count);
  } else {
    std::memcpy(&bytes, &points[first], count);
  }
  return bytes;
}

}  // namespace tissue_sim
