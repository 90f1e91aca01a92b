// Eight scenes that use everything, with what happens to them frame by frame. Small, so that all of
// them run in seconds; each goes through the public API as the node does.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "golden/golden_parts.h"
#include "support/temporary_folder.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {

struct GoldenScene {
  std::string name;
  Scene scene;
  int frames = 12;
  /// Sets tools and cuts for the frame that comes next, 0 first.
  std::function<void(Simulation&, int)> before = [](Simulation&, int) {};
};

namespace golden {

/// Liver on the ground, held at one end; the service cuts it in part, across that cut, all through,
/// around a curve, and twice in one frame.
inline GoldenScene service_cuts() {
  GoldenScene g;
  g.name = "service_cuts";
  g.scene.cell_size = 0.003;
  add_box(g.scene, Vec3(0.045, 0.030, 0.018), Vec3(0, 0, 0.0095)).anchors = {
      box(Vec3(-1, -1, -1), Vec3(-0.018, 1, 1))};
  g.before = [](Simulation& s, int frame) {
    if (frame == 1) s.cut(upright(Vec3(0.0013, -0.05, 0), Vec3(0.0013, 0.0013, 0)));
    if (frame == 3) s.cut(upright(Vec3(-0.008, -0.0057, 0), Vec3(0.05, -0.0022, 0)));
    if (frame == 6)
      s.cut(sweep(Vec3(-0.01, -0.1, 0), Vec3(-0.008, 0.1, 0), {{0, 0, -0.01}, {0, 0, 0.05}}));
    if (frame == 8) {
      std::vector<Vec3> wave;
      for (int i = 0; i <= 20; ++i) {
        wave.push_back(Vec3(0.012 + 0.004 * std::sin(0.6 * i), 0.03 - 0.0031 * i, 0));
      }
      s.cut(sweep(Vec3(0, 0, -0.1), Vec3(0, 0, 0.1), wave));
      s.cut(sweep(Vec3(0, -0.1, 0.0083), Vec3(0, 0.1, 0.0089), {{0.05, 0, 0}, {-0.004, 0, 0}}));
    }
  };
  return g;
}

/// A scalpel goes down into tissue and through it, tilted, and comes out again.
inline GoldenScene scalpel() {
  GoldenScene g;
  g.name = "scalpel";
  g.frames = 16;
  g.scene.cell_size = 0.003;
  g.scene.damping = 2;
  add_box(g.scene, Vec3(0.042, 0.030, 0.018), Vec3(0, 0, 0.0095)).anchors = {
      box(Vec3(-1, -1, -1), Vec3(-0.017, 1, 1))};
  add_tool(g.scene, ToolType::kScalpel);
  g.before = [](Simulation& s, int frame) {
    const double t = frame / 15.0;
    const Quat tilt(Eigen::AngleAxisd(0.3 * std::sin(3 * t), Vec3::UnitY()));
    s.set_tool(0, {Vec3(0.001 + 0.006 * t, 0.03 - 0.07 * t, 0.012 - 0.014 * std::sin(3.1 * t)),
                   tilt * Quat(Eigen::AngleAxisd(-EIGEN_PI / 2, Vec3::UnitZ())) * down()});
  };
  return g;
}

/// A notched strip that hangs by its end and tears under forces that grow.
inline GoldenScene tears() {
  GoldenScene g;
  g.name = "tears";
  g.frames = 14;
  g.scene.cell_size = 0.002;
  g.scene.gravity = Vec3(0.3, 0.5, -22);
  g.scene.damping = 20;
  g.scene.seed = 3;
  g.scene.ground.z = -0.05;
  Material& m = add_material(g.scene, "weak");
  m.tear_stretch = 1.3;
  m.tear_length = 0.0035;
  m.tear_scatter = 0.05;
  Body& b = add_box(g.scene, Vec3(0.014, 0.008, 0.044), Vec3::Zero());
  b.material = "weak";
  b.anchors = {box(Vec3(-1, -1, 0.018), Vec3(1, 1, 1))};
  g.before = [](Simulation& s, int frame) {
    if (frame == 0) {
      s.cut(sweep(Vec3(0, -0.1, 0.0071), Vec3(0, 0.1, 0.0066), {{-0.05, 0, 0}, {-0.0025, 0, 0}}));
    }
  };
  return g;
}

/// A grasper closes on a ridge and lifts it, a scalpel cuts beside it, a probe pushes from above.
inline GoldenScene three_tools() {
  GoldenScene g;
  g.name = "three_tools";
  g.frames = 20;
  g.scene.cell_size = 0.003;
  Body& b = add_box(g.scene, Vec3(0.045, 0.024, 0.018), Vec3(0, 0, 0.0095));
  b.anchors = {box(Vec3(-1, -1, -1), Vec3(1, 1, 0.003))};
  b.material = "kidney";
  add_tool(g.scene, ToolType::kScalpel).blade_length = 0.02;
  add_tool(g.scene, ToolType::kProbe).radius = 0.005;
  Tool& grasper = add_tool(g.scene, ToolType::kGrasper);
  grasper.jaw_length = 0.014;
  grasper.jaw_width = 0.008;
  g.before = [](Simulation& s, int frame) {
    const double t = frame / 19.0, lift = std::max(0.0, t - 0.5);
    if (frame > 1) {  // it comes later than the others
      s.set_tool(0, {Vec3(0.004 - 0.002 * t, 0.03 - 0.05 * t, 0.008), down()});
    }
    s.set_tool(1, {Vec3(-0.014, 0.002, 0.027 - 0.012 * t), down()});
    s.set_tool(2, {Vec3(0.0225, 0, 0.011 + 0.012 * lift), down()}, std::max(0.0, 1.0 - 2.2 * t));
  };
  return g;
}

/// A ball and a box fall on a box that lies askew, rub on it, and are pushed on by the ground.
inline GoldenScene two_bodies() {
  GoldenScene g;
  g.name = "two_bodies";
  g.frames = 16;
  g.scene.cell_size = 0.003;
  g.scene.gravity = Vec3(1.5, 0, -9.81);
  add_box(g.scene, Vec3(0.036, 0.027, 0.012), Vec3(0, 0, 0.0085)).pose.orientation =
      Quat(Eigen::AngleAxisd(0.2, Vec3(1, 2, 3).normalized()));
  Body& ball = add_box(g.scene, Vec3::Ones(), Vec3(-0.006, 0.001, 0.0295));
  ball.shape = Shape::kBall;
  ball.radius = 0.0105;
  ball.material = "muscle";
  add_box(g.scene, Vec3(0.012, 0.015, 0.009), Vec3(0.013, -0.001, 0.0245)).material = "fat";
  return g;
}

/// Viscous tissue with a stiff ball and a layer of the other law in it, pressed by a probe.
inline GoldenScene inclusions() {
  GoldenScene g;
  g.name = "inclusions";
  g.scene.cell_size = 0.003;
  Material m = add_material(g.scene, "viscous");
  m.viscosity = 2;
  m.poisson_ratio = 0.49;
  g.scene.materials.back() = m;
  Material& stiff = g.scene.materials.emplace_back(m);
  stiff.name = "stiff";
  stiff.young_modulus = 30000;
  stiff.law = Law::kNeoHookean;
  Material& soft = g.scene.materials.emplace_back(m);
  soft.name = "soft";
  soft.young_modulus = 2000;
  soft.viscosity = 0.5;
  soft.density = 950;
  Body& b = add_box(g.scene, Vec3::Ones(), Vec3(0, 0, 0.0125));
  b.shape = Shape::kEllipsoid;
  b.radii = Vec3(0.021, 0.017, 0.012);
  b.material = "viscous";
  b.inclusions.resize(2);
  b.inclusions[0] = {"soft", box(Vec3(-1, -1, -1), Vec3(1, 1, 0.006))};
  b.inclusions[1].material = "stiff";
  b.inclusions[1].region.kind = Region::Kind::kBall;
  b.inclusions[1].region.center = Vec3(0.004, 0, 0.014);
  b.inclusions[1].region.radius = 0.006;
  add_tool(g.scene, ToolType::kProbe).radius = 0.004;
  g.before = [](Simulation& s, int frame) {
    s.set_tool(0, {Vec3(-0.004 + 0.0008 * frame, 0.001, 0.027 - 0.001 * frame), down()});
    if (frame == 7) s.cut(upright(Vec3(0.05, 0.0041, 0), Vec3(-0.003, 0.0043, 0)));
  };
  return g;
}

/// A mesh in the shape of a U, whose prongs a probe bends onto one another.
inline GoldenScene self_contact(const TemporaryFolder& folder) {
  GoldenScene g;
  g.name = "self_contact";
  g.frames = 18;
  g.scene.cell_size = 0.002;
  Body& b = g.scene.bodies.emplace_back();
  b.shape = Shape::kMesh;
  b.mesh = folder.write("u.obj", u_shape());
  b.scale = 0.001;
  b.pose.position = Vec3(0, 0, 0.001);
  b.anchors = {box(Vec3(-1, -1, -1), Vec3(1, 1, 0.0045))};
  add_tool(g.scene, ToolType::kProbe).radius = 0.004;
  g.before = [](Simulation& s, int frame) {
    const Quat along_y(Eigen::AngleAxisd(EIGEN_PI / 2, Vec3::UnitX()));
    s.set_tool(0, {Vec3(-0.005 + 0.0008 * frame, -0.004 + 0.0002 * frame, 0.025), along_y});
  };
  return g;
}

/// A hanging strip, cut to links that thin bridges join and shattered in its middle, tears apart.
inline GoldenScene chain() {
  GoldenScene g;
  g.name = "chain";
  g.frames = 20;
  g.scene.cell_size = 0.002;
  g.scene.gravity = Vec3(0, 1, -16);
  g.scene.ground.z = -0.04;
  Material& m = add_material(g.scene, "brittle");
  m.tear_stretch = 1.55;
  m.tear_scatter = 0.2;
  m.law = Law::kNeoHookean;
  Body& b = add_box(g.scene, Vec3(0.012, 0.008, 0.044), Vec3::Zero());
  b.material = "brittle";
  b.anchors = {box(Vec3(-1, -1, 0.018), Vec3(1, 1, 1))};
  g.before = [](Simulation& s, int frame) {
    if (frame == 1) {
      int side = 1;
      for (const double z : {0.0101, 0.0021, -0.0119}) {
        s.cut(sweep(Vec3(0, -0.1, z), Vec3(0, 0.1, z),
                    {{0.05 * side, 0, 0}, {-0.0047 * side, 0, 0}}));
        side = -side;
      }
    }
    if (frame != 3) return;
    for (const BladePath& p :
         random_cuts(7, Vec3(0, 0, -0.006), Vec3(0.006, 0.004, 0.003), 0.006)) {
      s.cut(p);
    }
  };
  return g;
}

}  // namespace golden

/// All of them; a mesh that one needs is written to the folder.
inline std::vector<GoldenScene> golden_scenes(const TemporaryFolder& folder) {
  using namespace golden;
  return {service_cuts(),       scalpel(), tears(), three_tools(), two_bodies(), inclusions(),
          self_contact(folder), chain()};
}

}  // namespace tissue_sim
