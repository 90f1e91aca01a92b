// The substep that is reported is stable, and by how much: against the largest eigenvalue of the
// linearised step, found by power iteration through the production kernels.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "math/bspline.h"
#include "mpm/blocks/stabilisation.h"
#include "mpm/mpm_tissue.h"
#include "support/curve_file.h"
#include "support/fixed_substeps.h"
#include "support/measured.h"
#include "support/stability_limit.h"

namespace tissue_sim {
namespace {

/// The same as a CFL number: substep * wave speed / cell size.
double cfl_limit(MpmTissue& tissue) {
  const double speed = wave_speed(tissue.state().bodies[0].materials[0]);
  return stability_limit(tissue) * speed / tissue.state().scene.cell_size;
}

/// What a point bears that is cut off on all sides, as a CFL number: from the 81 x 81 matrices of
/// its 27 nodes. No body is less stable: its frequencies are never above that of the stiffest of
/// its parts alone (Irons and Treharne 1971), and both masses and stiffness are sums over points.
double lone_point_limit(double nu) {
  const double mu = 0.5 * (1 - 2 * nu) / (1 - nu), lambda = nu / (1 - nu);  // lambda + 2 mu = 1
  const double lines[3][3] = {{kAverageSide, kAverageCenter, kAverageSide}, {-1, 0, 1}, {1, -2, 1}};
  Eigen::MatrixXd slope(27, 3), linear_free = Eigen::MatrixXd::Zero(27, 27);
  Eigen::VectorXd weight(27);
  for (int k = 0; k < 27; ++k) {
    const int d[3] = {k % 3, k / 3 % 3, k / 9};
    weight[k] = lattice_weight(0, d[0]) * lattice_weight(0, d[1]) * lattice_weight(0, d[2]);
    for (int a = 0; a < 3; ++a) {
      slope(k, a) = weight[k] / lattice_weight(0, d[a]) * lattice_slope(0, d[a]);
    }
  }
  for (int kind = 0; kind < 27; ++kind) {
    Eigen::VectorXd line(27);
    for (int k = 0; k < 27; ++k) {
      line[k] = lines[kind % 3][k % 3] * lines[kind / 3 % 3][k / 3 % 3] * lines[kind / 9][k / 9];
    }
    const int xy = 3 * (kind % 3) + kind / 3 % 3;  // XyQuantity: x kind first
    linear_free +=
        kStabilisation * mu * stabilisation::weight2(xy, kind / 9) * line * line.transpose();
  }
  Eigen::MatrixXd stiff(81, 81);
  for (int i = 0; i < 81; ++i) {
    for (int j = 0; j < 81; ++j) {
      const int c = i % 3, e = j % 3, k = i / 3, l = j / 3;
      stiff(i, j) = lambda * slope(k, c) * slope(l, e) + mu * slope(k, e) * slope(l, c);
      if (c == e) stiff(i, j) += mu * slope.row(k).dot(slope.row(l)) + linear_free(k, l);
      stiff(i, j) /= std::sqrt(weight[k] * weight[l]);
    }
  }
  Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(81, 1, 2);
  double square = 0;
  for (int k = 0; k < 500; ++k) {
    const Eigen::VectorXd y = stiff * x;
    square = y.norm() / x.norm();
    x = y / y.norm();
  }
  return 2 / std::sqrt(square);
}

void deform(MpmTissue& tissue, const Eigen::Matrix3d& f) {
  MpmState& state = tissue.state();
  const LatticeBody& b = state.bodies[0];
  for (int z = -1; z <= b.nz; ++z) {
    for (int y = -1; y <= b.ny; ++y) {
      for (int x = -1; x <= b.nx; ++x) {
        const Vec3 place = b.node_position(x, y, z), u = f * place - place;
        const auto set = [&](int node) {
          for (int c = 0; c < 3; ++c) state.nodes.u[c][node] = static_cast<float>(u[c]);
        };
        const int lattice_node = b.node(x, y, z);
        const NodeFields::Split* split = state.fields->split(lattice_node);
        if (split == nullptr) {
          set(lattice_node);
        } else {
          for (const auto& field : split->fields) set(field.node);
        }
      }
    }
  }
  tissue.finish();
}

/// Gives debris the stiffness of tissue.
void stiffen_debris(MpmState& state) {
  for (Block* b : state.blocks.all) {
    for (std::size_t lane = 0; lane < b->lane_count(); ++lane) {
      if (b->point[lane] >= 0) b->volume[lane] = state.points.volume[b->point[lane]];
    }
    const double mu = lame_mu(state.bodies[b->body].materials[0]);
    for (Block::PartialCell& cell : b->partial) {
      double volume = 0;
      const std::size_t first = cell.lane / b->stride * 8 * b->stride + cell.lane % b->stride;
      for (int s = 0; s < 8; ++s) volume += b->volume[first + s * b->stride];
      cell.mu = static_cast<float>(mu * volume);
    }
  }
}

TEST(StableSubstep, ALonePointIsTheLeastStable) {
  CurveFile file("cfl_limit", "poisson ratio,block,plate,rod,shattered,lone point");
  for (double nu : {0.0, 0.3, 0.45, 0.49}) {
    MpmTissue block(soft_body(nu, Vec3(8, 8, 8))), plate(soft_body(nu, Vec3(8, 8, 1))),
        rod(soft_body(nu, Vec3(8, 1, 1))), pieces(soft_body(nu, Vec3(6, 6, 6)));
    const std::vector<BladePath> planes = random_planes(30, 0.012);
    advance_by(pieces, 0, 0, {{}, planes});
    EXPECT_GT(pieces.finish().cut_reports[0].bonds_broken, 0);
    EXPECT_GT(pieces.fragments().size(), 100u);
    const double lone = lone_point_limit(nu), shattered = cfl_limit(pieces);
    stiffen_debris(pieces.state());
    EXPECT_NEAR(cfl_limit(pieces) / lone, 1, 2e-3) << nu;
    const double whole[3] = {cfl_limit(block), cfl_limit(plate), cfl_limit(rod)};
    file.add({nu, whole[0], whole[1], whole[2], shattered, lone});
    // As they are, pieces of a few points more are the least stable.
    EXPECT_GT(shattered, lone) << nu;
    EXPECT_LT(shattered, 1.25 * lone) << nu;
    for (const double limit : whole) EXPECT_GT(limit, lone) << nu;
  }
}

TEST(StableSubstep, TheDefaultHoldsHoweverTheTissueIsCut) {
  EXPECT_GT(lone_point_limit(0.49), 1.1 * Scene().cfl);
}

// Worst cases of what a deformation does to the reported substep, whole and shattered.
TEST(StableSubstep, FollowsDeformation) {
  CurveFile file("substep_margin", "law,poisson ratio,shattered,deformation,stretch,margin");
  for (const double nu : {0.0, 0.3, 0.49}) {
    for (const bool shattered : {false, true}) {
      for (Law law : {Law::kFixedCorotated, Law::kNeoHookean}) {
        for (const double stretch : {0.6, 1.5, 2.0}) {
          Eigen::Matrix3d axial = Eigen::Matrix3d::Identity(), shear = axial;
          axial(0, 0) = stretch;
          Eigen::Matrix3d isochoric = axial;
          isochoric(1, 1) = isochoric(2, 2) = 1 / std::sqrt(stretch);
          shear(0, 1) = stretch;
          const Eigen::Matrix3d swollen = std::max(1.0, stretch) * Eigen::Matrix3d::Identity();
          int number = 0;
          for (const Eigen::Matrix3d& f : {axial, isochoric, shear, swollen}) {
            MpmTissue tissue(soft_body(nu, Vec3(4, 4, 4), law));
            const std::vector<BladePath> planes = random_planes(shattered ? 20 : 0, 0.008);
            advance_by(tissue, 0, 0, {{}, planes});
            deform(tissue, f);
            const double margin = stability_limit(tissue) / tissue.stable_substep();
            EXPECT_TRUE(is_at_least(shattered ? "limit over the cautious substep, shattered"
                                              : "limit over the cautious substep, whole",
                                    margin, shattered ? 1.0 : 1.5))
                << f << "\n"
                << nu;
            file.add({law == Law::kNeoHookean ? 1.0 : 0.0, nu, shattered ? 1.0 : 0.0,
                      static_cast<double>(number++), stretch, margin});
          }
        }
      }
    }
  }
}

// Squeezed flat it stiffens sixteenfold at twice its length: that squared would be 64 times too
// little. Any motion that a too long substep feeds grows a thousandfold and more in these.
TEST(StableSubstep, OfViscousTissueGoesByItsStretch) {
  Scene scene = soft_body(0.45, Vec3(6, 6, 6));
  scene.materials[0].young_modulus = 100;
  scene.materials[0].viscosity = 5;
  MpmTissue tissue(scene);
  const float at_rest = tissue.stable_substep();
  const Eigen::Vector3d stretches(2, 2, 0.25);
  deform(tissue, stretches.asDiagonal());
  const float dt = tissue.stable_substep();
  EXPECT_GT(dt, at_rest / 10);
  MpmState& state = tissue.state();
  std::mt19937 random(3);
  std::uniform_real_distribution<float> speed(-1e-3f, 1e-3f);
  for (auto& v : state.nodes.v) {
    for (float& x : v) x = speed(random);
  }
  for (int i = 0; i < 3; ++i) {
    advance_by(tissue, 10, dt, {});
    EXPECT_LT(tissue.finish().max_speed, 1) << i;
  }
}

// Speeds of a thousandth of a cell per substep at random: they stay below the limit and grow above.
TEST(StableSubstep, TheLimitIsWhereItBlowsUp) {
  for (bool cut : {false, true}) {
    for (const double share : {0.98, 1.02}) {
      MpmTissue tissue(soft_body(0.45, Vec3(6, 6, 6)));
      const std::vector<BladePath> planes = random_planes(cut ? 30 : 0, 0.012);
      advance_by(tissue, 0, 0, {{}, planes});
      const auto dt = static_cast<float>(share * stability_limit(tissue));
      Nodes& n = tissue.state().nodes;
      std::mt19937 random(2);
      std::normal_distribution<float> normal(0, 1e-6f / dt);
      for (std::size_t i = 0; i < n.size(); ++i) {
        for (auto& v : n.v) v[i] = n.inv_mass[i] > 0 ? normal(random) : 0;
      }
      const double before = tissue.finish().kinetic_energy;
      advance_by(tissue, 400, dt, {});
      const FrameResult after = tissue.finish();
      if (share < 1) {
        EXPECT_LT(after.kinetic_energy, 20 * before);
      } else {
        EXPECT_TRUE(after.blew_up || after.kinetic_energy > 1e3 * before);
      }
    }
  }
}

}  // namespace
}  // namespace tissue_sim
