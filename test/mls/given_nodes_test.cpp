// Nodes that are the vertices of a tetrahedral mesh, as in Aras, Shen, Audette 2014.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "geometry/tet_mesh.h"
#include "mls_scenes.h"
#include "support/temporary_folder.h"

namespace tissue_sim {
namespace {

const Vec3 kSize(0.02, 0.015, 0.012);

/// A box in the words of each format, in millimetres.
std::string tetgen_nodes(const TetMesh& mesh) {
  std::ostringstream out;
  out.precision(12);
  out << mesh.vertices.size() << " 3 0 0\n";
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    out << i << ' ' << 1e3 * mesh.vertices[i].transpose() << '\n';
  }
  return out.str();
}
std::string tetgen_elements(const TetMesh& mesh) {
  std::ostringstream out;
  out << mesh.tetrahedra.size() << " 4 0\n";
  for (std::size_t i = 0; i < mesh.tetrahedra.size(); ++i) {
    out << i;
    for (const int v : mesh.tetrahedra[i]) out << ' ' << v;
    out << '\n';
  }
  return out.str();
}
std::string medit(const TetMesh& mesh) {
  std::ostringstream out;
  out.precision(12);
  out << "MeshVersionFormatted 1\nDimension 3\nVertices\n" << mesh.vertices.size() << '\n';
  for (const Vec3& x : mesh.vertices) out << 1e3 * x.transpose() << " 0\n";
  out << "Tetrahedra\n" << mesh.tetrahedra.size() << '\n';
  for (const auto& t : mesh.tetrahedra) {
    for (const int v : t) out << v + 1 << ' ';
    out << "0\n";
  }
  out << "End\n";
  return out.str();
}
std::string vtk(const TetMesh& mesh) {
  std::ostringstream out;
  out.precision(12);
  out << "# vtk DataFile Version 3.0\nbox\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS "
      << mesh.vertices.size() << " double\n";
  for (const Vec3& x : mesh.vertices) out << 1e3 * x.transpose() << '\n';
  out << "CELLS " << mesh.tetrahedra.size() << ' ' << 5 * mesh.tetrahedra.size() << '\n';
  for (const auto& t : mesh.tetrahedra) {
    out << 4;
    for (const int v : t) out << ' ' << v;
    out << '\n';
  }
  out << "CELL_TYPES " << mesh.tetrahedra.size() << '\n';
  for (std::size_t i = 0; i < mesh.tetrahedra.size(); ++i) out << "10\n";
  return out.str();
}

TEST(MlsGivenNodes, AreTheVerticesOfTheMeshWithAllOfItsVolume) {
  const TetMesh mesh = tetrahedralize_box(kSize, 0.003);
  const TemporaryFolder folder;
  folder.write("box.ele", tetgen_elements(mesh));
  for (const std::string& path :
       {folder.write("box.node", tetgen_nodes(mesh)), folder.write("box.mesh", medit(mesh)),
        folder.write("box.vtk", vtk(mesh))}) {
    Scene scene = mls_box(kSize, 0.0015);
    Body& body = scene.bodies[0];
    body.shape = Shape::kMesh;
    body.mesh = path;
    body.scale = 1e-3;
    body.pose.position = Vec3(0.01, 0.02, 0.03);
    Region held;  // below a z
    held.z = 0.03 - 0.5 * kSize.z() + 1e-4;
    body.anchors = {held};
    MlsTissue tissue(scene);
    MlsState& s = tissue.state();
    ASSERT_EQ(s.count(), static_cast<int>(mesh.vertices.size())) << path;
    double sum = 0;
    int surface = 0;
    for (int i = 0; i < s.count(); ++i) {
      sum += s.nodes.volume[i];
      surface += s.nodes.surface[i];
      if (s.nodes.anchored[i] != 0) continue;
      double nearest = 1;
      for (const Vec3& x : mesh.vertices) {
        nearest = std::min(nearest, (s.nodes.place[i] - x - body.pose.position).norm());
      }
      EXPECT_LT(nearest, 1e-8);
    }
    EXPECT_NEAR(sum / kSize.prod(), 1, 1e-6);
    EXPECT_GT(surface, 100);
    EXPECT_LT(surface, s.count());
    // Linear fields are exact, whatever the nodes, and a cut parts them.
    Eigen::Matrix3d A;
    A << 0.1, 0.2, -0.1, 0, 0.05, 0.1, 0.2, 0, -0.1;
    impose(s, A);
    for (const Eigen::Matrix3d& H : reference::mls_gradients(s)) {
      EXPECT_NEAR((H - A).norm(), 0, 1e-5);
    }
    tissue.cut_now(plane_cut(A * body.pose.position + body.pose.position, Vec3(1, 0.1, 0)));
    EXPECT_EQ(tissue.fragment_count(), 2) << path;
  }
}

// Two boxes with a face in common, but vertices of their own, are two; a box of long thin cells,
// whose vertices find no neighbours across it, is said.
TEST(MlsGivenNodes, HangTogetherAsTheMeshDoesOrItIsSaid) {
  const TemporaryFolder folder;
  TetMesh mesh = tetrahedralize_box(kSize, 0.003);
  const auto count = static_cast<int>(mesh.vertices.size());
  for (int i = 0; i < count; ++i) {
    mesh.vertices.push_back(mesh.vertices[i] + Vec3(1.001 * kSize.x(), 0, 0));
  }
  for (std::size_t t = mesh.tetrahedra.size(); t-- > 0;) {
    auto other = mesh.tetrahedra[t];
    for (int& v : other) v += count;
    mesh.tetrahedra.push_back(other);
  }
  Scene scene = mls_box(kSize, 0.0015);
  Body& body = scene.bodies[0];
  body.shape = Shape::kMesh;
  body.mesh = folder.write("two.mesh", medit(mesh));
  body.scale = 1e-3;
  MlsTissue two(scene);
  EXPECT_EQ(two.fragment_count(), 2);
  EXPECT_EQ(two.notes().size(), 0u);

  mesh = tetrahedralize_box(kSize, 0.003);
  for (Vec3& x : mesh.vertices) x.z() *= 20;
  body.mesh = folder.write("long.mesh", medit(mesh));
  MlsTissue thin(scene);
  EXPECT_EQ(thin.fragment_count(), 1);
  const std::vector<std::string>& notes = thin.notes();
  ASSERT_FALSE(notes.empty());
  EXPECT_NE(notes.back().find("too long and thin"), std::string::npos) << notes.back();
}

/// A ball of nodes 2.2 mm apart, but for three that stand 0.15 mm and less from others.
TetMesh ball_with_near_vertices() {
  Body body;
  body.shape = Shape::kBall;
  body.radius = 0.012;
  TetMesh mesh = load_tets(body, 0.0033, nullptr);
  std::size_t within = 1000;  // in which the next one comes to stand
  for (int k = 0; k < 3; ++k) {
    std::array<int, 4> t = mesh.tetrahedra[within];
    if (k == 1) t = {t[1], t[0], t[3], t[2]};
    const int at = static_cast<int>(mesh.vertices.size());
    const Vec3 from = mesh.vertices[t[0]];
    const Vec3 face = (mesh.vertices[t[1]] + mesh.vertices[t[2]] + mesh.vertices[t[3]]) / 3;
    mesh.vertices.emplace_back(from + 1.5e-4 * (face - from).normalized());
    mesh.tetrahedra[within] = {at, t[1], t[2], t[3]};
    mesh.tetrahedra.push_back({t[0], at, t[2], t[3]});
    mesh.tetrahedra.push_back({t[0], t[1], at, t[3]});
    within = mesh.tetrahedra.size();
    mesh.tetrahedra.push_back({t[0], t[1], t[2], at});
  }
  return mesh;
}

// Vertices that are nearer than usual, or whose shares are small, cost no more than four times the
// substeps of as many nodes on a lattice (1 687 for 914; each for itself 14 330). And the body lies
// on the ground, not within it: its nodes stand at its surface, so nothing outside of them gives
// way (0.33 mm where it lands; as if it did 1.25).
TEST(MlsGivenNodes, ThatAreTooNearAreOneAndTheBodyLiesOnTheGround) {
  const TetMesh mesh = ball_with_near_vertices();
  const TemporaryFolder folder;
  Scene scene = mls_box(kSize, 0.0011);
  scene.gravity = Vec3(0, 0, -9.81);
  Body& body = scene.bodies[0];
  body.pose.position = Vec3::Zero();
  body.shape = Shape::kMesh;
  body.mesh = folder.write("ball.mesh", medit(mesh));
  body.scale = 1e-3;
  double low = 0, all = 0;
  for (const Vec3& x : mesh.vertices) low = std::min(low, x.z());
  for (int t = 0; t < static_cast<int>(mesh.tetrahedra.size()); ++t) all += volume(mesh, t);
  scene.ground.enabled = true;
  scene.ground.z = low;
  Scene regular = scene;
  regular.bodies[0].shape = Shape::kBall;
  regular.bodies[0].radius = 0.012;
  regular.cell_size = 2 * std::cbrt(all / static_cast<double>(mesh.vertices.size()));
  const auto run = [](const Scene& s, double& lowest) {
    MlsTissue tissue(s);
    int substeps = 0;
    for (int k = 0; k < 12; ++k) {
      tissue.advance(1 / s.frame_rate, {});
      substeps += tissue.finish().substeps;
      for (int i = 0; i < tissue.state().count(); ++i) {
        lowest = std::min(lowest, tissue.state().position(i).z());
      }
    }
    return substeps;
  };
  double lowest = 0, other = 0;
  const std::vector<std::string> notes = MlsTissue(scene).notes();
  ASSERT_FALSE(notes.empty());
  EXPECT_NE(notes.back().find("are one node with these"), std::string::npos) << notes.back();
  const int given = run(scene, lowest), even = run(regular, other);
  EXPECT_LT(given, 4 * even);
  EXPECT_LT(low - lowest, 4e-4);
}

}  // namespace
}  // namespace tissue_sim
