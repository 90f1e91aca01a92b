#include <geometry_msgs/TransformStamped.h>
#include <gtest/gtest.h>

#include "ros/frames.h"
#include "ros/guarded.h"
#include "ros/stamps.h"

namespace tissue_sim {
namespace {

const ros::Time kLast(4294967295u, 999999999u);

TEST(Stamps, NoneIsTooFarOffToReckonWith) {
  EXPECT_EQ(in_nanoseconds(kLast), 4294967295999999999ll);
  EXPECT_EQ(ros_time_of(in_nanoseconds(kLast) + 5), kLast);
  EXPECT_EQ(ros_time_of(-5), ros::Time());
  EXPECT_DOUBLE_EQ(seconds_between(ros::Time(), kLast), 4294967296.0);
  EXPECT_DOUBLE_EQ(seconds_between(kLast, ros::Time(1, 0)), -4294967295.0);
  EXPECT_THROW(kLast - ros::Time(1, 0), std::runtime_error) << "why this is here";
}

TEST(Stamps, FarAheadIsMoreThanADayOfBothClocks) {
  ros::Time::setNow(ros::Time(1000, 0));
  const ros::WallTime wall = ros::WallTime::now();
  EXPECT_TRUE(is_far_ahead(kLast));
  EXPECT_FALSE(is_far_ahead(ros::Time()));
  EXPECT_FALSE(is_far_ahead(ros::Time(wall.sec + 3600, 0))) << "an arm of the wall's time";
  EXPECT_TRUE(is_far_ahead(ros::Time(wall.sec + 90000, 0)));
}

TEST(Guard, NothingThrownLeaves) {
  const std::uint64_t before = thrown_in_callbacks();
  guard("a message", [] { throw std::runtime_error("out of dual 32-bit range"); });
  guard("a message", [] { throw 7; });
  EXPECT_EQ(thrown_in_callbacks(), before + 2);
}

}  // namespace
}  // namespace tissue_sim
