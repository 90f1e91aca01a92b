#include <gtest/gtest.h>

#include <limits>

#include "ros/conversions.h"
#include "ros/frames.h"

namespace tissue_sim {
namespace {

geometry_msgs::TransformStamped transform(const std::string& parent, const std::string& child) {
  geometry_msgs::TransformStamped t;
  t.header.frame_id = parent;
  t.child_frame_id = child;
  t.transform.rotation.w = 1;
  return t;
}

TEST(Transforms, WhatTf2WouldRefuseIsNamed) {
  EXPECT_EQ(problem(transform("world", "arm")), "");
  EXPECT_NE(problem(transform("", "arm")).find("parent"), std::string::npos);
  EXPECT_NE(problem(transform("/", "arm")).find("parent"), std::string::npos);
  EXPECT_NE(problem(transform("world", "")).find("child_frame_id"), std::string::npos);
  EXPECT_NE(problem(transform("arm", "/arm")).find("its own parent"), std::string::npos);
  geometry_msgs::TransformStamped t = transform("world", "arm");
  t.transform.rotation.w = 0.95;  // digits rounded by hand
  EXPECT_EQ(problem(t), "");
  t.transform.rotation.w = 0;
  EXPECT_NE(problem(t).find("norm"), std::string::npos);
  t.transform.translation.x = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(problem(t).find("NaN"), std::string::npos);
}

}  // namespace
}  // namespace tissue_sim
