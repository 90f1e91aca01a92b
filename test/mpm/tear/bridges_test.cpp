// Bridges: bonds that are in no square of four, which hold what hangs on by points one after the
// other.
#include <gtest/gtest.h>

#include "support/cut_paths.h"
#include "support/temporary_folder.h"
#include "support/test_meshes.h"
#include "support/test_scenes.h"

namespace tissue_sim {
namespace {

/// A ball with spikes and flakes that are thinner than the points' spacing.
TriangleMesh spiky_ball() {
  const Vec3 centre(0, 0, 0.02);
  TriangleMesh mesh = icosphere(centre, 0.015, 4);
  const auto pull = [&](int vertex, double share) {
    Vec3& v = mesh.vertices[vertex];
    v = centre + share * (v - centre);
  };
  for (int i = 0; i < 640; i += 9) pull(i, 1.45);
  for (std::size_t i = 0; i < mesh.triangles.size(); i += 97) {
    for (const int vertex : mesh.triangles[i]) pull(vertex, 1.3);
  }
  return mesh;
}

TEST(Bridges, ThatAreThereAtRestDoNotBreakByThemselves) {
  const TemporaryFolder folder;
  Scene scene;
  scene.threads = 1;
  scene.cell_size = 0.003;
  scene.bodies.resize(1);
  scene.bodies[0].shape = Shape::kMesh;
  scene.bodies[0].mesh = folder.write("spiky.obj", obj_text(spiky_ball()));
  scene.bodies[0].pose.position.z() = 0.015;
  Simulation simulation(scene);
  const int pieces = simulation.tissue().fragment_count();
  for (int frame = 0; frame < 15; ++frame) {
    const FrameReport report = simulation.advance_frame();
    ASSERT_FALSE(report.result.blew_up) << "frame " << frame;
    ASSERT_EQ(report.result.tear_report.bonds_broken, 0) << "frame " << frame;
  }
  EXPECT_EQ(simulation.tissue().fragment_count(), pieces);
}

}  // namespace
}  // namespace tissue_sim
