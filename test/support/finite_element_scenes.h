// Bodies of which test/data/references.yaml knows what finite elements say
// (scripts/make_references).
#pragma once

#include <yaml-cpp/yaml.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "tissue_sim/simulation.h"

namespace tissue_sim {

/// A value of test/data/references.yaml, where its mesh levels lead to.
inline double reference(const std::string& data, const std::string& body, const std::string& name) {
  return YAML::LoadFile(data + "/references.yaml")[body][name]["limit"].as<double>();
}

/// Their tissue, on a lattice of this cell size.
inline Scene reference_scene(double cell_size) {
  Scene s;
  s.device = Device::kCpu;
  s.cell_size = cell_size;
  s.ground.enabled = false;
  s.materials.resize(1);
  s.materials[0].name = "phantom";
  s.materials[0].law = Law::kNeoHookean;
  s.materials[0].young_modulus = 5000;
  s.materials[0].poisson_ratio = 0.45;
  s.materials[0].density = 1000;
  s.bodies.resize(1);
  s.bodies[0].material = "phantom";
  return s;
}

/// Everything on the far side of a place along an axis: a box that reaches far beyond the body.
inline Anchor beyond(int axis, double place, bool above) {
  Region r;
  r.kind = Region::Kind::kBox;
  r.min = Vec3::Constant(-1);
  r.max = Vec3::Constant(1);
  (above ? r.min : r.max)[axis] = place;
  return r;
}

/// 40 x 40 x 32 mm above z = 0, where it is clamped; `held` more of it below [m].
inline Scene clamped_block(double cell_size, double held) {
  Scene s = reference_scene(cell_size);
  s.bodies[0].size = Vec3(0.04, 0.04, 0.032 + held);
  s.bodies[0].pose.position.z() = (0.032 - held) / 2;
  s.bodies[0].anchors = {beyond(2, 0, false)};
  return s;
}

/// 30 x 20 x 20 mm beyond x = 0, where it is clamped; `held` more of it before [m].
inline Scene cantilever_block(double cell_size, double held) {
  Scene s = reference_scene(cell_size);
  s.bodies[0].size = Vec3(0.03 + held, 0.02, 0.02);
  s.bodies[0].pose.position = Vec3((0.03 - held) / 2, 0, 0.01);
  s.bodies[0].anchors = {beyond(0, 0, false)};
  return s;
}

/// 40 x 16 x 16 mm between two clamps, `held` more of it on either side [m].
inline Scene pulled_bar(double cell_size, double held) {
  Scene s = reference_scene(cell_size);
  s.gravity = Vec3::Zero();
  s.bodies[0].size = Vec3(0.04 + 2 * held, 0.016, 0.016);
  s.bodies[0].anchors = {beyond(0, -0.02, false), beyond(0, 0.02, true)};
  return s;
}

/// A cylinder of radius 30 and height 24 mm above z = 0, where it is clamped, and a tool that looks
/// down on its top.
inline Scene indented_cylinder(double cell_size, double held, const Tool& tool) {
  Scene s = reference_scene(cell_size);
  s.gravity = Vec3::Zero();
  s.bodies[0].shape = Shape::kCylinder;
  s.bodies[0].radius = 0.03;
  s.bodies[0].height = 0.024 + held;
  s.bodies[0].pose.position.z() = (0.024 - held) / 2;
  s.bodies[0].anchors = {beyond(2, 0, false)};
  s.tools = {tool};
  return s;
}

/// A tool's force upwards when it has pressed so deep into that cylinder and all is at rest [N].
inline double indentation_force(Simulation& simulation, double depth) {
  const Quat down(0, 1, 0, 0);
  constexpr int kFrames = 30;
  for (int i = 0; i <= kFrames; ++i) {
    simulation.set_tool(0, {Vec3(0, 0, 0.024 - depth * i / kFrames), down});
    simulation.advance_frame();
  }
  simulation.settle({1e-4, 1.5, 30});
  return simulation.advance_frame().result.loads[0].mean.force.z();
}

/// Displacement along an axis at a place in the middle of a box's side, where the axis `side`
/// leaves it [m]: of the points within `around` of it, fitted by a polynomial of second degree.
inline double surface_displacement(Tissue& tissue, int side, const Vec3& place, int axis,
                                   double around) {
  std::vector<std::uint8_t> cloud;
  PointSelection selection;
  selection.fields = kRestPosition | kDisplacement;
  const int count = tissue.read_points(selection, cloud);
  constexpr int kTerms = 9;
  Eigen::Matrix<double, kTerms, kTerms> A = Eigen::Matrix<double, kTerms, kTerms>::Zero();
  Eigen::Matrix<double, kTerms, 1> b = Eigen::Matrix<double, kTerms, 1>::Zero();
  for (int i = 0; i < count; ++i) {
    float f[6];
    std::memcpy(f, &cloud[selection.point_size() * i + sizeof(Point)], sizeof f);
    const Vec3 d = (Vec3(f[0], f[1], f[2]) - place) / around;
    if (d.cwiseAbs().maxCoeff() > 1) continue;
    const double s = d[side], t = d[(side + 1) % 3], u = d[(side + 2) % 3];
    Eigen::Matrix<double, kTerms, 1> row;
    row << 1, s, t, u, s * s, t * t, u * u, s * t, s * u;
    A += row * row.transpose();
    b += row * static_cast<double>(f[3 + axis]);
  }
  return A.ldlt().solve(b)[0];
}

/// Frequency of a body that was bent by `gravity` and is let go [Hz]: from when the displacement of
/// its end, as surface_displacement() has it, passes 0.
template <class Displacement>
double frequency_of(Simulation& simulation, const Vec3& gravity, int periods,
                    const Displacement& displacement) {
  simulation.set_gravity(gravity);
  simulation.settle({1e-5, 3, 30});
  simulation.set_gravity(Vec3::Zero());
  double before = displacement(), first = -1, last = -1;
  int passed = 0;
  const double dt = 1 / simulation.scene().frame_rate;
  while (passed < 2 * periods + 1 && simulation.time() < 20) {
    simulation.advance_frame();
    const double now = displacement();
    if (before * now < 0 || now == 0) {
      last = simulation.time() - dt * now / (now - before);
      if (passed++ == 0) first = last;
    }
    before = now;
  }
  return passed < 3 ? 0 : (passed - 1) / (2 * (last - first));
}

}  // namespace tissue_sim
