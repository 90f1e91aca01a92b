// Serialised clouds: the same bytes as roscpp's own, in memory that is used again.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "ros/cloud_memory.h"

namespace tissue_sim {
namespace {

using sensor_msgs::PointCloud2;

PointCloud2 cloud_of(std::size_t bytes) {
  PointCloud2 cloud;
  cloud.header.frame_id = "world";
  cloud.fields.resize(3);
  cloud.fields[1].name = "y";
  cloud.data.resize(bytes);
  for (std::size_t i = 0; i < bytes; ++i) cloud.data[i] = static_cast<std::uint8_t>(i * i >> 3);
  return cloud;
}

ros::SerializedMessage serialized(const PointCloud2& cloud) {
  return ros::serialization::serializeMessage<const PointCloud2>(cloud);
}

TEST(CloudMemory, HoldsWhatRoscppWrites) {
  for (const std::size_t bytes : {0, 1, 1000, 40000000}) {
    const PointCloud2 cloud = cloud_of(bytes);
    const ros::SerializedMessage own = serialized(cloud);
    const ros::SerializedMessage other = ros::serialization::serializeMessage<PointCloud2>(cloud);
    ASSERT_EQ(own.num_bytes, other.num_bytes);
    EXPECT_TRUE(std::equal(own.buf.get(), own.buf.get() + own.num_bytes, other.buf.get()));
    EXPECT_EQ(own.message_start - own.buf.get(), other.message_start - other.buf.get());
  }
}

TEST(CloudMemory, IsUsedAgainWhenNobodyHoldsIt) {
  const PointCloud2 cloud = cloud_of(3000000);
  std::set<const std::uint8_t*> places;
  ros::SerializedMessage held[2];
  for (int i = 0; i < 50; ++i) {
    ros::SerializedMessage& m = held[i % 2];
    m = serialized(cloud);
    places.insert(m.buf.get());
    EXPECT_NE(held[0].buf, held[1].buf);
  }
  EXPECT_LE(places.size(), 3u);
}

}  // namespace
}  // namespace tissue_sim
