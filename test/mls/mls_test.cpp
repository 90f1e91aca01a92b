// The meshless method's own: gradients, forces, balance, what cuts leave.
#include <gtest/gtest.h>

#include <Eigen/Sparse>
#include <Eigen/SparseCholesky>
#include <cmath>

#include "mls/cut.h"
#include "mls/linearised_motion.h"
#include "mls/substep_choice.h"
#include "mls_scenes.h"

namespace tissue_sim {
namespace {

constexpr MlsPlacement kPlacements[] = {MlsPlacement::kRegular, MlsPlacement::kGraded};

Eigen::Matrix3d some_matrix(unsigned seed, double size) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> even(-size, size);
  Eigen::Matrix3d A;
  for (int k = 0; k < 9; ++k) A(k / 3, k % 3) = even(random);
  return A;
}

TEST(MlsNodes, SharesAddUpToTheBody) {
  for (const MlsPlacement placement : kPlacements) {
    for (const Shape shape : {Shape::kBox, Shape::kBall, Shape::kEllipsoid, Shape::kCylinder}) {
      Scene scene = mls_box(Vec3(0.02, 0.016, 0.012), 0.001, placement);
      Body& body = scene.bodies[0];
      body.shape = shape;
      body.radius = 0.008;
      body.height = 0.015;
      body.radii = Vec3(0.01, 0.008, 0.006);
      const MlsNodes nodes = make_mls_nodes(scene, nullptr);
      double sum = 0;
      for (const float v : nodes.volume) sum += v;
      const double exact[] = {0.02 * 0.016 * 0.012, 4 / 3.0 * M_PI * std::pow(0.008, 3),
                              4 / 3.0 * M_PI * 0.01 * 0.008 * 0.006, M_PI * 0.008 * 0.008 * 0.015};
      EXPECT_NEAR(sum / exact[static_cast<int>(shape)], 1, 1e-6);
    }
  }
}

TEST(MlsNodes, GradedOnesAreSparseInside) {
  Scene scene = mls_box(Vec3::Constant(0.02), 0.001, MlsPlacement::kGraded);
  scene.mls.grading = 2;
  const MlsNodes nodes = make_mls_nodes(scene, nullptr);
  double inner = 0, outer = 0;
  int inner_count = 0, outer_count = 0;
  for (int i = 0; i < nodes.count(); ++i) {
    const double depth = std::min(nodes.place[i].minCoeff(), 0.02 - nodes.place[i].maxCoeff());
    if (depth > 0.006) inner += nodes.volume[i], ++inner_count;
    if (depth < 0.001) outer += nodes.volume[i], ++outer_count;
  }
  const double ratio = std::cbrt(inner / inner_count / (outer / outer_count));
  EXPECT_GT(ratio, 1.5);
  EXPECT_LT(nodes.count(), 8000 * 0.7);
}

TEST(MlsPairs, AreSymmetricAndSorted) {
  for (const MlsPlacement placement : kPlacements) {
    const auto state = make_mls_state(mls_box(Vec3(0.012, 0.01, 0.008), 0.001, placement), nullptr);
    const MlsPairs& p = state->pairs;
    for (int i = 0; i < state->count(); ++i) {
      for (int e = p.begin[i]; e < p.begin[i + 1]; ++e) {
        ASSERT_EQ(p.other[p.twin[e]], i);
        ASSERT_EQ(p.twin[p.twin[e]], e);
        ASSERT_EQ(p.weight[e], p.weight[p.twin[e]]);
        ASSERT_GT(p.weight[e], 0);
        if (e > p.begin[i]) {
          ASSERT_LT(p.other[e - 1], p.other[e]);
        }
      }
    }
  }
}

TEST(MlsPairs, InALatticeHaveAsManyNeighboursAsAskedFor) {
  for (const int k : {18, 26, 32}) {
    Scene scene = mls_box(Vec3::Constant(0.011), 0.001);
    scene.mls.neighbours = k;
    const auto state = make_mls_state(scene, nullptr);
    int middle = 0;
    for (int i = 1; i < state->count(); ++i) {
      const Vec3 m = Vec3::Constant(0.0055);
      if ((state->nodes.place[i] - m).norm() < (state->nodes.place[middle] - m).norm()) middle = i;
    }
    EXPECT_EQ(state->pairs.begin[middle + 1] - state->pairs.begin[middle], k);
  }
}

TEST(Mls, ReproducesLinearFields) {
  const Eigen::Matrix3d A = some_matrix(1, 0.3);
  for (const MlsPlacement placement : kPlacements) {
    const auto state = make_mls_state(mls_box(Vec3(0.012, 0.01, 0.008), 0.001, placement), nullptr);
    impose(*state, A);
    state->kernels->stresses(field_of(*state), 0);
    for (const Eigen::Matrix3d& H : reference::mls_gradients(*state)) {
      ASSERT_LT((H - A).cwiseAbs().maxCoeff(), 1e-5 * A.norm());
    }
  }
}

// Largest difference of the forces from the reference, over the largest force.
double difference(MlsState& s) {
  Array<float> force(s.u.size());
  internal_forces(s, s.u.data(), force.data());
  const std::vector<Vec3> expected = reference::mls_forces(s);
  double most = 0, off = 0;
  for (int i = 0; i < s.count(); ++i) {
    const Vec3 f(force[4 * i], force[4 * i + 1], force[4 * i + 2]);
    most = std::max(most, expected[i].norm());
    off = std::max(off, (f - expected[i]).norm());
  }
  return off / most;
}

void shake(MlsState& s, double size) {
  std::mt19937 random(3);
  std::normal_distribution<float> normal;
  for (int i = 0; i < s.count(); ++i) {
    for (int a = 0; a < 3; ++a) s.u[4 * i + a] += static_cast<float>(size) * normal(random);
  }
}

TEST(Mls, ForcesAreThoseOfTheReference) {
  for (const MlsPlacement placement : kPlacements) {
    for (const Law law : {Law::kFixedCorotated, Law::kNeoHookean}) {
      Scene scene = mls_box(Vec3(0.012, 0.01, 0.008), 0.001, placement);
      scene.materials.resize(1);
      scene.materials[0].name = scene.bodies[0].material = "m";
      scene.materials[0].law = law;
      MlsTissue tissue(scene);
      MlsState& s = tissue.state();
      impose(s, some_matrix(2, 0.2));
      shake(s, 1e-4);
      EXPECT_LT(difference(s), 1e-5);
      tissue.cut_now(plane_cut(Vec3(0.0061, 0.0049, 0.0041), Vec3(1, 0.4, 0.2)));
      EXPECT_LT(difference(s), 1e-5);
    }
  }
}

// However large it is: what the faces ask for does not run on into the body.
TEST(Mls, BalancedWeightsOfALatticeStayNearTheKernels) {
  for (const int edge : {6, 12, 26}) {
    const auto state = make_mls_state(mls_box(Vec3::Constant(0.001 * edge), 0.001), nullptr);
    const MlsState& s = *state;
    ASSERT_EQ(s.count(), edge * edge * edge);
    const MlsPairs kernel = make_pairs(s.nodes, s.scene.mls.neighbours, *s.cpu);
    float least = 1, most = 1;
    for (std::size_t e = 0; e < kernel.whole.size(); ++e) {
      const float change = s.pairs.whole[e] / kernel.whole[e];
      least = std::min(least, change);
      most = std::max(most, change);
    }
    EXPECT_GT(least, 1 / 1.5);
    EXPECT_LT(most, 1.5);
    for (int i = 0; i < s.count(); ++i) {
      ASSERT_EQ(s.sprung[i], 0);
      ASSERT_EQ(s.nodes.strained_volume[i], s.nodes.free_volume[i]);
    }
  }
}

TEST(Mls, ForcesAreTheSlopeOfTheEnergy) {
  MlsTissue tissue(mls_box(Vec3(0.006, 0.005, 0.004), 0.001, MlsPlacement::kGraded));
  MlsState& s = tissue.state();
  impose(s, some_matrix(2, 0.2));
  shake(s, 1e-4);
  tissue.cut_now(upright_blade({Vec3(0.0031, -0.1, 0), Vec3(0.0031, 0.0026, 0)}));
  Array<float> force(s.u.size());
  internal_forces(s, s.u.data(), force.data());
  std::vector<double> u(s.u.begin(), s.u.end());
  double most = 0;
  for (const float f : force) most = std::max<double>(most, std::fabs(f));
  for (int k = 0; k < 4 * s.count(); k += 7) {
    if (k % 4 == 3) continue;
    const double step = 1e-8, here = u[k];
    u[k] = here + step;
    const double above = reference::mls_energy(s, u);
    u[k] = here - step;
    const double below = reference::mls_energy(s, u);
    u[k] = here;
    EXPECT_NEAR(-(above - below) / (2 * step) / most, force[k] / most, 1e-4);
  }
}

TEST(Mls, RotationsAreNoStrain) {
  const Eigen::Matrix3d R =
      Eigen::AngleAxisd(M_PI / 2, Vec3(1, 2, -0.5).normalized()).toRotationMatrix();
  for (const MlsPlacement placement : kPlacements) {
    const auto state = make_mls_state(mls_box(Vec3(0.012, 0.01, 0.008), 0.001, placement), nullptr);
    MlsState& s = *state;
    impose(s, R - Eigen::Matrix3d::Identity());
    Array<float> force(s.u.size());
    internal_forces(s, s.u.data(), force.data());
    const Material& m = s.nodes.material_of(0);
    const double modulus = lame_lambda(m) + 2 * lame_mu(m);
    for (int k = 0; k < 4 * s.count(); ++k) {  // against what a face of a node's cube bears
      ASSERT_LT(std::fabs(force[k]), 2e-5 * modulus * 1e-6);
    }
  }
}

// Nodes of the outer layers follow a linear field, the others find their own rest.
TEST(Mls, PassesThePatchTestThatIsSolved) {
  const double bounds[] = {1e-3, 0.02};
  for (int p = 0; p < 2; ++p) {
    Scene scene = mls_box(Vec3::Constant(0.009), 0.001, kPlacements[p]);
    const auto state = make_mls_state(scene, nullptr);
    MlsState& s = *state;
    const int n = s.count();
    // Nodes of the outer layers follow a linear field, all others relax: dynamic, critically slow.
    const Eigen::Matrix3d A = some_matrix(5, 1e-2);
    impose(s, A);
    const Array<float> wanted = s.u;
    std::vector<char> is_free(n);
    for (int i = 0; i < n; ++i) {
      const Vec3& x = s.nodes.place[i];
      is_free[i] = x.minCoeff() > 0.002 && x.maxCoeff() < 0.007;
      for (int a = 0; a < 3 && is_free[i]; ++a) s.u[4 * i + a] = 0;
    }
    const double dt =
        0.5 * measured_limit(
                  s, [&s](const float* u, float* f) { internal_forces(s, u, f); }, 20);
    Array<float> force(s.u.size());
    std::vector<double> v(4 * n, 0.0), u(s.u.begin(), s.u.end());
    for (int step = 0; step < 1500; ++step) {
      internal_forces(s, s.u.data(), force.data());
      for (int k = 0; k < 4 * n; ++k) {
        if (!is_free[k / 4]) continue;
        v[k] = (1 - 0.03) * v[k] + dt * force[k] * s.inv_mass[k / 4];
        u[k] += dt * v[k];
        s.u[k] = static_cast<float>(u[k]);
      }
    }
    const auto H = reference::mls_gradients(s);
    double off = 0;
    for (int i = 0; i < n; ++i) {
      const Eigen::Matrix3d d = H[i] - A;
      off = std::max(off, (d + d.transpose()).cwiseAbs().maxCoeff() / 2);
    }
    const double strain = (A + A.transpose()).cwiseAbs().maxCoeff() / 2;
    EXPECT_LT(off / strain, bounds[p]) << "placement " << p;
    RecordProperty("strain_error_" + std::to_string(p), std::to_string(off / strain));
    std::printf("placement %d: strain off by %.2g\n", p, off / strain);
  }
}

// What cuts leave: a sheet one node thick, a chain, a pair, a lone node.
TEST(MlsCut, RemnantsBearRotationsWithoutForce) {
  MlsTissue tissue(mls_box(Vec3(0.006, 0.006, 0.006), 0.001));
  MlsState& s = tissue.state();
  const Vec3 eps(1e-5, 2e-5, 3e-5);
  tissue.cut_now(plane_cut(Vec3(0, 0, 0.001) + eps, Vec3::UnitZ()));  // a sheet below
  tissue.cut_now(plane_cut(Vec3(0, 0, 0.002) + eps, Vec3::UnitZ()));  // another one, ...
  tissue.cut_now(plane_cut(Vec3(0.001, 0, 0) + eps, Vec3::UnitX()));  // of which chains,
  tissue.cut_now(plane_cut(Vec3(0, 0.002, 0) + eps, Vec3::UnitY()));  // pairs,
  tissue.cut_now(plane_cut(Vec3(0, 0.003, 0) + eps, Vec3::UnitY()));  // and lone nodes
  EXPECT_GT(std::count(s.sprung.begin(), s.sprung.begin() + s.count(), 1), 40);
  const Eigen::Matrix3d R =
      Eigen::AngleAxisd(M_PI / 2, Vec3(1, 2, -0.5).normalized()).toRotationMatrix();
  impose(s, R - Eigen::Matrix3d::Identity());
  Array<float> force(s.u.size());
  internal_forces(s, s.u.data(), force.data());
  for (int k = 0; k < 4 * s.count(); ++k) {
    ASSERT_LT(std::fabs(force[k]), 1e-4 * lame_mu(s.nodes.material_of(0)) * 1e-6) << k;
  }
}

TEST(MlsCut, NoForceCrossesAFinishedCut) {
  for (const MlsPlacement placement : kPlacements) {
    MlsTissue tissue(mls_box(Vec3(0.012, 0.01, 0.008), 0.001, placement));
    MlsState& s = tissue.state();
    const Vec3 place(0.0061, 0.0049, 0.0041), normal(1, 0.4, 0.2);
    const CutReport report = tissue.cut_now(plane_cut(place, normal));
    EXPECT_EQ(report.new_fragments.size(), 1u);
    for (int i = 0; i < s.count(); ++i) {
      if ((s.nodes.place[i] - place).dot(normal) < 0) continue;
      s.u[4 * i] += 0.003f;
      s.u[4 * i + 1] += 0.002f;
    }
    Array<float> force(s.u.size());
    internal_forces(s, s.u.data(), force.data());
    for (const float f : force) ASSERT_LT(std::fabs(f), 3e-5 * 2000 * 1e-6);
    for (int i = 0; i < s.count(); ++i) {
      for (int e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
        const bool apart = ((s.nodes.place[i] - place).dot(normal) < 0) !=
                           ((s.nodes.place[s.pairs.other[e]] - place).dot(normal) < 0);
        ASSERT_EQ(s.pairs.weight[e] == 0, apart);
      }
    }
  }
}

TEST(MlsCut, SlowEqualsFastAndItsRimMovesOn) {
  const auto half = [](double from, double to) {
    return upright_blade({Vec3(0.00613, from, 0), Vec3(0.00613, to, 0)});
  };
  MlsTissue fast(mls_box(Vec3(0.012, 0.01, 0.008), 0.001)), slow(fast.state().scene);
  fast.cut_now(half(-0.1, 0.0061));
  const int steps = 37;
  for (int k = 0; k < steps; ++k) {
    const double a = -0.001 + 0.0071 * k / steps, b = -0.001 + 0.0071 * (k + 1) / steps;
    const Array<float> before = slow.state().pairs.weight;
    slow.cut_now(half(a, b));
    for (std::size_t e = 0; e < before.size(); ++e) {
      ASSERT_LE(slow.state().pairs.weight[e], before[e]);
    }
  }
  const Array<float>&f = fast.state().pairs.weight, &g = slow.state().pairs.weight;
  const Array<float>& whole = fast.state().pairs.whole;
  int gone = 0, fading = 0;
  for (std::size_t e = 0; e < f.size(); ++e) {
    ASSERT_EQ(f[e], g[e]);
    gone += f[e] == 0;
    fading += f[e] > 0 && f[e] < whole[e];
  }
  EXPECT_GT(gone, 200);
  EXPECT_GT(fading, 10);
  EXPECT_LT(fading, gone / 2);
  EXPECT_EQ(fast.fragment_count(), 1);
}

TEST(MlsSubstep, LanczosFindsTheHighestFrequency) {
  MlsTissue tissue(mls_box(Vec3(0.012, 0.01, 0.008), 0.001));
  MlsState& s = tissue.state();
  const MlsForces forces = [&s](const float* u, float* force) { internal_forces(s, u, force); };
  const double eight = measured_limit(s, forces, 8), many = measured_limit(s, forces, 80);
  EXPECT_NEAR(eight / many, 1, 0.1);
}

// Between two measurements cuts go on, and the substep stays as it is. What is taken stays below
// the limit of what is left, unless the cut asked for a new measurement (MlsSubsteps).
TEST(MlsSubstep, StaysStableThroughCutsUntilItIsMeasuredAnew) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> even(-1, 1);
  double closest = 1e30;
  int kept = 0;
  for (const MlsPlacement placement : kPlacements) {
    for (int body = 0; body < 4; ++body) {
      Scene scene = mls_box(Vec3(0.012, 0.01, 0.008), 0.001, placement);
      scene.materials.resize(1);
      scene.materials[0].name = scene.bodies[0].material = "elastic";
      scene.materials[0].poisson_ratio = body % 2 == 0 ? 0.3 : 0.49;
      MlsTissue tissue(scene);
      MlsState& s = tissue.state();
      const MlsForces forces = [&s](const float* u, float* force) { internal_forces(s, u, force); };
      bool measured = false;
      const MeasureLimit measure = [&](const std::vector<std::uint8_t>&, int steps) {
        measured = true;
        return measured_limit(s, forces, steps);
      };
      MlsSubsteps substeps(s);
      substeps.part(s, 1, measure);
      for (int k = 0; k < 12; ++k) {
        const Vec3 normal(even(random), even(random), even(random));
        BladePath path = plane_cut(Vec3(0.006, 0.005, 0.004) + 0.004 * normal, normal);
        path.poses.back().position =
            path.poses.front().position +
            (0.6 + 0.1 * even(random)) * (path.poses.back().position - path.poses.front().position);
        std::vector<std::int32_t> changed;
        CutReport report;
        cross_pairs(s, path, s.u.data(), s.u.data(), changed, report);
        substeps.cut(s, changed);
        measured = false;
        const double taken = substeps.part(s, 1, measure).longest();
        if (measured) continue;
        const double limit = measured_limit(s, forces, 60);
        closest = std::min(closest, limit / taken);
        ++kept;
        EXPECT_LT(taken, 0.97 * limit) << static_cast<int>(placement) << ' ' << body << ' ' << k;
      }
    }
  }
  EXPECT_GT(kept, 20);
  std::printf("%d cuts without a measurement: the limit stays %.3f of what is taken at least\n",
              kept, closest);
}

// Viscosity grows with the square of the stretch, not with what squeezed tissue stiffens by.
TEST(MlsSubstep, IsNotMuchShorterWhereViscousTissueIsSqueezed) {
  double substep[2];
  for (const bool viscous : {false, true}) {
    Scene scene = mls_box(Vec3::Constant(0.008), 0.001);
    Material m;
    m.name = scene.bodies[0].material = "soft";
    m.viscosity = viscous ? 0.5 : 0;
    scene.materials = {m};
    MlsTissue tissue(scene);
    impose(tissue.state(), Vec3(2, 2, -0.85).asDiagonal());
    for (int k = 0; k < 2; ++k) {
      tissue.advance(1e-5, {});
      substep[viscous] = tissue.finish().substep;
    }
  }
  EXPECT_GT(substep[1], 0.3 * substep[0]);
}

}  // namespace
}  // namespace tissue_sim
