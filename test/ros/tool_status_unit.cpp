#include <gtest/gtest.h>

#include "ros/tool_status.h"

namespace tissue_sim {
namespace {

bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

ToolStatus driven() {
  ToolStatus s;
  s.tool = "probe";
  s.source = "/probe/measured_cp";
  s.publishers = 1;
  s.came = true;
  s.silent = 0.02;
  s.counts.accepted = 100;
  return s;
}

TEST(ToolStatus, IsQuietAboutAToolThatIsDriven) { EXPECT_EQ(warning(driven()), ""); }

TEST(ToolStatus, SaysThatNoPoseEverCameWhereAndFromHowMany) {
  ToolStatus s = driven();
  s.came = false;
  s.counts.accepted = 0;
  s.publishers = 0;
  EXPECT_TRUE(has(warning(s), "no pose ever came on /probe/measured_cp (0 publishers)"));
  EXPECT_TRUE(has(warning(s), "remap")) << warning(s);
  s.publishers = 1;
  EXPECT_TRUE(has(warning(s), "(1 publisher)")) << warning(s);
}

TEST(ToolStatus, SaysThatPosesAreOfAnotherTypeAndHowTheyAreTaken) {
  ToolStatus s = driven();
  s.came = false;
  s.publishers = 0;
  s.wrong_type = "geometry_msgs/TransformStamped";
  EXPECT_TRUE(has(warning(s), "set tools/probe/pose_type: TransformStamped")) << warning(s);
  s.wrong_type = "sensor_msgs/JointState";
  EXPECT_TRUE(has(warning(s), "are geometry_msgs/PoseStamped, or")) << warning(s);
}

TEST(ToolStatus, SaysForHowLongNothingCame) {
  ToolStatus s = driven();
  s.silent = 5;
  s.publishers = 0;
  EXPECT_TRUE(has(warning(s), "for 5.0 s (0 publishers)")) << warning(s);
  s.latched = true;
  EXPECT_TRUE(has(warning(s), "for 5.0 s")) << "its publisher is gone all the same";
  s.publishers = 1;
  EXPECT_EQ(warning(s), "") << "rostopic pub latches one pose for ever";
  s.latched = false;
  s.silent = 1;
  EXPECT_EQ(warning(s), "");
}

TEST(ToolStatus, KnowsAnArmThatIsGoneFromOneThatIsSlowOrNeverCame) {
  ToolStatus s = driven();
  s.silent = 5;
  EXPECT_FALSE(is_gone(s)) << "it still publishes";
  s.publishers = 0;
  EXPECT_TRUE(is_gone(s));
  s.came = false;
  EXPECT_FALSE(is_gone(s));
  s = driven();
  s.follows_tf = true;
  s.publishers = 0;
  EXPECT_FALSE(is_gone(s));
  s.silent = 5;
  EXPECT_TRUE(is_gone(s));
}

TEST(ToolStatus, SaysWhatATfFrameLacksAndThatItStandsStill) {
  ToolStatus s = driven();
  s.follows_tf = true;
  s.source = "psm_tip";
  s.waiting = "no transform from 'psm_tip' to 'world': tf does not know any of the two";
  EXPECT_TRUE(has(warning(s), "'psm_tip'"));
  s.waiting.clear();
  s.silent = 5;
  EXPECT_TRUE(has(warning(s), "'psm_tip' has been the same for 5.0 s")) << warning(s);
}

TEST(ToolStatus, SaysThatAllWereRefusedAndThatItIsFar) {
  ToolStatus s = driven();
  s.counts.accepted = 0;
  s.counts.refused[0] = 7;
  EXPECT_TRUE(has(warning(s), "all poses so far were refused"));
  s = driven();
  s.far = "72 m from all tissue";
  EXPECT_EQ(warning(s), "probe is 72 m from all tissue");
}

class Distance : public testing::Test {
 protected:
  const Box tissue_{Vec3(-0.05, -0.03, 0), Vec3(0.05, 0.03, 0.03)};
  std::string far(const Vec3& place) const { return distance_warning(tissue_, Pose(), place); }
};

TEST_F(Distance, IsSaidWithAGuessOfTheUnit) {
  EXPECT_EQ(far(Vec3(0.02, 0, 0.1)), "");
  EXPECT_EQ(far(Vec3(0.3, 0.2, 0.1)), "") << "an arm that is parked";
  EXPECT_TRUE(has(far(Vec3(72, 0, 0.01)), "72 m from all tissue")) << far(Vec3(72, 0, 0.01));
  EXPECT_TRUE(has(far(Vec3(30, 20, 60)), "divided by 1000")) << far(Vec3(30, 20, 60));
  EXPECT_TRUE(has(far(Vec3(30, 20, 60)), "millimetres"));
  EXPECT_TRUE(has(far(Vec3(0.6, 0.2, 0.5)), "divided by 10 ")) << far(Vec3(0.6, 0.2, 0.5));
  EXPECT_TRUE(has(far(Vec3(1.29, 0, 1.0)), "divided by 10 ")) << far(Vec3(1.29, 0, 1.0));
  EXPECT_FALSE(has(far(Vec3(1e6, 0, 0)), "divided")) << far(Vec3(1e6, 0, 0));
}

TEST_F(Distance, ScalesInThePosesOwnFrame) {
  const Box there{Vec3(9.95, -0.03, 0), Vec3(10.05, 0.03, 0.03)};  // 10 m from the world's origin
  const Pose base{Vec3(10, 0, 0.2), Quat(0, 1, 0, 0)};             // of an arm above it
  EXPECT_EQ(distance_warning(there, base, Vec3(0.02, 0, 0.15)), "");
  const std::string said = distance_warning(there, base, Vec3(20, 0, 150));
  EXPECT_TRUE(has(said, "divided by 1000")) << said;
  const std::string small = distance_warning(there, Pose(), Vec3(0.01, 0, 0));
  EXPECT_TRUE(has(small, "multiplied by 1000")) << small;
}

TEST_F(Distance, IsNothingWithoutTissue) {
  EXPECT_EQ(distance_warning(Box(), Pose(), Vec3(72, 0, 0)), "");
}

}  // namespace
}  // namespace tissue_sim
