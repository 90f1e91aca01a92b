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
  m.name.clear();
  EXPECT_EQ(jaw_angle(m).angle, 0.1) << "the first where none is called so";
}

}  // namespace
}  // namespace tissue_sim
