// Paths of cuts through tissue of each method: what is refused is refused before, and after the cut
// the simulation goes on, with all its points.
#include <cstdlib>
#include <stdexcept>
#include <vector>

#include "bytes.h"
#include "tissue_sim/simulation.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tissue_sim;
  FuzzBytes bytes(data, size);
  Scene scene;
  scene.device = Device::kCpu;
  scene.threads = 1;
  scene.cell_size = 0.01;
  scene.ground.enabled = false;
  scene.bodies.resize(1);
  scene.bodies[0].size = Vec3(0.04, 0.03, 0.02);
  const auto choice = bytes.take<std::uint8_t>();
  scene.method = choice % 3 == 0 ? Method::kMpm : choice % 3 == 1 ? Method::kMls : Method::kPbd;
  if (choice & 64) scene.pbd.model = PbdModel::kTetrahedra;
  const std::size_t points = bytes.take<std::uint8_t>() % 16,
                    poses = bytes.take<std::uint8_t>() % 16;
  const bool raw = bytes.take<std::uint8_t>() % 4 == 0;  // any double, or places near the body
  const auto number = [&](double scale) {
    if (raw) return bytes.take<double>();
    return scale * bytes.take<std::int16_t>() / 32768.0;
  };
  BladePath path;
  for (std::size_t i = 0; i < points; ++i) {
    const double x = number(0.05), y = number(0.05), z = number(0.05);
    path.edge.emplace_back(x, y, z);
  }
  for (std::size_t i = 0; i < poses; ++i) {
    Pose pose;
    for (double& x : pose.position) x = number(0.05);
    for (double& q : pose.orientation.coeffs()) q = number(1);
    if (!raw) {
      if (!(pose.orientation.norm() > 0)) pose.orientation = Quat::Identity();
      pose.orientation.normalize();
    }
    path.poses.push_back(pose);
  }
  Simulation simulation(scene);
  const int before = simulation.tissue().point_count();
  try {
    simulation.cut(path);
  } catch (const std::invalid_argument&) {
    return 0;
  }
  const FrameReport report = simulation.advance_frame();
  if (report.result.blew_up) std::abort();
  if (scene.method != Method::kPbd && simulation.tissue().point_count() != before) std::abort();
  return 0;
}
