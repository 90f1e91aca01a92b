// Numbers in binary files, whatever the byte order of the machine.
#pragma once

#include <cstdint>
#include <cstring>
#include <type_traits>

namespace tissue_sim {

/// The number at `p`, of sizeof(T) bytes.
template <class T>
T number_at(const char* p, bool big_endian) {
  using Bits = std::conditional_t<
      sizeof(T) == 1, std::uint8_t,
      std::conditional_t<sizeof(T) == 2, std::uint16_t,
                         std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>>>;
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    const std::size_t at = big_endian ? i : sizeof(T) - 1 - i;
    bits = bits << 8 | static_cast<unsigned char>(p[at]);
  }
  const Bits own = static_cast<Bits>(bits);
  T value;
  std::memcpy(&value, &own, sizeof value);
  return value;
}

}  // namespace tissue_sim
