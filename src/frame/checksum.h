// Checksum of a state: equal states, equal checksums.
#pragma once

#include <cstdint>
#include <cstring>

namespace tissue_sim {

/// FNV-1a over the 32-bit words of arrays, and the bytes that are left of each.
class Checksum {
 public:
  /// An array or a vector of plain numbers.
  template <class Array>
  void add(const Array& array) {
    const auto* bytes = reinterpret_cast<const unsigned char*>(array.data());
    const std::size_t size = array.size() * sizeof(array[0]);
    for (std::size_t i = 0; i + 4 <= size; i += 4) {
      std::uint32_t word;
      std::memcpy(&word, bytes + i, 4);
      hash_ = (hash_ ^ word) * 0x100000001b3u;
    }
    for (std::size_t i = size / 4 * 4; i < size; ++i) hash_ = (hash_ ^ bytes[i]) * 0x100000001b3u;
  }
  std::uint64_t value() const { return hash_; }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325u;
};

}  // namespace tissue_sim
