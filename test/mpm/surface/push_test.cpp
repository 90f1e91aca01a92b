// What presses on the surface of cut tissue.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "mpm/mpm_tissue.h"

namespace tissue_sim {
namespace {

/// A ball in many parts, by cuts that lie obliquely in its cells: nodes beside them see the rim of
/// a point, shreds hang from their edges.
Scene ball() {
  Scene scene;
  scene.device = Device::kCpu;
  scene.threads = 1;
  scene.cell_size = 0.004;
  scene.ground.enabled = false;
  scene.gravity.setZero();
  Body body;
  body.shape = Shape::kBall;
  body.radius = 0.0203;
  scene.bodies = {body};
  return scene;
}

BladePath slice(double angle, double x) {
  BladePath path;
  const Quat turn(Eigen::AngleAxisd(angle, Vec3(0.3, 1, 0.1).normalized()));
  path.edge = {Vec3(0, -0.04, 0), Vec3(0, 0.04, 0)};
  path.poses = {{turn * Vec3(x, 0, 0.03), turn}, {turn * Vec3(x, 0, -0.006), turn}};
  return path;
}

/// However little is behind it: all of what pushes a surface comes to tissue, with its moment, and
/// nothing of it is thrown.
TEST(MpmSurface, TakesWhatPressesOnIt) {
  MpmTissue tissue(ball());
  std::vector<BladePath> cuts;
  for (int i = 0; i < 7; ++i) cuts.push_back(slice(0.4 * i, 0.0011 * i - 0.003));
  FrameInput input;
  input.cuts = cuts;
  tissue.advance(1e-5, input);
  tissue.finish();
  SurfaceTriangles surface;
  tissue.read_surface(surface);
  const Momentum before = tissue.momentum();
  // A pressure for a while that lets a skin of a millimetre gain 0.1 m/s.
  constexpr double kImpulse = 1000 * 0.001 * 0.1;
  std::vector<float> impulses(surface.corners.size() / 3, 0.0f);
  Vec3 sum = Vec3::Zero(), moment = Vec3::Zero();
  double sizes = 0;
  for (std::size_t t = 0; t < surface.point.size(); ++t) {
    if (surface.corners[9 * t + 2] < 0) continue;  // the upper side alone
    const auto corner = [&](int k) {
      const float* c = &surface.corners[9 * t + 3 * k];
      return Vec3(c[0], c[1], c[2]);
    };
    const Vec3 each = -kImpulse / 6 * (corner(1) - corner(0)).cross(corner(2) - corner(0));
    for (int k = 0; k < 3; ++k) {
      impulses[3 * t + k] = static_cast<float>(each[k]);
      sum += each;
      moment += (corner(k) - before.centre).cross(each);
      sizes += each.norm();
    }
  }
  tissue.push_surface({impulses.data(), impulses.size()});
  const Momentum after = tissue.momentum();
  const Nodes& nodes = tissue.state().nodes;
  double fastest = 0;
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    fastest = std::max<double>(fastest, std::hypot(nodes.v[0][n], nodes.v[1][n], nodes.v[2][n]));
  }
  EXPECT_LT((after.linear - before.linear - sum).norm(), 1e-6 * sizes);
  EXPECT_LT((after.angular - before.angular - moment).norm(), 0.005 * sizes * 0.02);
  EXPECT_LT(fastest, 1);
}

}  // namespace
}  // namespace tissue_sim
