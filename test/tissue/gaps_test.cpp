// Parts of a mesh with a gap between them are pieces of their own, however narrow it is.
#include <gtest/gtest.h>

#include <algorithm>

#include "support/measured.h"
#include "support/temporary_folder.h"
#include "support/test_meshes.h"
#include "tissue/each_method.h"

namespace tissue_sim {
namespace {

constexpr double kCell = 0.003;

/// A mesh in free fall, held nowhere.
Scene scene_of(const std::string& mesh) {
  Scene scene;
  scene.cell_size = kCell;
  scene.ground.enabled = false;
  scene.gravity = Vec3::Zero();
  scene.bodies.resize(1);
  scene.bodies[0].shape = Shape::kMesh;
  scene.bodies[0].mesh = mesh;
  Material soft;
  soft.name = "soft";
  scene.materials = {soft};
  scene.bodies[0].material = "soft";
  return scene;
}

TriangleMesh two_cubes(double gap) {
  return both(box_mesh(Vec3(0, 0, 0), Vec3(0.0204, 0.02, 0.02)),
              box_mesh(Vec3(0.0204 + gap, 0, 0), Vec3(0.04, 0.02, 0.02)));
}

/// Two legs along z, 10 mm wide, with a slit between them, on a foot 8 mm high.
TriangleMesh u_shape(double slit) {
  const double a = 0.0101, b = a + slit, c = 0.02 + slit, y = 0.012, foot = 0.008, top = 0.03;
  const double corners[8][2] = {{0, 0},    {c, 0},    {c, top}, {b, top},
                                {b, foot}, {a, foot}, {a, top}, {0, top}};
  TriangleMesh mesh;  // in the x-z plane, drawn along y
  for (int side = 0; side < 2; ++side) {
    for (const auto& p : corners) mesh.vertices.emplace_back(p[0], side == 0 ? y : 0, p[1]);
  }
  for (int i = 0; i < 8; ++i) {
    const int j = (i + 1) % 8;
    mesh.triangles.push_back({i, j, 8 + j});
    mesh.triangles.push_back({i, 8 + j, 8 + i});
  }
  const int faces[6][3] = {{0, 5, 7}, {5, 6, 7}, {0, 1, 5}, {1, 4, 5}, {1, 2, 4}, {2, 3, 4}};
  for (const auto& t : faces) {
    mesh.triangles.push_back({8 + t[0], 8 + t[1], 8 + t[2]});
    mesh.triangles.push_back({t[0], t[2], t[1]});
  }
  return signed_volume(mesh) > 0 ? mesh : inverted(mesh);
}

/// A straight cut across all of a box, at this height.
BladePath level_cut(double z) {
  BladePath path;
  path.edge = {Vec3(0, -0.02, 0), Vec3(0, 0.04, 0)};
  for (const double x : {-0.01, 0.05}) {
    Pose pose;
    pose.position = Vec3(x, 0, z);
    path.poses.push_back(pose);
  }
  return path;
}

class Gaps : public EachMethod {};

TEST_P(Gaps, PartsOfAMeshArePiecesHoweverNear) {
  const TemporaryFolder folder;
  for (const double gap : {0.002, 0.0001}) {
    Scene scene = on_this(scene_of(folder.write("two.stl", binary_stl(two_cubes(gap)))));
    for (const bool turned : {false, true}) {
      if (turned) {
        scene.bodies[0].pose.orientation = Quat(Eigen::AngleAxisd(0.4, Vec3(1, 2, 3).normalized()));
      }
      Simulation simulation(scene);
      Tissue& tissue = simulation.tissue();
      ASSERT_EQ(tissue.fragment_count(), 2) << gap << " m, turned " << turned;
      const double left = 0.0204 * 0.02 * 0.02, right = (0.04 - 0.0204 - gap) * 0.02 * 0.02;
      double volumes[2] = {tissue.fragments()[0].volume, tissue.fragments()[1].volume};
      if (volumes[0] < volumes[1]) std::swap(volumes[0], volumes[1]);
      // Cells beside a gap give what they have of its other side back.
      const double share = scene.method == Method::kMls && !turned ? 0.02 : 0.03;
      EXPECT_NEAR(volumes[0] / std::max(left, right), 1, share);
      EXPECT_NEAR(volumes[1] / std::min(left, right), 1, share);
    }
  }
}

TEST_P(Gaps, NothingPullsAcrossAGap) {
  const TemporaryFolder folder;
  Scene scene = on_this(scene_of(folder.write("two.stl", binary_stl(two_cubes(0.0005)))));
  scene.gravity = Vec3(5, 0, 0);  // away from the one that is held
  Region region;
  region.kind = Region::Kind::kBox;
  region.min = Vec3(-0.01, -0.01, -0.01);
  region.max = Vec3(0.0141, 0.03, 0.03);
  scene.bodies[0].anchors = {region};
  Simulation simulation(scene);
  std::vector<Point> before = points_of(simulation.tissue());
  for (int i = 0; i < 12; ++i) simulation.advance_frame();
  const double fell = 0.5 * 5 * simulation.time() * simulation.time();
  const std::vector<Point> after = points_of(simulation.tissue());
  double least = 1, most = 0;
  for (std::size_t p = 0; p < after.size(); ++p) {
    if (before[p].x < 0.0225) continue;
    least = std::min<double>(least, after[p].x - before[p].x);
    most = std::max<double>(most, after[p].x - before[p].x);
  }
  for (const double way : {least, most}) {
    EXPECT_TRUE(is_within("a part beyond a gap falls freely", way / fell - 1, 0.02));
  }
}

TEST_P(Gaps, ASlitPartsTheLegsAndACutBelowItSetsThemFree) {
  const TemporaryFolder folder;
  const Scene scene = on_this(scene_of(folder.write("u.stl", binary_stl(u_shape(0.0002)))));
  Simulation simulation(scene);
  EXPECT_EQ(simulation.tissue().fragment_count(), 1);
  simulation.cut(level_cut(0.0111));  // through both legs, above the foot
  simulation.advance_frame();
  EXPECT_EQ(simulation.tissue().fragment_count(), 3);
}

TEST_P(Gaps, BodiesThatOverlapAreSaid) {
  Scene scene = on_this(Scene());
  scene.cell_size = kCell;
  scene.bodies.resize(3);
  scene.bodies[0].name = "liver";
  scene.bodies[1].name = "tumour";
  scene.bodies[2].name = "beside";  // touches the first
  for (Body& b : scene.bodies) b.size = Vec3(0.02, 0.02, 0.02);
  scene.bodies[1].pose.position = Vec3(0.018, 0, 0.0185);
  scene.bodies[2].pose.position = Vec3(-0.02, 0, 0);
  Simulation simulation(scene);
  int said = 0;
  for (const std::string& note : simulation.tissue().notes()) {
    if (note.find("overlap") == std::string::npos) continue;
    ++said;
    EXPECT_NE(note.find("'liver' and 'tumour' overlap by 0.06 cm^3"), std::string::npos) << note;
  }
  EXPECT_EQ(said, 1);
}

FOR_EACH_METHOD(Gaps);

}  // namespace
}  // namespace tissue_sim
