#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "ros/jaw_check.h"

namespace tissue_sim {
namespace {

JawAngle angle(double value) {
  sensor_msgs::JointState m;
  m.position = {value};
  return jaw_angle(m);
}

TEST(JawCheck, TakesWhatJawsCanBe) {
  for (const double value : {-0.35, 0.0, 1.0, 3.1416}) {  // pi, rounded by hand
    EXPECT_EQ(angle(value).problem, "") << value;
    EXPECT_EQ(angle(value).angle, value);
  }
}

TEST(JawCheck, GuessesDegrees) {
  EXPECT_NE(angle(60).problem.find("degrees"), std::string::npos) << angle(60).problem;
  EXPECT_NE(angle(60).problem.find("1.047 rad"), std::string::npos) << angle(60).problem;
  EXPECT_NE(angle(-20).problem.find("-0.3491 rad"), std::string::npos) << angle(-20).problem;
  EXPECT_NE(angle(1e6).problem, "");
  EXPECT_EQ(angle(1e6).problem.find("degrees"), std::string::npos) << "nor degrees";
}

TEST(JawCheck, RefusesNothingAndNan) {
  EXPECT_NE(jaw_angle(sensor_msgs::JointState()).problem, "");
  EXPECT_NE(angle(std::numeric_limits<double>::quiet_NaN()).problem, "");
}

TEST(JawCheck, FindsTheJawAmongTheJointsOfAnArm) {
  sensor_msgs::JointState m;
  m.name = {"outer_yaw", "outer_pitch", "outer_insertion", "jaw"};
  m.position = {0.1, 0.2, 0.05, 0.7};
  EXPECT_EQ(jaw_angle(m).angle, 0.7);
  m.name = {"grip"};
  m.position = {0.3};
  EXPECT_EQ(jaw_angle(m).angle, 0.3) << "the only one, whatever its name";
}

TEST(JawCheck, RefusesJointsOfWhichNoneIsSaidToBeTheJaw) {
  sensor_msgs::JointState m;  // as a Raven II publishes them
  m.position.assign(15, 0.1);
  EXPECT_EQ(jaw_angle(m).problem.find("the message has 15 joints without names"), 0u)
      << jaw_angle(m).problem;
  m.name.assign(15, "joint");
  EXPECT_NE(jaw_angle(m).problem.find("none of them called 'jaw'"), std::string::npos);
  m.name[6] = "left jaw";
  EXPECT_EQ(jaw_angle(m).problem, "");
  m.name[7] = "right jaw";
  EXPECT_NE(jaw_angle(m).problem.find("several of them called 'jaw'"), std::string::npos);
  m.name = {"jaw"};
  EXPECT_EQ(jaw_angle(m).problem, "the message has 15 joints and names of 1");
}

}  // namespace
}  // namespace tissue_sim
