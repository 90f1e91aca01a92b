// What may be asked of a simulation, and that what takes too long ends.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>

#include "geometry/lattice.h"
#include "support/test_scenes.h"
#include "tissue_sim/limits.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

Scene block(double cell_size) {
  Scene s;
  s.device = Device::kCpu;
  s.cell_size = cell_size;
  s.ground.enabled = false;
  s.bodies.resize(1);
  s.bodies[0].size = Vec3::Constant(0.02);
  return s;
}

Scene stiff(double viscosity) {
  Scene s = block(1e-4);
  s.frame_rate = 1;
  s.bodies[0].size = Vec3::Constant(2e-4);
  s.bodies[0].material = "m";
  s.materials.resize(1);
  s.materials[0].name = "m";
  s.materials[0].density = 100;
  s.materials[0].viscosity = viscosity;
  return s;
}

TEST(WorkLimits, FramesThatNeverEndAreRefusedByName) {
  for (const Method method : {Method::kMpm, Method::kMls}) {
    for (const double viscosity : {100.0, 1000.0}) {
      Scene s = stiff(viscosity);
      s.method = method;
      const std::string reason = reason_of([&] { Simulation simulation(s); });
      for (const char* field : {"frame_rate", "cell_size", "viscosity", "'m'", "100000"}) {
        EXPECT_NE(reason.find(field), std::string::npos) << reason;
      }
    }
  }
}

TEST(WorkLimits, PointsOfAllBodiesCount) {
  Scene s = block(0.002);
  s.bodies.push_back(s.bodies[0]);
  s.bodies[1].name = "second";
  s.bodies[1].pose.position.x() = 0.1;
  for (const Method method : {Method::kMpm, Method::kMls}) {
    s.method = method;
    WorkLimits limits;
    limits.max_points = 16001;  // each has 8000
    {
      const LimitWork limit(limits);
      EXPECT_NO_THROW(Simulation{s});
    }
    limits.max_points = 12000;
    const LimitWork limit(limits);
    const std::string reason = reason_of([&] { Simulation simulation(s); });
    EXPECT_NE(reason.find("'second'"), std::string::npos) << reason;
    EXPECT_NE(reason.find("points"), std::string::npos) << reason;
  }
}

TEST(WorkLimits, SurfacesAndTetrahedraOfAbsurdSizeAreRefused) {
  Scene s = block(1e-5);
  s.method = Method::kPbd;
  s.bodies[0].size = Vec3::Constant(10);
  const auto begin = Clock::now();
  for (const PbdModel model : {PbdModel::kSurface, PbdModel::kTetrahedra}) {
    s.pbd.model = model;
    EXPECT_NE(reason_of([&] { Simulation simulation(s); }).find("raise cell_size"),
              std::string::npos);
  }
  EXPECT_LT(seconds_since(begin), 5);
}

TEST(WorkLimits, AFibreThatLiesDiagonallyIsBuiltOrRefusedInTime) {
  Body fibre;
  fibre.size = Vec3(10, 1e-3, 1e-3);
  fibre.pose.orientation = Quat::FromTwoVectors(Vec3::UnitX(), Vec3(1, 1, 1));
  const auto begin = Clock::now();
  EXPECT_NE(reason_of([&] { make_lattice(fibre, 0.001, nullptr); }).find("its box measures"),
            std::string::npos);
  fibre.size.x() = 1;
  fibre.size.y() = fibre.size.z() = 5e-3;
  const Lattice lattice = make_lattice(fibre, 0.002, nullptr);
  double volume = 0;
  for (const Lattice::Site& site : lattice.sites) volume += site.volume;
  EXPECT_NEAR(volume, 25e-6, 0.01 * 25e-6);
  EXPECT_LT(seconds_since(begin), 30);
}

