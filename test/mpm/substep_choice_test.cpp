// The substep that is chosen: never above what the tissue was found to bear by power iteration, and
// not far below it.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <vector>

#include "math/lanczos.h"
#include "mpm/linearised_motion.h"
#include "mpm/tear/debris.h"
#include "reference/mpm_reference.h"
#include "support/cut_scenes.h"
#include "support/drooping_block.h"
#include "support/fixed_substeps.h"
#include "support/measured.h"
#include "support/stability_limit.h"
#include "support/test_scenes.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

double measured_limit(MpmTissue& tissue, int steps) {
  MpmState& s = tissue.state();
  LinearisedMotion motion(s, std::vector<std::uint8_t>(s.blocks.all.size(), 1));
  return 2 / std::sqrt(largest_eigenvalue(motion, steps));
}

TEST(SubstepChoice, LanczosFindsTheLimit) {
  for (const double nu : {0.3, 0.45}) {
    MpmTissue whole(soft_body(nu, Vec3(10, 8, 6))), cut(soft_body(nu, Vec3(10, 8, 6))),
        shattered(soft_body(nu, Vec3(6, 6, 6))), bent(soft_body(nu, Vec3(10, 8, 6)));
    const std::vector<BladePath> once = {plane_cut(Vec3::Zero(), Vec3(1, 0.6, 0.3))},
                                 often = random_planes(30, 0.012);
    advance_by(cut, 0, 0, {{}, once});
    advance_by(shattered, 0, 0, {{}, often});
    deform(bent.state());
    for (MpmTissue* tissue : {&whole, &cut, &shattered, &bent}) {
      tissue->finish();
      const double limit = stability_limit(*tissue);
      for (const int steps : {4, 8, 40, 200}) {  // those of the node, and what rounding would spoil
        EXPECT_TRUE(is_within("the measured limit against power iteration",
                              measured_limit(*tissue, steps) / limit - 1, 0.04))
            << nu << ", " << steps;
      }
    }
  }
}

TEST(SubstepChoice, OnlyWhatTakesPartIsStiff) {
  Scene two = soft_body(0.45, Vec3(6, 6, 6));
  two.bodies.push_back(two.bodies[0]);
  two.bodies[0].name = "soft";
  two.bodies[1].name = "stiff";
  two.materials.push_back(two.materials[0]);
  two.materials[1].name = "stiff";
  two.materials[1].young_modulus *= 9;
  two.bodies[1].material = "stiff";
  two.bodies[1].pose.position = Vec3(0.05, 0, 0);
  MpmTissue tissue(two);
  MpmState& s = tissue.state();
  double limit[2];
  for (int body = 0; body < 2; ++body) {
    std::vector<std::uint8_t> takes_part;
    for (const Block* b : s.blocks.all) takes_part.push_back(b->body == body);
    LinearisedMotion motion(s, takes_part);
    limit[body] = 2 / std::sqrt(largest_eigenvalue(motion, 20));
  }
  EXPECT_NEAR(limit[0] / limit[1], 3, 0.1);
}

TEST(SubstepChoice, ASliceOnePointThickBearsNearlyWhatWholeTissueDoes) {
  double limit[2];
  for (const bool sliced : {false, true}) {
    MpmTissue tissue(soft_body(0.45, Vec3(8, 8, 8)));
    const double cell = tissue.state().scene.cell_size;
    std::vector<BladePath> planes;
    for (int i = 0; sliced && i < 2; ++i) {
      planes.push_back(plane_cut((3.0 + i) * cell / 2 * Vec3::UnitX(), Vec3::UnitX()));
    }
    advance_by(tissue, 0, 0, {{}, planes});
    tissue.finish();
    const std::vector<std::uint8_t> all(tissue.state().blocks.all.size(), 1);
    LinearisedMotion motion(tissue.state(), all);
    limit[sliced] = 2 / std::sqrt(largest_eigenvalue(motion, 8));
    EXPECT_EQ(tissue.fragments().size(), sliced ? 3u : 1u);
  }
  EXPECT_GT(limit[1], 0.95 * limit[0]);
}

