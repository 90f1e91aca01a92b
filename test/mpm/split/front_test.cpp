// The front of a cut: it ends where the blade's edge ended, wherever that lies in a cell. Its
// compliance: EdgeCrack. A substep on a GPU: cuda/front_test.cpp.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "support/cut_scenes.h"
#include "support/either_device.h"
#include "support/finite_element_scenes.h"
#include "support/fixed_substeps.h"
#include "support/measured.h"
#include "support/momentum.h"

namespace tissue_sim {
namespace {

const char* const kData = TISSUE_SIM_TEST_DATA;

/// A block of 40 x 32 x 24 mm in space, and a stroke into it from the side, askew.
Scene block(Law law, double viscosity) {
  Scene scene = free_box(Vec3(0.04, 0.032, 0.024), 0.004);
  Material m;
  m.name = "test";
  m.law = law;
  m.viscosity = viscosity;
  scene.materials = {m};
  scene.bodies[0].material = "test";
  return scene;
}

BladePath stroke(double from, double to) {
  BladePath path = upright_blade({Vec3(0.0185, from, 0), Vec3(0.0225, to, 0)});
  for (Pose& pose : path.poses) pose.position.x() = 0.0185 + 0.1 * pose.position.y();
  return path;
}

double share_sum(const MpmState& s) {
  double sum = 0;
  for (const FrontNode& n : s.front.nodes) sum += n.share;
  return sum;
}

template <class T>
class Front : public OnEitherDevice<T> {};
TYPED_TEST_SUITE(Front, Tissues, DeviceName);

TYPED_TEST(Front, IsTheSameHoweverSlowlyABladeCame) {
  TypeParam fast(block(Law::kNeoHookean, 0)), slow(block(Law::kNeoHookean, 0));
  cut_now(fast, stroke(-0.01, 0.0173));
  constexpr int kStrokes = 23;
  for (int i = 0; i < kStrokes; ++i) {
    const double length = 0.0273 / kStrokes;
    cut_now(slow, stroke(-0.01 + i * length, -0.01 + (i + 1) * length));
  }
  const auto &a = fast.state().front, &b = slow.state().front;
  ASSERT_GT(a.nodes.size(), 10u);
  ASSERT_EQ(a.nodes.size(), b.nodes.size());
  for (std::size_t i = 0; i < a.nodes.size(); ++i) {
    const FrontNode &x = a.nodes[i], &y = b.nodes[i];
    EXPECT_EQ(std::make_tuple(x.body, x.x, x.y, x.z), std::make_tuple(y.body, y.x, y.y, y.z));
    EXPECT_NEAR(x.share, y.share, 0.01) << x.x << ' ' << x.y << ' ' << x.z;
    EXPECT_EQ(x.first_side, y.first_side);
  }
}

TYPED_TEST(Front, IsNoneOfACutThatGoesThrough) {
  TypeParam tissue(block(Law::kNeoHookean, 0));
  cut_now(tissue, stroke(-0.01, 0.0173));
  EXPECT_GT(tissue.state().front.cells.size(), 0u);
  cut_now(tissue, stroke(0.0173, 0.05));
  EXPECT_EQ(tissue.state().front.cells.size(), 0u);
  EXPECT_EQ(tissue.fragment_count(), 2);
}

// The plane through the first few bonds puts points on a side that the cut, as it turns, does not
// leave them on.
TYPED_TEST(Front, IsNoneOfACutThatTurnsAndGoesThrough) {
  TypeParam tissue(block(Law::kNeoHookean, 0));
  constexpr int kStrokes = 50;
  const auto place = [](int i) {
    const double y = -0.012 + 0.06 * i / kStrokes;
    return Pose{Vec3(0.015 + 0.006 * std::sin(200 * y), y, 0), Quat::Identity()};
  };
  for (int i = 0; i < kStrokes; ++i) {
    BladePath path;
    path.edge = {Vec3(-0.009, 0, -0.03), Vec3(0.017, 0, 0.05)};
    path.poses = {place(i), place(i + 1)};
    cut_now(tissue, path);
  }
  EXPECT_EQ(tissue.fragment_count(), 2);
  EXPECT_EQ(tissue.state().front.cells.size(), 0u);
}

TYPED_TEST(Front, OnlyGoesOn) {
  TypeParam tissue(block(Law::kNeoHookean, 0));
  double before = 0, y = -0.01;
  for (double to = 0.011; to < 0.0131; to += 0.0003) {  // within half a cell
    cut_now(tissue, stroke(y, to));
    y = to;
    const double now = share_sum(tissue.state());
    EXPECT_GE(now, before);
    before = now;
  }
  const auto bonds = tissue.state().points.bonds;
  cut_now(tissue, stroke(-0.01, 0.012));  // again, less deep
  EXPECT_EQ(share_sum(tissue.state()), before);
  EXPECT_EQ(tissue.state().points.bonds, bonds);
}

/// Flies and spins with a front that opens: momentum stays, energy does.
template <class T>
void flies(Law law) {
  T tissue(block(law, 0));
  MpmState& s = tissue.state();
  cut_now(tissue, stroke(-0.01, 0.0173));
  const std::vector<Vec3> home = homes(s);
  const Vec3 center(0.02, 0.016, 0.012);
  for (std::size_t i = 0; i < home.size(); ++i) {
    const Vec3 X = home[i] - center;
    const Vec3 opening(X.x() > 0 ? 8 * (0.016 - X.y()) : -8 * (0.016 - X.y()), 0, 0);
    const Vec3 v = Vec3(0.1, -0.06, 0.08) + Vec3(3, 5, -4).cross(X) + opening;
    for (int c = 0; c < 3; ++c) s.nodes.v[c][i] = static_cast<float>(v[c]);
  }
  push(tissue);
  const Momentum before = tissue.momentum();
  const float dt = 0.3f * tissue.stable_substep();
  advance_by(tissue, 1, dt, {});
  const FrameResult first = tissue.finish();
  const double energy = first.kinetic_energy + first.elastic_energy;
  double opened = 0, least = energy, most = energy;
  for (int i = 0; i < 20; ++i) {
    if (i == 10) cut_now(tissue, stroke(0.0173, 0.0212));  // nodes part for good on the way
    advance_by(tissue, 100, dt, {});
    const FrameResult r = tissue.finish();
    if (i < 4) least = std::min(least, r.kinetic_energy + r.elastic_energy);  // later faces touch
    most = std::max(most, r.kinetic_energy + r.elastic_energy);
    pull(tissue);
    for (const float d : s.front.d[0]) opened = std::max<double>(opened, std::fabs(d));
  }
  const Momentum after = tissue.momentum();
  EXPECT_GT(opened, 1e-4);
  EXPECT_LT((after.linear - before.linear).norm(), 3e-5 * before.linear.norm());
  EXPECT_LT((after.angular - before.angular).norm(), 3e-5 * before.angular.norm());
  EXPECT_LT(most, 1.003 * energy);
  EXPECT_GT(least, 0.997 * energy);
}
TYPED_TEST(Front, KeepsMomentumAndEnergyNeoHookean) { flies<TypeParam>(Law::kNeoHookean); }
TYPED_TEST(Front, KeepsMomentumAndEnergyCorotated) { flies<TypeParam>(Law::kFixedCorotated); }

TYPED_TEST(Front, SameBitsOnAnyNumberOfThreadsAndAfterItWasSaved) {
  std::uint64_t sums[3];
  for (int run = 0; run < 3; ++run) {
    Scene scene = block(Law::kFixedCorotated, 0.5);
    scene.gravity = Vec3(3, 0, -9.81);
    scene.bodies[0].anchors = {beyond(1, 0.03, true)};
    scene.threads = run == 0 ? 1 : 2;
    auto tissue = std::make_unique<TypeParam>(scene);
    const BladePath path = stroke(-0.01, 0.0173);
    tissue->advance(1.0 / 60, {{}, {&path, 1}});
    tissue->finish();
    if (run == 2) {
      const std::vector<std::uint8_t> saved = tissue->save();
      tissue = std::make_unique<TypeParam>(scene);
      tissue->restore(saved);
    }
    ASSERT_GT(tissue->state().front.cells.size(), 0u);
    for (int i = 0; i < 3; ++i) {
      tissue->advance(1.0 / 60, {});
      EXPECT_FALSE(tissue->finish().blew_up);
    }
    sums[run] = tissue->checksum();
  }
  EXPECT_EQ(sums[0], sums[1]);
  EXPECT_EQ(sums[0], sums[2]);
}

/// Displacement along x of the top at the middle of a cut at x = 10 mm, on one side of it [m]: of
/// the points within two cells, fitted by a polynomial.
double beside_cut(Tissue& tissue, bool beyond, double cell_size) {
  std::vector<std::uint8_t> cloud;
  PointSelection selection;
  selection.fields = kRestPosition | kDisplacement;
  const int count = tissue.read_points(selection, cloud);
  Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> b = Eigen::Matrix<double, 6, 1>::Zero();
  for (int i = 0; i < count; ++i) {
    float f[6];
    std::memcpy(f, &cloud[selection.point_size() * i + sizeof(Point)], sizeof f);
    const Vec3 d = (Vec3(f[0], f[1], f[2]) - Vec3(0.01, 0, 0.02)) / (2 * cell_size);
    if (d.cwiseAbs().maxCoeff() > 1 || (d.x() > 0) != beyond) continue;
    Eigen::Matrix<double, 6, 1> row;
    row << 1, d.x(), d.z(), d.x() * d.z(), d.z() * d.z(), d.y() * d.y();
    A += row * row.transpose();
    b += row * static_cast<double>(f[3]);
  }
  return A.ldlt().solve(b)[0];
}

constexpr double kCell = 0.0025;

/// How far a cantilever, eight cells thick and cut from above 10 mm from its clamp, sags, and how
/// far the cut gapes [m].
struct CutCantilever {
  double sag, mouth;
  CutCantilever(Device device, double depth, double held = 0) {
    Scene scene = cantilever_block(kCell, held);
    scene.device = device;
    scene.gravity = Vec3(0, 0, -9.81 / 100);
    Simulation simulation(scene);
    BladePath path;
    path.edge = {Vec3(0.01, -0.1, 0), Vec3(0.01, 0.1, 0)};
    for (const double z : {0.03, 0.02 - depth})
      path.poses.push_back({Vec3(0, 0, z), Quat::Identity()});
    simulation.cut(path);
    EXPECT_TRUE(simulation.settle({3e-6, 6, 20}).at_rest) << depth;
    sag =
        -surface_displacement(simulation.tissue(), 0, Vec3(0.03, 0, 0.02), 2, 0.002 + 1.5 * kCell);
    mouth = beside_cut(simulation.tissue(), true, kCell) -
            beside_cut(simulation.tissue(), false, kCell);
  }
};

// Cut to a place between cells and in them.
TEST(FrontOfACantilever, SagAndMouth) {
  double before = 0, step = 0;
  for (const double depth : {0.00875, 0.009375, 0.01, 0.010625, 0.01125}) {
    const CutCantilever now(Device::kCpu, depth);
    if (before != 0) {  // no stairs
      EXPECT_GT(now.sag - before, 1.1 * step) << depth;
      EXPECT_LT(now.sag - before, step == 0 ? 1 : 1.6 * step) << depth;
      step = now.sag - before;
    }
    before = now.sag;
    const char* name = depth == 0.00875 ? "8_75mm" : depth == 0.01 ? "10mm" : "11_25mm";
    if (depth != 0.00875 && depth != 0.01 && depth != 0.01125) continue;
    const std::string of = name;
    EXPECT_TRUE(is_within("a cantilever 20 mm thick, cut 8.75 to 11.25 mm: sag",
                          now.sag / reference(kData, "cut_cantilever", "sag_" + of) - 1, 0.02))
        << depth;
    EXPECT_TRUE(is_within("how far its cut opens",
                          now.mouth / reference(kData, "cut_cantilever", "mouth_" + of) - 1, 0.04))
        << depth;
  }
}

#if defined(TISSUE_SIM_CUDA)
// A GPU follows the front, and holds tissue at its anchors' faces, as a CPU does.
TEST(FrontOfACantilever, MouthAndSagOnAGpu) {
  const std::string why = why_no_gpu();
  if (!why.empty()) GTEST_SKIP() << why;
  double mouth[2] = {}, sag[2] = {};  // on a GPU, on a CPU
  for (const double depth : {0.00875, 0.009375, 0.01}) {
    const CutCantilever gpu(Device::kCuda, depth, 2 * kCell), cpu(Device::kCpu, depth, 2 * kCell);
    std::printf("%g mm: sag %.4f, mouth %.4f mm; on a CPU %.4f, %.4f\n", 1e3 * depth, 1e3 * gpu.sag,
                1e3 * gpu.mouth, 1e3 * cpu.sag, 1e3 * cpu.mouth);
    EXPECT_NEAR(gpu.mouth / cpu.mouth, 1, 0.002) << depth;
    EXPECT_NEAR(gpu.sag / cpu.sag, 1, 0.002) << depth;
    if (mouth[0] != 0) {
      EXPECT_NEAR((gpu.mouth - mouth[0]) / (cpu.mouth - mouth[1]), 1, 0.03) << depth;
      EXPECT_NEAR((gpu.sag - sag[0]) / (cpu.sag - sag[1]), 1, 0.03) << depth;
    }
    mouth[0] = gpu.mouth, mouth[1] = cpu.mouth;
    sag[0] = gpu.sag, sag[1] = cpu.sag;
  }
}
#endif

}  // namespace
}  // namespace tissue_sim
