// Scenes with fluid that tests share.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

#include "tissue/each_method.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {

/// On each device, and with each method that fluid meets.
template <class T>
class FluidOn : public testing::TestWithParam<T> {
 protected:
  static MethodOnDevice on(Device device) { return {Method::kMpm, device}; }
  static MethodOnDevice on(const MethodOnDevice& method) { return method; }
  void SetUp() override {
    const std::string why = why_not(on(this->GetParam()));
    if (!why.empty()) GTEST_SKIP() << why;
  }
};
inline std::string name_of_device(const testing::TestParamInfo<Device>& info) {
  return name_of(info.param, kDeviceNames);
}
inline const auto kEachDevice = testing::Values(Device::kCpu, Device::kCuda);
inline const auto kEachMethodWithFluid = testing::Values(
    MethodOnDevice{Method::kMpm, Device::kCpu}, MethodOnDevice{Method::kMpm, Device::kCuda},
    MethodOnDevice{Method::kPbd, Device::kCpu}, MethodOnDevice{Method::kPbd, Device::kCuda});

/// What holds all that is below.
inline Anchor held_below(double z) {
  Region region;
  region.z = z;
  return region;
}

/// A block of tissue out of the way: a scene has one body at least.
inline Body far_body(double cell) {
  Body body;
  body.name = "far";
  body.size = Vec3::Constant(3 * cell);
  body.pose.position = Vec3(1, 0, 1.5 * cell);
  body.anchors = {held_below(cell)};
  return body;
}

/// A plate whose face looks along `normal` at `place`; add_tank() puts it there.
struct TankWall {
  Vec3 place, normal, size;  ///< size: along two axes of the face, and thickness
};

/// A tank from `low` to `high`, open at the top, as plates: the bottom first, then x low, x high, y
/// low, y high.
inline std::vector<TankWall> tank(const Vec3& low, const Vec3& high) {
  const Vec3 mid = (low + high) / 2, size = high - low;
  const double wide = 1.2 * size.maxCoeff() + 0.05, thick = 0.02;
  return {{{mid.x(), mid.y(), low.z()}, Vec3::UnitZ(), {wide, wide, thick}},
          {{low.x(), mid.y(), mid.z()}, Vec3::UnitX(), {wide, wide, thick}},
          {{high.x(), mid.y(), mid.z()}, -Vec3::UnitX(), {wide, wide, thick}},
          {{mid.x(), low.y(), mid.z()}, Vec3::UnitY(), {wide, wide, thick}},
          {{mid.x(), high.y(), mid.z()}, -Vec3::UnitY(), {wide, wide, thick}}};
}

inline void add_tools(const std::vector<TankWall>& walls, Scene& scene) {
  for (const TankWall& w : walls) {
    Tool plate;
    plate.name = "wall" + std::to_string(scene.tools.size());
    plate.type = ToolType::kPlate;
    plate.size = w.size;
    scene.tools.push_back(plate);
  }
}

/// They stand there from the first frame on.
inline FrameRequest stand(const std::vector<TankWall>& walls) {
  FrameRequest request;
  for (const TankWall& w : walls) {
    ToolRequest tool;
    tool.pose = {w.place, Quat::FromTwoVectors(Vec3::UnitZ(), w.normal)};
    request.tools.emplace_back(tool);
  }
  return request;
}

inline std::vector<FluidPoint> fluid_of(Simulation& simulation) {
  std::vector<std::uint8_t> cloud;
  std::vector<FluidPoint> points(simulation.tissue().read_fluid(cloud));
  if (!points.empty()) std::memcpy(points.data(), cloud.data(), cloud.size());
  return points;
}

/// A hollow ball of a soft material, filled, without gravity and ground.
inline Scene filled_ball(const MethodOnDevice& on, double pressure) {
  Scene scene;
  scene.method = on.method;
  scene.device = on.device;
  scene.threads = 1;  // so little that two wait for one another, on a loaded machine for long
  scene.cell_size = 0.003;
  scene.gravity.setZero();
  scene.ground.enabled = false;
  scene.pbd.model = PbdModel::kTetrahedra;
  Material soft;
  soft.name = "soft";
  soft.young_modulus = 20e3;
  soft.poisson_ratio = 0.4;
  scene.materials = {soft};
  Body ball;
  ball.shape = Shape::kBall;
  ball.radius = 0.018;
  ball.material = "soft";
  ball.wall = 0.006;
  ball.filled = {"bile", pressure};
  scene.bodies = {ball};
  return scene;
}

/// What the surface of a closed hollow encloses: minus the volume of its triangles that look
/// inwards to `centre` [m^3].
inline double hollow_volume(Tissue& tissue, const Vec3& centre) {
  SurfaceTriangles surface;
  tissue.read_surface(surface);
  double six = 0;
  for (std::size_t t = 0; t < surface.point.size(); ++t) {
    Vec3 c[3];
    for (int k = 0; k < 9; ++k) c[k / 3][k % 3] = surface.corners[9 * t + k] - centre[k % 3];
    const double volume = c[0].dot(c[1].cross(c[2]));
    if (volume < 0) six -= volume;
  }
  return six / 6;
}

}  // namespace tissue_sim
