// Position-based dynamics on a GPU, against double precision and against the CPU.
#if defined(TISSUE_SIM_CUDA)
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "compute/cuda_check.h"
#include "pbd/cuda/cuda_pbd_tissue.h"
#include "pbd/pbd_reference.h"
#include "support/cut_paths.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

using Way = CudaPbdTissue::Way;

class PbdOnGpu : public testing::Test {
 protected:
  void SetUp() override {
    const std::string why = why_no_gpu();
    if (!why.empty()) GTEST_SKIP() << why;
  }
};

/// A slab of liver 40 x 24 x 12 mm, its lowest corner the origin, held at one end.
Scene slab(PbdModel model, PbdElasticity elasticity = PbdElasticity::kMaterial) {
  Scene scene;
  scene.method = Method::kPbd;
  scene.device = Device::kCuda;
  scene.pbd.model = model;
  scene.pbd.elasticity = elasticity;
  scene.cell_size = 0.004;
  scene.gravity = Vec3::Zero();
  scene.ground.enabled = false;
  scene.bodies.resize(1);
  scene.bodies[0].size = Vec3(0.04, 0.024, 0.012);
  scene.bodies[0].pose.position = 0.5 * scene.bodies[0].size;
  return scene;
}

void hold_one_end(Scene& scene) {
  scene.bodies[0].anchors.resize(1);
  scene.bodies[0].anchors[0].kind = Region::Kind::kBox;
  scene.bodies[0].anchors[0].min = Vec3(-1, -1, -1);
  scene.bodies[0].anchors[0].max = Vec3(0.006, 1, 1);
}

/// Vertices moved aside at random, and moving.
void disturb(pbd::State& s, float aside) {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> by(-1, 1);
  for (int i = 0; i < s.vertices.size(); ++i) {
    for (int a = 0; a < 3; ++a) {
      s.vertices.x[4 * i + a] += aside * by(random);
      s.vertices.v[4 * i + a] = s.vertices.anchored[i] != 0 ? 0 : 0.05f * by(random);
    }
  }
}

struct Off {
  double most = 0, moved = 0;  ///< the largest difference, and the largest way [m]
};

Off difference(const pbd::State& s, const std::vector<Vec3>& from, const std::vector<Vec3>& to) {
  Off off;
  for (std::size_t i = 0; i < to.size(); ++i) {
    off.most = std::max(off.most, (s.vertices.position(static_cast<int>(i)) - to[i]).norm());
    off.moved = std::max(off.moved, (to[i] - from[i]).norm());
  }
  return off;
}

struct Model {
  const char* name;
  PbdModel model;
  PbdElasticity elasticity;
};
constexpr Model kModels[] = {
    {"surface", PbdModel::kSurface, PbdElasticity::kMaterial},
    {"material", PbdModel::kTetrahedra, PbdElasticity::kMaterial},
    {"strain", PbdModel::kTetrahedra, PbdElasticity::kStrain},
};

TEST_F(PbdOnGpu, EachKindIsProjectedAsInDoublePrecision) {
  for (int kind = 0; kind < 4; ++kind) {  // as project_constraints() has them
    const Model& model = kModels[kind == 0 ? 1 : kind == 1 ? 2 : 0];
    CudaPbdTissue tissue(slab(model.model, model.elasticity));
    pbd::State& s = tissue.state();
    const auto none = [](int) { return true; };
    if (kind != 0) s.elastics.remove_if(none);
    if (kind != 1) s.strains.remove_if(none);
    if (kind != 2) s.links.remove_if(none);
    if (kind != 3) s.bends.remove_if(none);
    ASSERT_GT(s.elastics.size() + s.strains.size() + s.links.size() + s.bends.size(), 100);
    pbd::pack(s);
    disturb(s, 3e-4f);
    tissue.push_all();
    constexpr double kStep = 1e-3;
    reference::PbdPlaces expected = reference::pbd_places(s);
    const std::vector<Vec3> from = expected.x;
    reference::PbdMultipliers multipliers;
    reference::project_constraints(s, kStep, expected, multipliers);
    tissue.project(static_cast<float>(kStep));
    const Off off = difference(tissue.state(), from, expected.x);
    EXPECT_GT(off.moved, 1e-5) << kind;
    EXPECT_LT(off.most, 1e-3 * off.moved) << kind;
  }
}