TEST(WorkLimits, WhatIsStoppedEndsWithinASecond) {
  std::atomic<bool> stop{false};
  WorkLimits limits;
  limits.stop = &stop;
  const LimitWork limit(limits);
  Simulation simulation(block(0.001));
  std::thread later([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    stop = true;
  });
  Clock::time_point begin = Clock::now();
  EXPECT_THROW(
      {
        for (int i = 0; i < 100000; ++i) simulation.advance_frame();
      },
      Stopped);
  later.join();
  EXPECT_LT(seconds_since(begin), 2);
  begin = Clock::now();
  Body fibre;  // as large as is taken
  fibre.size = Vec3(6, 1e-3, 1e-3);
  fibre.pose.orientation = Quat::FromTwoVectors(Vec3::UnitX(), Vec3(1, 1, 1));
  EXPECT_THROW(make_lattice(fibre, 0.001, nullptr), Stopped);
  EXPECT_LT(seconds_since(begin), 2);
}

TEST(WorkLimits, WorkEndsAtItsDeadline) {
  WorkLimits limits;
  limits.deadline = Clock::now();
  const LimitWork limit(limits);
  EXPECT_THROW(Simulation{block(0.001)}, Stopped);
}

BladePath path_of(std::size_t points, std::size_t poses) {
  BladePath path;
  for (std::size_t i = 0; i < points; ++i) path.edge.emplace_back(0, 0, 0.001 * i);
  path.poses.resize(poses);
  for (std::size_t i = 0; i < poses; ++i) path.poses[i].position.x() = 0.001 * i;
  return path;
}

TEST(CutPath, OfTooManyEdgesOrTooFarIsRefused) {
  EXPECT_NO_THROW(check_path(path_of(101, 1001)));
  EXPECT_NE(reason_of([] { check_path(path_of(400, 400)); }).find("at most 100000"),
            std::string::npos);
  // Each step that turns by half a circle is swept in 45 parts.
  BladePath turning = path_of(101, 101);
  for (std::size_t i = 1; i < turning.poses.size(); i += 2) {
    turning.poses[i].orientation = Quat(0, 0, 0, 1);
  }
  EXPECT_NE(reason_of([&] { check_path(turning); }).find("at most 100000"), std::string::npos);
  BladePath far = path_of(2, 2);
  far.poses[1].position.x() = 1e300;
  EXPECT_NE(reason_of([&] { check_path(far); }).find("1e6 m"), std::string::npos);
  far = path_of(2, 2);
  far.edge[1].x() = 1e300;
  EXPECT_NE(reason_of([&] { check_path(far); }).find("1e6 m"), std::string::npos);
}

TEST(Ground, BodiesBelowItAreRefused) {
  Scene s = block(0.004);
  s.ground.enabled = true;
  s.ground.z = 1;
  for (const Method method : {Method::kMpm, Method::kMls, Method::kPbd}) {
    s.method = method;
    const std::string reason = reason_of([&] { Simulation simulation(s); });
    EXPECT_NE(reason.find("below the ground"), std::string::npos) << reason;
  }
}

TEST(Ground, DoesNotTearWhatAnchorsHold) {
  Scene s = block(0.004);  // from z = -size / 2
  s.ground.enabled = true;
  const double low = s.bodies[0].pose.position.z() - s.bodies[0].size.z() / 2;
  Region side;
  side.kind = Region::Kind::kBox;
  side.min = Vec3(-1, -1, -1);
  side.max = Vec3(s.bodies[0].pose.position.x() - s.bodies[0].size.x() / 4, 1, 1);
  s.bodies[0].anchors = {side};
  for (const Method method : {Method::kMpm, Method::kMls, Method::kPbd}) {
    s.method = method;
    s.ground.z = low + 0.009;
    const std::string reason = reason_of([&] { Simulation simulation(s); });
    EXPECT_NE(reason.find("would tear body"), std::string::npos) << reason;
    s.ground.z = low + 0.003;  // less than a cell
    EXPECT_NO_THROW(Simulation{s});
    s.ground.z = low + 0.009;
    Scene held = s;  // all that is below is held
    held.bodies[0].anchors[0] = Region();
    held.bodies[0].anchors[0].z = low + 0.01;
    EXPECT_NO_THROW(Simulation{held});
  }
}

}  // namespace
}  // namespace tissue_sim
