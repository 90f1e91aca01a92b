#include "ros/cloud_memory.h"

#include <algorithm>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace tissue_sim {
namespace {

class Blocks {
 public:
  struct Block {
    std::size_t size = 0;
    std::unique_ptr<std::uint8_t[]> bytes;
  };

  /// The smallest that suffices and is not twice as large as it need be.
  Block take(std::size_t size) {
    const std::lock_guard<std::mutex> lock(mutex_);
    auto best = free_.end();
    for (auto b = free_.begin(); b != free_.end(); ++b) {
      if (b->size < size || b->size > 2 * size) continue;
      if (best == free_.end() || b->size < best->size) best = b;
    }
    if (best == free_.end()) return {size, std::unique_ptr<std::uint8_t[]>(new std::uint8_t[size])};
    Block block = std::move(*best);
    free_.erase(best);
    return block;
  }
  void give_back(Block block) {
    constexpr std::size_t kMost = 4;  // clouds of all points and of loose ones, two each
    const std::lock_guard<std::mutex> lock(mutex_);
    if (free_.size() == kMost) free_.erase(free_.begin());
    free_.push_back(std::move(block));
  }

 private:
  std::mutex mutex_;
  std::vector<Block> free_;  // those given back last at the end
};

/// Never destroyed: messages may be held until the very end.
Blocks& blocks() {
  static auto* all = new Blocks;
  return *all;
}

}  // namespace

boost::shared_array<std::uint8_t> cloud_memory(std::size_t bytes) {
  Blocks::Block block = blocks().take(bytes);
  const std::size_t size = block.size;
  return boost::shared_array<std::uint8_t>(block.bytes.release(), [size](std::uint8_t* memory) {
    blocks().give_back({size, std::unique_ptr<std::uint8_t[]>(memory)});
  });
}

}  // namespace tissue_sim

namespace ros {
namespace serialization {

template <>
SerializedMessage serializeMessage<const sensor_msgs::PointCloud2>(
    const sensor_msgs::PointCloud2& cloud) {
  const std::uint32_t length = serializationLength(cloud);
  SerializedMessage m;
  m.num_bytes = length + 4;
  m.buf = tissue_sim::cloud_memory(m.num_bytes);
  OStream stream(m.buf.get(), static_cast<std::uint32_t>(m.num_bytes));
  serialize(stream, length);
  m.message_start = stream.getData();
  serialize(stream, cloud);
  return m;
}

}  // namespace serialization
}  // namespace ros