TEST_F(PbdOnGpu, AStepIsThatOfTheReferenceHoweverItIsLaunched) {
  for (const Model& model : kModels) {
    for (const int iterations : {1, 3}) {
      for (const Way way : {Way::kLaunches, Way::kOneBlock}) {
        Scene scene = slab(model.model, model.elasticity);
        hold_one_end(scene);
        scene.gravity = Vec3(1, 0, -9.81);
        scene.damping = 20;
        scene.materials.push_back(find_material(scene, scene.bodies[0].material));
        scene.materials.back().viscosity = 0;  // the reference has none
        scene.pbd.steps = 1;
        scene.pbd.iterations = iterations;
        CudaPbdTissue tissue(scene);
        tissue.set_way(way);
        pbd::State& s = tissue.state();
        disturb(s, 2e-4f);
        tissue.push();
        constexpr double kStep = 1e-3;
        const std::vector<Vec3> from = reference::pbd_places(s).x;
        const std::vector<Vec3> expected = reference::step(s, kStep).x;
        std::vector<Vec3> before;
        for (int i = 0; i < s.vertices.size(); ++i) before.push_back(s.vertices.position(i));
        tissue.advance(kStep, {});
        const Off off = difference(tissue.state(), from, expected);
        EXPECT_GT(off.moved, 5e-5);
        EXPECT_LT(off.most, 1e-3 * off.moved)
            << model.name << ", " << iterations << " iterations, way " << static_cast<int>(way);
        double slip = 0;
        for (int i = 0; i < s.vertices.size(); ++i) {
          const Vec3 way_gone = s.vertices.position(i) - before[i];
          slip = std::max(slip, (kStep * s.vertices.velocity(i) - way_gone).norm());
        }
        EXPECT_LT(slip, 2e-8) << "velocities are not what vertices moved by";
      }
    }
  }
}

/// What vertices move by apart from one another is lost as on the CPU, of what flies and of what is
/// held, and where it was cut; the host did it.
TEST_F(PbdOnGpu, WhatIsViscousIsDampedAsOnTheCpu) {
  struct Velocities {
    std::vector<Vec3> before, after;
  };
  const auto most = [](const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
    double d = 0;
    for (std::size_t i = 0; i < a.size(); ++i) d = std::max(d, (a[i] - b[i]).norm());
    return d;
  };
  const auto velocities = [](PbdTissue& tissue) {
    std::vector<Vec3> v;
    const pbd::Vertices& all = tissue.state().vertices;
    for (int i = 0; i < all.size(); ++i) v.push_back(all.velocity(i));
    return v;
  };
  for (const bool is_held : {false, true}) {
    for (const bool is_cut : {false, true}) {
      const auto run = [&](Device device, Way way) {
        Scene scene = slab(PbdModel::kSurface);
        if (is_held) hold_one_end(scene);
        scene.device = device;
        scene.materials.push_back(find_material(scene, scene.bodies[0].material));
        scene.materials.back().viscosity = 2;
        scene.pbd.edge = 1e-6;  // edges, and next to nothing else that acts
        scene.pbd.bending = scene.pbd.internal = 0;
        Simulation simulation(scene);
        auto& tissue = dynamic_cast<PbdTissue&>(simulation.tissue());
        auto* const on_gpu = dynamic_cast<CudaPbdTissue*>(&tissue);
        if (on_gpu != nullptr) on_gpu->set_way(way);
        if (is_cut) {
          simulation.cut(upright_blade({Vec3(0.027, -0.1, 0), Vec3(0.027, 0.1, 0)}));
          simulation.advance_frame();
          EXPECT_EQ(tissue.fragments().size(), 2u);
        }
        disturb(tissue.state(), 0);
        // Lips that a device's rounding left 1e-8 m deep in the cut's frame would give that back
        // as 1e-4 m/s within a step.
        pbd::Vertices& all = tissue.state().vertices;
        for (int i = 0; i < all.size(); ++i) {
          for (int a = 0; a < 3; ++a) {
            all.x[4 * i + a] = static_cast<float>(all.reference[i][a]);
            all.moved[4 * i + a] = 0;
          }
        }
        Velocities v;
        v.before = velocities(tissue);
        if (on_gpu != nullptr) on_gpu->push();
        tissue.advance(2e-3, {});
        v.after = velocities(tissue);
        return v;
      };
      const Velocities cpu = run(Device::kCpu, Way::kFaster);
      EXPECT_GT(most(cpu.before, cpu.after), 0.02);
      for (const Way way : {Way::kLaunches, Way::kOneBlock}) {
        const Velocities gpu = run(Device::kCuda, way);
        ASSERT_EQ(gpu.after.size(), cpu.after.size());
        EXPECT_EQ(most(gpu.before, cpu.before), 0);
        EXPECT_LT(most(gpu.after, cpu.after), 1e-4) << is_held << is_cut << static_cast<int>(way);
      }
    }
  }
}

