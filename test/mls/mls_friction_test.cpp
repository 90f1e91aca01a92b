// Faces of meshless tissue that touch one another: friction, momenta, the same on both devices.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "mls_scenes.h"
#include "support/measured.h"
#include "tissue/each_method.h"
#if defined(TISSUE_SIM_CUDA)
#include "mls/cuda/cuda_mls_tissue.h"
#endif

namespace tissue_sim {
namespace {

constexpr double kGravity = 9.81;  // m/s^2
constexpr double kFriction = 0.3;
constexpr double kBase = 0.008;  // height of what lies below [m]

/// A soft block lies askew on another one that is held from below.
Scene block_on_another(MlsPlacement placement) {
  Scene scene;
  scene.method = Method::kMls;
  scene.cell_size = 0.004;
  scene.mls.spacing = 0.002;
  scene.mls.placement = placement;
  scene.mls.contact = MlsContact::kFaces;
  scene.ground.enabled = false;
  scene.damping = 0;
  Material m;
  m.name = "soft";
  m.young_modulus = 10000;
  m.viscosity = 3;
  m.friction = kFriction;
  scene.materials.push_back(m);
  Body base, top;
  base.name = "base";
  top.name = "top";
  base.material = top.material = "soft";
  base.size = Vec3(0.06, 0.03, kBase);
  base.pose.position = Vec3(0, 0, 0.5 * kBase);
  Region held;
  held.kind = Region::Kind::kBelow;
  held.z = 0.51 * kBase;
  base.anchors.push_back(held);
  top.size = Vec3(0.014, 0.012, 0.008);
  top.pose.position = Vec3(-0.0137, 0.0004, kBase + 0.004);
  top.pose.orientation = Quat(Eigen::AngleAxisd(0.5, Vec3::UnitZ()));
  scene.bodies = {base, top};
  scene.gravity = Vec3(0, 0, -kGravity);
  return scene;
}

Vec3 tilted(double degrees) {
  const double angle = degrees * M_PI / 180;
  return kGravity * Vec3(std::sin(angle), 0, -std::cos(angle));
}

class MlsFriction : public testing::TestWithParam<MethodOnDevice> {
 protected:
  void SetUp() override {
    const std::string why = why_not(GetParam());
    if (!why.empty()) GTEST_SKIP() << why;
  }
  Scene on_this(Scene scene) const {
    scene.device = GetParam().device;
    return scene;
  }
};

constexpr MlsPlacement kPlacements[] = {MlsPlacement::kRegular, MlsPlacement::kGraded};

TEST_P(MlsFriction, ABlockSlidesOnAnotherAsCoulombSays) {
  for (const MlsPlacement placement : kPlacements) {
    for (const double degrees : {14.0, 24.0}) {  // it slides from 16.7 on
      Simulation simulation(on_this(block_on_another(placement)));
      const auto top = [&] { return simulation.tissue().fragments()[1]; };
      for (int f = 0; f < 12; ++f) simulation.advance_frame();
      simulation.set_gravity(tilted(degrees));
      for (int f = 0; f < 4; ++f) simulation.advance_frame();
      const Fragment before = top();
      constexpr int kFrames = 6;
      for (int f = 0; f < kFrames; ++f) {
        ASSERT_FALSE(simulation.advance_frame().result.blew_up);
      }
      const Fragment after = top();
      const double time = kFrames / simulation.scene().frame_rate, angle = degrees * M_PI / 180;
      const double gained = (after.velocity[0] - before.velocity[0]) / time;
      const double friction = (kGravity * std::sin(angle) - gained) / (kGravity * std::cos(angle));
      std::printf("placement %d, %.0f degrees: friction %.4f, moved %.2e m, %.1e m/s aside\n",
                  static_cast<int>(placement), degrees, friction,
                  after.centroid[0] - before.centroid[0], after.velocity[1]);
      if (degrees > 20) {
        const double within = placement == MlsPlacement::kGraded ? 0.05 : 0.03;
        EXPECT_TRUE(is_within(placement == MlsPlacement::kGraded ? "friction of a block, graded"
                                                                 : "friction of a block",
                              friction / kFriction - 1, within));
        EXPECT_LT(std::fabs(after.velocity[1]), 0.02 * after.velocity[0]);
        EXPECT_NEAR(after.centroid[2], before.centroid[2], 2e-5);  // without a bump
      } else {
        EXPECT_LT(after.velocity.norm(), 2e-3);
        EXPECT_LT(after.centroid[0] - before.centroid[0], 1e-4);
      }
    }
  }
}

TEST_P(MlsFriction, AToolFeelsWhatItPushesAlongAnotherBlock) {
  Scene scene = on_this(block_on_another(MlsPlacement::kGraded));
  scene.bodies[1].pose.orientation = Quat::Identity();
  scene.damping = 5;
  scene.tools.resize(1);
  scene.tools[0].radius = 0.003;
  scene.tools[0].friction = 0;
  Simulation simulation(scene);
  double sum = 0;
  constexpr int kFrames = 60, kFrom = 30;
  for (int f = 0; f < kFrames; ++f) {
    const double x = -0.0137 - 0.007 - 0.004 + 0.015 * f / kFrames;  // the tip's
    simulation.set_tool(
        0, {Vec3(x, 0.0004, kBase + 0.004), Quat::FromTwoVectors(Vec3::UnitZ(), Vec3::UnitX())});
    const FrameReport report = simulation.advance_frame();
    ASSERT_FALSE(report.result.blew_up);
    if (f >= kFrom) sum += report.result.loads[0].mean.force[0];
  }
  const Fragment top = simulation.tissue().fragments()[1];
  const double weight = kGravity * 0.014 * 0.012 * 0.008 * scene.materials[0].density;
  const double push = -sum / (kFrames - kFrom);
  std::printf("push %.3f of the weight, moved %.2e m\n", push / weight, top.centroid[0] + 0.0137);
  EXPECT_GT(top.centroid[0], -0.0137 + 0.006);
  EXPECT_NEAR(push, kFriction * weight, 0.06 * kFriction * weight);
}

std::unique_ptr<MlsTissue> make_on(const Scene& scene) {
#if defined(TISSUE_SIM_CUDA)
  if (scene.device == Device::kCuda) return std::make_unique<CudaMlsTissue>(scene);
#endif
  return std::make_unique<MlsTissue>(scene);
}

/// Takes what the test changed over to where it lives.
void push(MlsTissue& tissue) {
#if defined(TISSUE_SIM_CUDA)
  if (auto* on_gpu = dynamic_cast<CudaMlsTissue*>(&tissue)) on_gpu->push();
#else
  (void)tissue;
#endif
}

Vec3 about_origin(const Momentum& m) { return m.angular + m.centre.cross(m.linear); }

TEST_P(MlsFriction, BothMomentaStayWhereBlocksRubOneAnother) {
  for (const MlsPlacement placement : kPlacements) {
    Scene scene = on_this(block_on_another(placement));
    scene.gravity = Vec3::Zero();
    scene.bodies[0].anchors.clear();
    scene.bodies[0].size = Vec3(0.02, 0.02, kBase);
    scene.bodies[1].pose.position = Vec3(-0.004, 0.002, kBase + 0.0042);
    const auto tissue = make_on(scene);
    MlsState& s = tissue->state();
    for (int i = 0; i < s.count(); ++i) {
      if (s.nodes.body[i] == 0) continue;
      s.v[4 * i] = 0.4f + 20 * s.place[4 * i + 1];
      s.v[4 * i + 1] = -20 * s.place[4 * i];
      s.v[4 * i + 2] = -0.3f;
    }
    push(*tissue);
    const Momentum before = tissue->momentum();
    double slowest = 1;
    for (int f = 0; f < 20; ++f) {
      tissue->advance(1 / 240.0, {});
      ASSERT_FALSE(tissue->finish().blew_up);
      slowest = std::min(slowest, tissue->fragments()[1].velocity[0]);
    }
    const Momentum after = tissue->momentum();
    EXPECT_LT(slowest, 0.37);  // it was braked
    EXPECT_GT(tissue->fragments()[0].velocity[0], 0.005);
    EXPECT_LT((after.linear - before.linear).norm(), 3e-5 * before.linear.norm());
    EXPECT_LT((about_origin(after) - about_origin(before)).norm(),
              3e-5 * about_origin(before).norm());
  }
}

TEST(MlsFrictionBits, AreTheSameForAnyNumberOfThreads) {
  std::vector<std::uint64_t> checksums;
  for (const int threads : {1, 2, 5}) {
    Scene scene = block_on_another(MlsPlacement::kGraded);
    scene.threads = threads;
    scene.gravity = tilted(24);
    MlsTissue tissue(scene);
    for (int f = 0; f < 6; ++f) tissue.advance(1 / 60.0, {});
    checksums.push_back(tissue.checksum());
  }
  EXPECT_EQ(checksums[0], checksums[1]);
  EXPECT_EQ(checksums[0], checksums[2]);
}

#if defined(TISSUE_SIM_CUDA)
// What nodes push one another within a substep, of blocks pressed and sheared at random.
TEST(MlsFrictionOnGpu, IsThatOfTheCpu) {
  if (!why_no_gpu().empty()) GTEST_SKIP() << why_no_gpu();
  for (const MlsPlacement placement : kPlacements) {
    for (const bool is_cut : {false, true}) {
      Scene scene = block_on_another(placement);
      scene.gravity = Vec3::Zero();
      std::vector<Vec3> v[2];
      double pushed = 0, contact = 0;
      for (const bool on_gpu : {false, true}) {
        scene.device = on_gpu ? Device::kCuda : Device::kCpu;
        const auto tissue = make_on(scene);
        MlsState& s = tissue->state();
        if (is_cut) tissue->cut_now(plane_cut(Vec3(0, 0.0007, 0), Vec3(0.3, 1, 0.2)));
        std::mt19937 random(7);
        const auto even = [&] { return static_cast<float>(random()) / 4294967296.0f - 0.5f; };
        for (int i = 0; i < s.count(); ++i) {
          for (int a = 0; a < 3; ++a) {
            s.u[4 * i + a] = 1e-4f * even();
            s.v[4 * i + a] = 0.02f * even();
          }
          if (s.nodes.body[i] == 1) {
            s.u[4 * i + 2] -= 2e-4f;
            s.v[4 * i] += 0.5f;
          }
        }
        push(*tissue);
        constexpr int kSubsteps = 3;
        for (int k = 0; k < kSubsteps; ++k) tissue->advance(2e-5, {});
        tissue->checksum();  // brings motion to the host
        for (int i = 0; i < s.count(); ++i) v[on_gpu].push_back(s.velocity(i));
        if (on_gpu) continue;
        for (std::size_t k = 0; k < s.node_contacts.node.size(); ++k) {
          const double f = std::fabs(s.node_contacts.force[4 * k]);
          contact = std::max(contact, f);
          pushed += f > 0 ? 1 : 0;
        }
      }
      EXPECT_GT(pushed, 20);
      EXPECT_GT(contact, 1e-5);
      double most = 0, off = 0;
      for (std::size_t i = 0; i < v[0].size(); ++i) {
        most = std::max(most, v[0][i].norm());
        off = std::max(off, (v[1][i] - v[0][i]).norm());
      }
      EXPECT_LT(off, 2e-5 * most) << "placement " << static_cast<int>(placement)
                                  << (is_cut ? ", cut" : "");
    }
  }
}
#endif

INSTANTIATE_TEST_SUITE_P(Each, MlsFriction,
                         testing::Values(MethodOnDevice{Method::kMls, Device::kCpu},
                                         MethodOnDevice{Method::kMls, Device::kCuda}),
                         name_of_case);

}  // namespace
}  // namespace tissue_sim