/// A body that a probe presses and a blade cuts through, and then the probe again.
TEST(SubstepChoice, HoldsWhileTissueIsPressedAndCut) {
  Scene s = operation_scene(Vec3(0.08, 0.024, 0.028), Vec3(0, 0, 0.02));
  s.device = Device::kCpu;
  s.tools[0].blade_length = 0.05;
  const Quat down = Quat(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
  Simulation simulation(s);
  auto& tissue = dynamic_cast<MpmTissue&>(simulation.tissue());
  double least = 1e9, most_gain = 0;
  for (int frame = 0; frame < 90; ++frame) {
    const double t = frame / 60.0;
    simulation.set_tool(0, {Vec3(0.002 + 0.01 * t, 0.03 - 0.08 * t, -0.001), down});
    simulation.set_tool(1, {Vec3(0.03, -0.003, 0.04 - 0.02 * std::min(t, 1.0)), down});
    const float cautious = tissue.stable_substep();
    const double limit = stability_limit(tissue);
    const FrameReport report = simulation.advance_frame();
    ASSERT_FALSE(report.result.blew_up) << frame;
    least = std::min(least, limit / report.result.substep);
    least = std::min(least, stability_limit(tissue) / report.result.substep);  // how it ended
    most_gain = std::max(most_gain, report.result.substep / cautious);
  }
  EXPECT_GT(tissue.fragments().size(), 1u);
  std::printf("limit over substep: %.2f at least; up to %.2f times the cautious substep\n", least,
              most_gain);
  EXPECT_TRUE(is_at_least("limit over the substep taken, probe and blade", least, 1.2));
  EXPECT_GT(most_gain, 1.3);
}

TEST(SubstepChoice, IsCautiousWhereItCannotKnow) {
  const Scene soft = soft_body(0.45, Vec3(8, 8, 8));
  const std::vector<BladePath> cut = random_planes(1, 0.012);
  MpmTissue tissue(soft);
  const float cautious = tissue.stable_substep();
  EXPECT_GT(tissue.substep_for({}), 1.2f * cautious);
  EXPECT_EQ(tissue.substep_for({{}, cut}), cautious);

  Scene tears = soft;
  tears.materials[0].tear_stretch = 1.5;
  MpmTissue torn(tears);
  EXPECT_GT(torn.substep_for({}), 1.2f * torn.stable_substep());
  torn.state().tore_at = {torn.state().time - 0.01};
  EXPECT_EQ(torn.substep_for({}), torn.stable_substep());

  Scene slow = soft;
  slow.cfl = 0.25;
  EXPECT_NEAR(MpmTissue(slow).substep_for({}), 0.5f * tissue.substep_for({}), 1e-3f * cautious);

  Scene with_probe = soft;
  with_probe.tools.resize(1);
  MpmTissue pressed(with_probe);
  ToolMotion fast;
  fast.present = true;
  fast.begin.position = Vec3(0, 0, 0.012);
  fast.end.position = Vec3(0, 0, -0.018);  // fifteen cells in a frame
  EXPECT_EQ(pressed.substep_for({{&fast, 1}, {}}), cautious);
}

TEST(SubstepChoice, UndoesWhatHasEnergyFromNowhere) {
  const auto borne = [](float worst_stiffening, double given, double gravity) {
    Scene scene = soft_body(0.45, Vec3(4, 4, 4));
    scene.gravity = Vec3(0, 0, -gravity);
    MpmTissue tissue(scene);
    MpmState& s = tissue.state();
    s.worst_stiffening = worst_stiffening;
    const std::vector<float> modulus(s.blocks.all.size(), 1e4f);
    const double dt = tissue.stable_substep(), mass = 1060 * std::pow(4 * s.scene.cell_size, 3);
    SubstepChoice choice;
    EXPECT_TRUE(choice.is_borne(s, modulus, dt, dt, {1, 1, 0, 0.1}));  // the first that is known
    EXPECT_TRUE(choice.is_borne(s, modulus, dt, dt, {1.02, 1.02, 0, 0.1}));
    EXPECT_TRUE(choice.is_borne(s, modulus, dt, dt, {0.5, 0.5, 0, 0.1}));
    // Falling at the speed that so much kinetic energy is.
    const double fall = 0.1 * gravity * std::sqrt(2 * 0.6 * mass);
    return choice.is_borne(s, modulus, dt, dt, {0.6, 0.5 + 0.9 * fall, given, 0.1});
  };
  EXPECT_FALSE(borne(10, 0, 0));
  EXPECT_FALSE(borne(10, 0.05, 0));
  EXPECT_TRUE(borne(10, 0.08, 0));   // an instrument did it
  EXPECT_TRUE(borne(10, 0.08, 20));  // or gravity
  EXPECT_FALSE(borne(10, 0, 20));
  EXPECT_TRUE(borne(2, 0, 0));  // nobody watches where tissue is hardly strained
}

TEST(SubstepChoice, DebrisAndSlicesAreSoft) {
  MpmTissue tissue(soft_body(0.45, Vec3(6, 6, 6)));
  const std::vector<BladePath> planes = random_planes(30, 0.012);
  advance_by(tissue, 0, 0, {{}, planes});
  tissue.finish();
  const MpmState& s = tissue.state();
  const std::vector<double> expected = reference::elastic_volumes(s);
  int debris = 0, slices = 0, others = 0;
  for (const Block* block : s.blocks.all) {
    for (std::size_t lane = 0; lane < block->lane_count(); ++lane) {
      const std::int32_t p = block->point[lane];
      if (p < 0) continue;
      const Fragment* piece = nullptr;
      for (const Fragment& f : tissue.fragments()) {
        if (f.id == tissue.fragment_of(p)) piece = &f;
      }
      ASSERT_NE(piece, nullptr);
      const bool bit = piece->point_count <= kDebrisPoints;
      const float share = block->volume[lane] / s.points.volume[p];
      const bool soft = share < 1;
      EXPECT_NEAR(share, soft ? kSoftness : 1, 1e-6f) << piece->point_count;
      EXPECT_TRUE(soft || !bit) << piece->point_count;
      EXPECT_NEAR(block->volume[lane], expected[p], 1e-6 * expected[p]) << piece->point_count;
      ++(bit ? debris : soft ? slices : others);
    }
  }
  EXPECT_GT(debris, 100);
  EXPECT_GT(slices, 100);
  EXPECT_GT(others, 100);
}

// At 4 mm a sixth of the points behind the face is outside, at 3 mm some have a hundredth of their
// stiffness alone. Both are drawn out several times as far as tissue, which took 2.6 and 4.1 times
// the substeps.
TEST(SubstepChoice, LightPointsAtAnAnchorDoNotShortenIt) {
  for (const double cell_size : {0.004, 0.003}) {
    const int light = substeps_of_drooping_block(Device::kCpu, cell_size);
    const int none = substeps_of_drooping_block(Device::kCpu, cell_size, 2 * cell_size);
    EXPECT_LT(light, 1.3 * none) << cell_size;
  }
}

}  // namespace
}  // namespace tissue_sim
