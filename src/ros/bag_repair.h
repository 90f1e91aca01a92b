// Bags whose writer was killed, or ran out of disk, before it wrote their index.
#pragma once

#include <cstdint>
#include <string>

namespace tissue_sim {

struct BagRepair {
  std::uint64_t messages = 0;  ///< that the bag holds now
  std::uint64_t chunks = 0;
  std::uint64_t lost = 0;  ///< bytes behind the last whole chunk
};

/// Cuts a bag of version 2.0 off behind its last whole chunk, and writes its index there: then
/// every program reads it. A bag that has its index is left as it is. Throws std::runtime_error for
/// what is no such bag or cannot be written; needs no more disk than what it cuts off, or a few
/// kilobytes.
BagRepair repair_bag(const std::string& path);

}  // namespace tissue_sim
