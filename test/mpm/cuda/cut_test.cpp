// Cuts on the GPU: its sweep and its labels against the CPU's, its tables against those made anew.
// Skipped where there is no GPU.
#include <gtest/gtest.h>

#if defined(TISSUE_SIM_CUDA)
#include "mpm/cuda/label_pieces.h"
#include "mpm/cut_tissue.h"
#include "mpm/lattice/bonds.h"
#include "mpm/mpm_tissue.h"
#include "support/cuda_mpm_tissue.h"
#include "support/cut_kinds.h"
#include "support/cut_scenes.h"
#include "support/either_device.h"
#include "support/fixed_substeps.h"

namespace tissue_sim {
namespace {

class CutOnGpu : public OnEitherDevice<CudaMpmTissue> {};

const Vec3 kSize(0.031, 0.029, 0.017);

/// Of a deformed body; with `shaken`, each node is somewhere else.
template <class T>
void prepare(T& tissue, double shaken) {
  deform(tissue.state());
  shake(tissue.state(), 7, shaken);
  push(tissue);
}

void expect_same_bonds(const MpmState& a, const MpmState& b) {
  for (std::int32_t p = 0; p < a.points.size(); ++p) {
    ASSERT_EQ(a.points.bonds[p], b.points.bonds[p]) << "point " << p;
    for (int axis = 0; axis < 3; ++axis) {
      const Crossing *x = a.points.crossings.find(p, axis), *y = b.points.crossings.find(p, axis);
      ASSERT_EQ(x == nullptr, y == nullptr) << "point " << p << ", axis " << axis;
      if (x == nullptr) continue;
      EXPECT_NEAR(x->place, y->place, 1e-3);
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(x->normal[c], y->normal[c], 1e-3);
    }
  }
}

TEST_F(CutOnGpu, SweepsOfAnyKindBreakTheBondsThatTheCpuBreaks) {
  const Scene scene = free_body(Law::kFixedCorotated, 0, Shape::kBox);
  for (const CutKind& kind : cut_kinds(kSize)) {
    SCOPED_TRACE(kind.name);
    MpmTissue cpu(scene);
    CudaMpmTissue gpu(scene);
    prepare(cpu, 2e-5);
    prepare(gpu, 2e-5);
    int broken = 0;
    for (const BladePath& path : kind.cuts) {
      const CutReport on_cpu = cut_now(cpu, path), on_gpu = cut_now(gpu, path);
      EXPECT_EQ(on_cpu.bonds_broken, on_gpu.bonds_broken);
      EXPECT_EQ(on_cpu.points_separated, on_gpu.points_separated);
      EXPECT_EQ(on_cpu.new_fragments, on_gpu.new_fragments);
      broken += on_gpu.bonds_broken;
    }
    EXPECT_GT(broken, 0);
    expect_same_bonds(cpu.state(), gpu.state());
    for (int p = 0; p < cpu.point_count(); ++p) ASSERT_EQ(cpu.fragment_of(p), gpu.fragment_of(p));
  }
}

TEST_F(CutOnGpu, TissueMovesOnAsBeforeWhereTheFirstCutDividesItAnew) {
  // Of 132 multiprocessors, this one takes more as long as it is whole than it leaves free for
  // blocks that cuts add.
  Scene scene = free_body(Law::kFixedCorotated, 0, Shape::kBox);
  scene.bodies[0].size = Vec3(0.040, 0.040, 0.018);
  const auto run = [&] {
    CudaMpmTissue tissue(scene);
    prepare(tissue, 2e-5);
    const std::string whole = tissue.plan();
    const float dt = 0.3f * tissue.stable_substep();
    advance_by(tissue, 40, dt, {});
    tissue.finish();
    const BladePath path = plane_cut(Vec3(0.02, 0.02, 0.009), Vec3(1, 0.4, 0.3));
    EXPECT_GT(cut_now(tissue, path).bonds_broken, 0);
    advance_by(tissue, 40, dt, {});
    tissue.finish();
    std::printf("%s\n then %s\n", whole.c_str(), tissue.plan().c_str());
    return positions(tissue);
  };
  const auto anew = run();
  setenv("TISSUE_SIM_CUDA_SHAPE", "6 5 4 96 0", 1);  // whole and cut
  const auto kept = run();
  unsetenv("TISSUE_SIM_CUDA_SHAPE");
  ASSERT_EQ(anew.size(), kept.size());
  double worst = 0;
  for (std::size_t p = 0; p < anew.size(); ++p) {
    worst = std::max(worst, (anew[p] - kept[p]).norm());
  }
  std::printf("at most %.1e m apart\n", worst);
  EXPECT_LT(worst, 1e-7);
}

TEST_F(CutOnGpu, TissueMovesOnAsBeforeWhereRegionsAreHalvedAndJoinedAgain) {
  cudaDeviceProp gpu;
  ASSERT_EQ(cudaGetDeviceProperties(&gpu, 0), cudaSuccess);
  if (gpu.multiProcessorCount < 100) GTEST_SKIP() << "too few multiprocessors to halve regions";
  Scene scene = free_body(Law::kFixedCorotated, 0, Shape::kBox);
  scene.cell_size = 0.001;
  scene.bodies[0].size = Vec3(0.040, 0.040, 0.018);
  std::vector<bool> halved;
  const auto run = [&](const char* shape) {
    setenv("TISSUE_SIM_CUDA_SHAPE", shape, 1);
    CudaMpmTissue tissue(scene);
    prepare(tissue, 2e-5);
    halved.clear();
    const float dt = 0.2f * tissue.stable_substep();
    for (int cut = 0; cut < 4; ++cut) {
      const Vec3 normal = cut % 2 == 0 ? Vec3(0.1, 1, 0.2) : Vec3(1, 0.1, 0.2);
      const double at = 0.005 + 0.01 * (cut / 2);
      EXPECT_GT(cut_now(tissue, plane_cut(Vec3(at, at, 0.009), normal)).bonds_broken, 0);
      // Faces pass: when lips meet hangs on what each shape of blocks rounds.
      tissue.state().faces.until_search = 1e9;
      advance_by(tissue, 10, dt, {});
      tissue.finish();
      halved.push_back(tissue.state().blocks.has_halves());
    }
    std::printf("%s\n", tissue.plan().c_str());
    unsetenv("TISSUE_SIM_CUDA_SHAPE");
    return positions(tissue);
  };
  const auto whole = run("6 5 4 96 0");  // more blocks than there are multiprocessors
  EXPECT_EQ(std::count(halved.begin(), halved.end(), true), 0);
  const auto halves = run("10 10 6 128 1");
  EXPECT_TRUE(halved.front());
  EXPECT_FALSE(halved.back());
  ASSERT_EQ(whole.size(), halves.size());
  double worst = 0;
  Vec3 mean = Vec3::Zero(), at = Vec3::Zero();
  for (std::size_t p = 0; p < whole.size(); ++p) {
    const Vec3 off = whole[p] - halves[p];
    mean += off / static_cast<double>(whole.size());
    if (off.norm() <= worst) continue;
    worst = off.norm();
    at = whole[p];
  }
  std::printf("at most %.1e m apart, at %.4f %.4f %.4f; in the mean %.1e\n", worst, at.x(), at.y(),
              at.z(), mean.norm());
  EXPECT_LT(worst, 1e-6);
}

TEST_F(CutOnGpu, TablesThatFollowAreThoseThatAreMadeAnew) {
  const Scene scene = free_body(Law::kFixedCorotated, 0, Shape::kEllipsoid);
  CudaMpmTissue follows(scene), anew(scene);
  for (CudaMpmTissue* tissue : {&follows, &anew}) {
    prepare(*tissue, 2e-5);
    for (int cut = 0; cut < 4; ++cut) {
      const Vec3 normal(1, 0.4 - 0.2 * cut, 0.3 * cut);
      cut_now(*tissue, plane_cut(Vec3(0.006 + 0.006 * cut, 0.0145, 0.0085), normal));
      tissue->state().faces.until_search = 1e9;  // faces pass: what they hold is not pushed
      advance_by(*tissue, 10, 1e-5f, {});
      tissue->finish();
    }
  }
  anew.pull();
  anew.push();
  for (CudaMpmTissue* tissue : {&follows, &anew}) {
    tissue->state().faces.until_search = 1e9;
    advance_by(*tissue, 20, 1e-5f, {});
    tissue->finish();
  }
  EXPECT_EQ(follows.fragment_count(), anew.fragment_count());
  EXPECT_GT(follows.fragment_count(), 3);
  EXPECT_EQ(follows.plan(), anew.plan());
  EXPECT_EQ(follows.checksum(), anew.checksum());
}

TEST_F(CutOnGpu, LabelsAreThoseOfTheCpu) {
  Scene scene = free_box(Vec3(0.03, 0.024, 0.02), 0.002);
  scene.bodies.push_back(scene.bodies[0]);
  scene.bodies[1].shape = Shape::kEllipsoid;
  scene.bodies[1].radii = Vec3(0.012, 0.01, 0.015);
  scene.bodies[1].pose.position = Vec3(0.1, 0, 0);
  LatticeTissue tissue;
  Points& points = tissue.points;
  tissue.bodies = make_lattice_bodies(scene, points, nullptr);
  const std::vector<LatticeBody>& bodies = tissue.bodies;
  std::vector<std::int32_t> point_at;
  std::vector<int> first;
  for (const LatticeBody& b : bodies) {
    first.push_back(static_cast<int>(point_at.size()));
    for (int z = 0; z < 2 * b.nz; ++z) {
      for (int y = 0; y < 2 * b.ny; ++y) {
        for (int x = 0; x < 2 * b.nx; ++x) point_at.push_back(b.point(x, y, z));
      }
    }
  }
  first.push_back(static_cast<int>(point_at.size()));
  DeviceArray<std::int32_t> sites;
  sites.upload(point_at, nullptr);
  std::vector<SiteRows> rows;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const LatticeBody& b = bodies[i];
    rows.push_back({sites.data() + first[i], first[i + 1] - first[i], 2 * b.nx, 4 * b.nx * b.ny});
  }
  Pieces on_cpu = whole_pieces(tissue), on_gpu = on_cpu;
  PieceLabels labels;
  std::vector<std::int32_t> lowest;
  for (const int id : on_gpu.of_point) lowest.push_back(on_gpu.lowest[id]);
  labels.upload(lowest, nullptr);
  DeviceArray<std::uint8_t> bonds;
  std::mt19937 random(5);
  for (int round = 0; on_cpu.all.size() < 3000; ++round) {
    for (int i = 0; i < 2000; ++i) {
      const auto p = static_cast<std::int32_t>(random() % points.size());
      const int axis = static_cast<int>(random() % 3);
      if ((points.bonds[p] >> (kForwardBond + axis) & 1) == 0) continue;
      const std::int32_t q = bodies[points.site[p].body].next_point(points.site[p], axis);
      break_bond(kForwardBond + axis, points.bonds[p], points.bonds[q]);
    }
    bonds.upload(points.bonds, nullptr);
    const std::vector<int> fresh = update_pieces(tissue, on_cpu);
    EXPECT_EQ(fresh, part_pieces(points.volume.data(), labels.update(rows, bonds.data(), nullptr),
                                 on_gpu));
    ASSERT_EQ(on_cpu.of_point, on_gpu.of_point) << "round " << round;
    EXPECT_EQ(on_cpu.lowest, on_gpu.lowest);
    for (std::size_t i = 0; i < on_cpu.all.size(); ++i) {
      const Fragment &a = on_cpu.all[i], &b = on_gpu.all[i];
      EXPECT_EQ(a.id, b.id);
      EXPECT_EQ(a.parent, b.parent);
      EXPECT_EQ(a.point_count, b.point_count);
      EXPECT_NEAR(a.volume, b.volume, 1e-9 * scene.bodies[0].size.prod());
    }
  }
}

}  // namespace
}  // namespace tissue_sim
#else
TEST(CutOnGpu, NeedsABuildWithNvcc) { GTEST_SKIP() << "built without nvcc"; }
#endif