TEST_F(PbdOnGpu, FiguresAreTheCpus) {
  for (const Model& model : kModels) {
    Scene scene = slab(model.model, model.elasticity);
    scene.pbd.steps = 1;
    FrameResult of[2];
    for (const Device device : {Device::kCpu, Device::kCuda}) {
      scene.device = device;
      const auto tissue = make_tissue(scene);
      auto& pbd_tissue = dynamic_cast<PbdTissue&>(*tissue);
      disturb(pbd_tissue.state(), 2e-4f);
      if (device == Device::kCuda) dynamic_cast<CudaPbdTissue&>(*tissue).push();
      tissue->advance(1e-4, {});
      of[device == Device::kCuda ? 1 : 0] = tissue->finish();
    }
    EXPECT_GT(of[0].elastic_energy, model.elasticity == PbdElasticity::kStrain ? -1.0 : 1e-9);
    EXPECT_NEAR(of[1].elastic_energy, of[0].elastic_energy, 1e-3 * of[0].elastic_energy)
        << model.name;
    EXPECT_NEAR(of[1].kinetic_energy, of[0].kinetic_energy, 1e-3 * of[0].kinetic_energy);
    EXPECT_NEAR(of[1].max_speed, of[0].max_speed, 1e-3 * of[0].max_speed);
    EXPECT_FALSE(of[1].blew_up);
  }
}

/// What the tissue below comes to.
struct Pressed {
  std::vector<Vec3> places;
  std::vector<int> pieces;
  double force = 0, moment = 0;  ///< the largest [N], [N m]
  double linear = 0;             ///< momentum at the end [kg m/s]
  std::uint64_t checksum = 0;
};

