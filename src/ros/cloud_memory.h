// Memory of serialised clouds, used again. malloc maps anew whatever is larger than 32 MB (a
// million points), each time, and a fault for every page of it takes longer than writing the cloud.
#pragma once

#include <ros/serialization.h>
#include <sensor_msgs/PointCloud2.h>

#include <boost/shared_array.hpp>
#include <cstddef>
#include <cstdint>

namespace tissue_sim {

/// At least `bytes` of memory, of what nobody holds any more if there is any. For any thread.
boost::shared_array<std::uint8_t> cloud_memory(std::size_t bytes);

}  // namespace tissue_sim

namespace ros {
namespace serialization {

/// What Publisher::publish() calls for a shared cloud.
template <>
SerializedMessage serializeMessage<const sensor_msgs::PointCloud2>(
    const sensor_msgs::PointCloud2& cloud);

}  // namespace serialization
}  // namespace ros
