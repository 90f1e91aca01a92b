#include <gtest/gtest.h>

#include <fstream>

#include "ros/trajectory.h"

namespace tissue_sim {
namespace {

std::string written(const std::string& text, const char* ending = ".csv") {
  const std::string path = testing::TempDir() + "/tissue_sim_path" + ending;
  std::ofstream(path) << text;
  return path;
}

std::string error_of(const std::string& text, const char* ending = ".csv") {
  try {
    load_trajectory(written(text, ending));
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "";
}

TEST(Trajectory, InterpolatesBetweenSamples) {
  const auto t =
      load_trajectory(written("t,x,y,z,qx,qy,qz,qw,jaw\n0,0,0,0,0,0,0,1,0\n# a comment\n\n"
                              "2,1,2,4,0,0,0.70710678,0.70710678,0.5\r\n"));
  ASSERT_EQ(t.size(), 2u);
  const TimedSample s = sample_at(t, 0.5);
  EXPECT_NEAR((s.pose.position - Vec3(0.25, 0.5, 1)).norm(), 0, 1e-12);
  EXPECT_NEAR(s.pose.orientation.angularDistance(Quat::Identity()), M_PI / 8, 1e-6);
  EXPECT_NEAR(s.jaw, 0.125, 1e-12);
  EXPECT_EQ(sample_at(t, -1).pose.position, Vec3(0, 0, 0));
  EXPECT_EQ(sample_at(t, 9).pose.position, Vec3(1, 2, 4));
}

TEST(Trajectory, ReadsYamlToo) {
  const auto t = load_trajectory(
      written("- {t: 1, position: [1, 2, 3], orientation: [1, 0, 0, 0]}\n"
              "- {t: 2, position: [1, 2, 4], orientation: [1, 0, 0, 0], jaw: 0.1}\n",
              ".yaml"));
  ASSERT_EQ(t.size(), 2u);
  EXPECT_EQ(t[1].pose.position, Vec3(1, 2, 4));
  EXPECT_EQ(t[1].pose.orientation.x(), 1);
  EXPECT_EQ(t[1].jaw, 0.1);
}

TEST(Trajectory, NamesTheLineThatIsWrong) {
  EXPECT_NE(error_of("0,0,0,0,0,0,0,1\n1,0,0,0,0,0,0\n").find("line 2"), std::string::npos);
  EXPECT_NE(error_of("0,0,0,0,0,0,0,1\n1,0,zero,0,0,0,0,1\n").find("line 2"), std::string::npos);
  EXPECT_NE(error_of("0,0,0,0,0,0,0,2\n").find("quaternion"), std::string::npos);
  EXPECT_NE(error_of("1,0,0,0,0,0,0,1\n1,0,0,0,0,0,0,1\n").find("increase"), std::string::npos);
  EXPECT_NE(error_of("").find("no poses"), std::string::npos);
  EXPECT_NE(error_of("- {t: 1, position: [1, 2]}", ".yaml"), "");
  EXPECT_THROW(load_trajectory("/nowhere.csv"), std::invalid_argument);
}

}  // namespace
}  // namespace tissue_sim
