#include <gtest/gtest.h>

#include "ros/frame_clock.h"
#include "ros/recorder.h"

namespace tissue_sim {
namespace {

TEST(RosSchedule, FramesLieTheSameHoweverManyWereDone) {
  RosSchedule schedule(60);
  schedule.start(1700000000123456789);
  EXPECT_FALSE(schedule.begun());
  for (int i = 0; i < 600; ++i) schedule.next();
  EXPECT_TRUE(schedule.begun());
  EXPECT_EQ(schedule.due(), 1700000010123456789);
  for (int i = 0; i < 60 * 3600 * 24; ++i) schedule.next();
  EXPECT_EQ(schedule.due(), 1700086410123456789);
}

TEST(RosSchedule, IsMovedAfterAPause) {
  RosSchedule schedule(100);
  schedule.start(5000000000);
  for (int i = 0; i < 7; ++i) schedule.next();
  EXPECT_EQ(schedule.due(), 5070000000);
  schedule.move(9000000000);
  EXPECT_EQ(schedule.due(), 9000000000);
  schedule.next();
  EXPECT_EQ(schedule.due(), 9010000000);
}

TEST(BagTime, GrowsWithEachMessage) {
  BagTime time;
  const ros::Time start(100.0);
  EXPECT_EQ(time.next(start), start);
  EXPECT_EQ(time.next(start), start + ros::Duration(0, 1));
  EXPECT_EQ(time.next(start + ros::Duration(2)), start + ros::Duration(2));
  EXPECT_EQ(time.next(start + ros::Duration(1.99)), start + ros::Duration(2, 1)) << "a thread's";
}

TEST(BagTime, GoesOnWhereAClockJumpsBack) {
  BagTime time;
  time.next(ros::Time(150.0));
  const ros::Time first = time.next(ros::Time(100.0));
  EXPECT_GT(first, ros::Time(150.0));
  EXPECT_EQ(time.next(ros::Time(101.0)), first + ros::Duration(1) - ros::Duration(0, 1));
  EXPECT_EQ(time.next(ros::Time(0)).sec, 151u) << "before the first message of /clock";
}

}  // namespace
}  // namespace tissue_sim