void press_frame(Simulation& simulation, int frame) {
  const Quat down(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
  const double depth = 0.0004 * std::min(frame, 12 - frame);
  simulation.set_tool(0, {Vec3(0.012 + 0.0002 * frame, 0.012, 0.0125 - depth), down});
  if (frame == 4) simulation.cut(upright_blade({Vec3(0.027, -0.1, 0), Vec3(0.027, 0.1, 0)}));
}

Scene pressed_slab(const Model& model, Device device, int iterations = 1) {
  Scene scene = slab(model.model, model.elasticity);
  scene.device = device;
  scene.gravity = Vec3(0, 0, -9.81);
  scene.ground.enabled = true;
  scene.damping = 5;
  scene.pbd.iterations = iterations;
  scene.tools.resize(1);
  return scene;
}

/// On the ground a probe presses and drags, a blade cuts, the probe leaves.
Pressed press(const Scene& scene, Way way) {
  Simulation simulation(scene);
  if (auto* on_gpu = dynamic_cast<CudaPbdTissue*>(&simulation.tissue())) on_gpu->set_way(way);
  Pressed run;
  for (int frame = 0; frame < 12; ++frame) {
    press_frame(simulation, frame);
    const FrameReport report = simulation.advance_frame();
    EXPECT_FALSE(report.result.blew_up);
    run.force = std::max(run.force, report.result.loads[0].mean.force.norm());
    run.moment = std::max(run.moment, report.result.loads[0].mean.torque.norm());
    if (frame == 4) {
      EXPECT_EQ(report.result.cut_reports[0].new_fragments.size(), 1u);
    }
  }
  auto& tissue = dynamic_cast<PbdTissue&>(simulation.tissue());
  run.places = reference::pbd_places(tissue.state()).x;
  for (const Fragment& f : tissue.fragments()) run.pieces.push_back(f.point_count);
  run.linear = tissue.momentum().linear.norm();
  run.checksum = tissue.checksum();
  return run;
}

TEST_F(PbdOnGpu, PressedAndCutItMovesAsOnTheCpu) {
  for (const Model& model : kModels) {
    const Pressed cpu = press(pressed_slab(model, Device::kCpu), Way::kFaster);
    EXPECT_GT(cpu.force, 1e-2);
    for (const Way way : {Way::kLaunches, Way::kOneBlock}) {
      const Pressed gpu = press(pressed_slab(model, Device::kCuda), way);
      ASSERT_EQ(cpu.places.size(), gpu.places.size());
      double worst = 0;
      for (std::size_t i = 0; i < cpu.places.size(); ++i) {
        worst = std::max(worst, (cpu.places[i] - gpu.places[i]).norm());
      }
      EXPECT_LT(worst, 2e-5) << model.name << ", of 2.4 mm that it was pressed";
      EXPECT_EQ(cpu.pieces, gpu.pieces);
      EXPECT_NEAR(gpu.force, cpu.force, 2e-3 * cpu.force) << model.name;
      EXPECT_NEAR(gpu.moment, cpu.moment, 2e-3 * cpu.moment + 1e-6) << model.name;
    }
  }
}

TEST_F(PbdOnGpu, TheSameBitsRunAfterRun) {
  for (const Model& model : kModels) {
    for (const Way way : {Way::kLaunches, Way::kOneBlock}) {
      const Scene scene = pressed_slab(model, Device::kCuda, 2);
      const Pressed one = press(scene, way), other = press(scene, way);
      EXPECT_EQ(one.checksum, other.checksum) << model.name;
      EXPECT_EQ(one.force, other.force);
      EXPECT_EQ(one.moment, other.moment);
    }
  }
}

TEST_F(PbdOnGpu, AStateGoesOnWithTheSameBits) {
  for (const Model& model : kModels) {
    const Scene scene = pressed_slab(model, Device::kCuda);
    Simulation whole(scene), other(scene);
    for (int frame = 0; frame < 6; ++frame) {  // the cut is in it
      press_frame(whole, frame);
      whole.advance_frame();
    }
    const std::vector<std::uint8_t> saved = whole.save();
    other.restore(saved);
    for (int frame = 6; frame < 9; ++frame) {
      for (Simulation* simulation : {&whole, &other}) {
        press_frame(*simulation, frame);
        simulation->advance_frame();
      }
    }
    EXPECT_EQ(whole.tissue().checksum(), other.tissue().checksum()) << model.name;
  }
}

/// It flies and spins.
void throw_first_body(CudaPbdTissue& tissue, const Scene& scene) {
  pbd::State& s = tissue.state();
  for (int i = 0; i < s.vertices.size(); ++i) {
    if (s.vertices.body[i] != 0) continue;
    const Vec3 v = Vec3(0.1, 0.2, -0.05) +
                   Vec3(1, -2, 3).cross(s.vertices.position(i) - scene.bodies[0].pose.position);
    for (int a = 0; a < 3; ++a) s.vertices.v[4 * i + a] = static_cast<float>(v[a]);
  }
  tissue.push();
}

/// Two bodies, one of which flies and spins while the other is held.
TEST_F(PbdOnGpu, WhatFliesKeepsItsMomentum) {
  for (const Way way : {Way::kLaunches, Way::kOneBlock}) {
    Scene scene = slab(PbdModel::kSurface);
    scene.bodies.push_back(scene.bodies[0]);
    scene.bodies[1].name = "held";
    scene.bodies[1].pose.position += Vec3(0, 0, 0.1);
    scene.bodies[1].anchors.resize(1);
    scene.bodies[1].anchors[0].z = 1;
    CudaPbdTissue tissue(scene);
    tissue.set_way(way);
    throw_first_body(tissue, scene);
    const Momentum before = tissue.momentum();
    for (int frame = 0; frame < 30; ++frame) {
      tissue.advance(1 / scene.frame_rate, {});
      EXPECT_FALSE(tissue.finish().blew_up);
    }
    const Momentum after = tissue.momentum();
    EXPECT_GT((after.centre - before.centre).norm(), 1e-2);
    EXPECT_LT((after.linear - before.linear).norm(), 1e-6 * before.linear.norm());
    // Of both bodies about the centre of all: what flies takes that with it.
    const auto about_origin = [](const Momentum& m) -> Vec3 {
      return m.angular + m.centre.cross(m.linear);
    };
    EXPECT_LT((about_origin(after) - about_origin(before)).norm(),
              1e-4 * about_origin(before).norm());
  }
}

TEST_F(PbdOnGpu, AFewVerticesAreOneBlocksAndManyAreNot) {
  CudaPbdTissue few(slab(PbdModel::kSurface));
  EXPECT_EQ(few.way(), Way::kOneBlock);
  Scene scene = slab(PbdModel::kTetrahedra);
  scene.cell_size = 0.001;
  CudaPbdTissue many(scene);
  EXPECT_EQ(many.way(), Way::kLaunches);
}

}  // namespace
}  // namespace tissue_sim
#endif
