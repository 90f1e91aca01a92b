#include <gtest/gtest.h>

#include <cmath>

#include "ros/pose_track.h"

namespace tissue_sim {
namespace {

TEST(SampleTrack, IsOneSampleLaterAndGoesStraight) {
  SampleTrack<double> track;
  track.place(0, 10);
  for (int i = 1; i <= 20; ++i) {  // 10 Hz, 1 per second
    const double came = 10 + 0.1 * i;
    track.add(0.1 * i, came);
    for (const double later : {0.0, 0.02, 0.05, 0.09}) {
      EXPECT_NEAR(track.at(came + later), came + later - 0.1 - 10, 1e-9) << i;
    }
  }
  EXPECT_EQ(track.at(20), 2.0) << "stays where the last one was";
}

TEST(SampleTrack, NeverJumpsHoweverSamplesCome) {
  SampleTrack<double> track;
  track.place(0, 0);
  double due = 0.05, before = 0, fastest = 0;  // 20 Hz on the mean, 1 per second
  int samples = 0;
  for (int ms = 1; ms < 10000; ++ms) {
    const double now = 0.001 * ms;
    if (now >= due) {
      track.add(0.05 * ++samples, now);
      due += 0.05 * (1 + 0.4 * std::sin(7.0 * samples));
    }
    fastest = std::max(fastest, std::fabs(track.at(now) - before) / 0.001);
    before = track.at(now);
  }
  EXPECT_LT(fastest, 3);
  EXPECT_NEAR(before, 10, 0.15) << "and stays behind no more than two samples";
  track.place(7, 11);
  EXPECT_EQ(track.at(11), 7) << "unless it is placed";
}

TEST(SampleTrack, TurnsEvenly) {
  SampleTrack<Pose> track;
  const auto turned = [](double angle) {
    return Pose{Vec3(angle, 0, 0), Quat(Eigen::AngleAxisd(angle, Vec3::UnitZ()))};
  };
  track.place(turned(0), 0);
  track.add(turned(0.4), 0.1);
  const Pose half = track.at(0.15);
  EXPECT_NEAR(half.orientation.angularDistance(turned(0.2).orientation), 0, 1e-9);
  EXPECT_NEAR(half.position.x(), 0.2, 1e-12);
  EXPECT_NEAR(half.orientation.norm(), 1, 1e-12);
}

}  // namespace
}  // namespace tissue_sim
