// What bodies are made of: triangles of shapes, tetrahedra, rays across the inside.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <map>
#include <numeric>
#include <random>

#include "geometry/ray_tree.h"
#include "geometry/surface.h"
#include "geometry/tet_mesh.h"
#include "pbd/internal_links.h"
#include "support/temporary_folder.h"

namespace tissue_sim {
namespace {

constexpr double kPi = 3.14159265358979;

Body body_of(Shape shape) {
  Body body;
  body.shape = shape;
  body.pose.position = Vec3(0.01, -0.02, 0.03);
  body.pose.orientation = Quat(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()));
  return body;
}

double exact(const Body& b) {
  if (b.shape == Shape::kBox) return b.size.prod();
  if (b.shape == Shape::kBall) return 4 * kPi / 3 * std::pow(b.radius, 3);
  if (b.shape == Shape::kEllipsoid) return 4 * kPi / 3 * b.radii.prod();
  return kPi * b.radius * b.radius * b.height;
}

bool is_closed(const TriangleMesh& mesh) {
  std::map<std::pair<int, int>, int> sides;
  for (const auto& t : mesh.triangles) {
    for (int i = 0; i < 3; ++i) ++sides[{t[i], t[(i + 1) % 3]}];
  }
  for (const auto& [edge, count] : sides) {
    const auto other = sides.find({edge.second, edge.first});
    if (count != 1 || other == sides.end() || other->second != 1) return false;
  }
  return true;
}

TEST(Triangulation, OfEachShapeIsClosedAndHasItsVolume) {
  for (const Shape shape : {Shape::kBox, Shape::kBall, Shape::kEllipsoid, Shape::kCylinder}) {
    const Body body = body_of(shape);
    const TriangleMesh mesh = triangulate(body, 0.003);
    EXPECT_TRUE(is_closed(mesh)) << static_cast<int>(shape);
    const double within = shape == Shape::kBox ? 1e-9 : 0.02;
    EXPECT_NEAR(signed_volume(mesh) / exact(body), 1, within) << static_cast<int>(shape);
  }
}

TEST(Tetrahedra, FillABoxExactly) {
  const TetMesh mesh = tetrahedralize_box(Vec3(0.04, 0.03, 0.02), 0.005);
  EXPECT_NEAR(volume(mesh), 0.04 * 0.03 * 0.02, 1e-12);
  TriangleMesh surface{mesh.vertices, boundary(mesh)};
  EXPECT_TRUE(is_closed(surface));
  EXPECT_NEAR(signed_volume(surface), volume(mesh), 1e-12);
}

TEST(Tetrahedra, StuffASurface) {
  for (const Shape shape : {Shape::kBall, Shape::kEllipsoid, Shape::kCylinder}) {
    const Body body = body_of(shape);
    const TetMesh mesh = load_tets(body, 0.004, nullptr);
    double least = 4;
    for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
      EXPECT_GT(volume(mesh, static_cast<int>(t)), 0);
      least = std::min(least, smallest_dihedral(mesh, static_cast<int>(t)));
    }
    EXPECT_GT(least * 180 / kPi, 7) << static_cast<int>(shape);
    EXPECT_NEAR(volume(mesh) / exact(body), 1, 0.04) << static_cast<int>(shape);
    const TriangleMesh surface{mesh.vertices, boundary(mesh)};
    EXPECT_NEAR(signed_volume(surface) / volume(mesh), 1, 1e-9);
    EXPECT_TRUE(is_closed(surface));
  }
}

TEST(Tetrahedra, AreReadFromEachFormat) {
  const TemporaryFolder folder;
  const auto write = [&](const std::string& name, const std::string& text) {
    std::ofstream(folder.path() + "/" + name) << text;
    return folder.path() + "/" + name;
  };
  write("a.node", "# a comment\n4 3 0 0\n1 0 0 0\n2 1 0 0 # here too\n3 0 1 0\n4 0 0 2\n");
  const std::string tetgen = write("a.ele", "1 4 0\n1 1 2 3 4\n");
  const std::string medit =
      write("a.mesh",
            "MeshVersionFormatted 1\nDimension 3\nVertices\n4\n0 0 0 1\n1 0 0 1\n"
            "0 1 0 1\n0 0 2 1\nTriangles\n1\n1 2 3 1\nTetrahedra\n1\n1 2 3 4 1\nEnd\n");
  const std::string vtk =
      write("a.vtk",
            "# vtk DataFile Version 2.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\n"
            "POINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 2\nCELLS 2 9\n4 0 1 2 3\n3 0 1 2\n"
            "CELL_TYPES 2\n10\n5\n");
  for (const std::string& path : {tetgen, medit, vtk}) {
    const TetMesh mesh = read_tets(path);
    ASSERT_EQ(mesh.tetrahedra.size(), 1u) << path;
    EXPECT_NEAR(volume(mesh), 1.0 / 3, 1e-12) << path;
  }
}

TEST(Tetrahedra, InvertedOnesAreTurnedAndFlatOnesRefusedByNumber) {
  TetMesh mesh;
  mesh.vertices = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1), Vec3(1, 1, 1)};
  mesh.tetrahedra = {{0, 1, 2, 3}, {1, 2, 4, 3}};
  std::vector<std::string> notes;
  TetMesh mended = mesh;
  check_tets(mended, notes);
  for (int t = 0; t < 2; ++t) EXPECT_GT(volume(mended, t), 0);
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_NE(notes[0].find("inverted"), std::string::npos) << notes[0];
  mesh.vertices.push_back(Vec3(1, 1, 0));
  mesh.tetrahedra.push_back({0, 1, 2, 5});
  try {
    check_tets(mesh, notes);
    FAIL() << "a flat tetrahedron passed";
  } catch (const std::invalid_argument& e) {
    EXPECT_NE(std::string(e.what()).find("(2)"), std::string::npos) << e.what();
  }
}

TEST(Rays, MeetWhatABruteForceSearchMeets) {
  const TriangleMesh mesh = triangulate(body_of(Shape::kEllipsoid), 0.006);
  const RayTree tree(mesh);
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 300; ++i) {
    const Vec3 origin =
        Vec3(0.01, -0.02, 0.03) + 0.02 * Vec3(normal(random), normal(random), normal(random));
    const Vec3 direction = Vec3(normal(random), normal(random), normal(random)).normalized();
    double nearest = 1e300;
    int winding = 0;
    for (const auto& t : mesh.triangles) {
      const Vec3 &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
      Eigen::Matrix3d m;
      m << b - a, c - a, -direction;
      const Vec3 s = m.colPivHouseholderQr().solve(origin - a);
      if (s[0] < 0 || s[1] < 0 || s[0] + s[1] > 1 || s[2] <= 0) continue;
      const bool out = (b - a).cross(c - a).dot(direction) > 0;
      winding += out ? 1 : -1;
      if (out) nearest = std::min(nearest, s[2]);
    }
    const RayHit hit = tree.first_exit(origin, direction, -1, 0);
    EXPECT_EQ(hit.triangle >= 0, nearest < 1e299);
    if (hit.triangle >= 0) {
      EXPECT_NEAR(hit.along, nearest, 1e-9);
    }
    EXPECT_EQ(tree.winding(origin, direction), winding);
  }
}

// Algorithm 2 on a slab: straight across, to the vertex opposite.
TEST(InternalLinks, OfASlabLeadStraightAcross) {
  Body body;
  body.size = Vec3(0.04, 0.04, 0.01);
  const TriangleMesh mesh = triangulate(body, 0.005);
  std::vector<int> inner;
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const Vec3& x = mesh.vertices[v];
    if (std::fabs(x.x()) < 0.018 && std::fabs(x.y()) < 0.018) inner.push_back(static_cast<int>(v));
  }
  const auto links = pbd::find_internal_links(mesh, inner);
  ASSERT_EQ(links.size(), inner.size());
  for (const auto& link : links) {
    EXPECT_NEAR(link.length, 0.01, 1e-9);
    const Vec3 way = mesh.vertices[link.to] - mesh.vertices[link.from];
    EXPECT_LT(std::hypot(way.x(), way.y()), 1e-9);
  }
}

// A wound within one piece has two walls that lie on one another: a ray from the one does not end
// at the other, but where the body does.
TEST(InternalLinks, OfAWallLeadPastTheOtherWall) {
  Body body;
  body.size = Vec3(0.04, 0.04, 0.01);
  TriangleMesh mesh = triangulate(body, 0.005);
  const int first = static_cast<int>(mesh.vertices.size());
  const double height = 0.001;
  for (int side = 0; side < 2; ++side) {  // above the wound and below it
    const double jitter = 1e-12 * side;   // as rounding leaves them
    mesh.vertices.push_back(Vec3(-0.007, -0.007, height + jitter));
    mesh.vertices.push_back(Vec3(0.007, -0.007, height - jitter));
    mesh.vertices.push_back(Vec3(0, 0.007, height + jitter));
  }
  mesh.triangles.push_back({first, first + 2, first + 1});      // body above: looks down
  mesh.triangles.push_back({first + 3, first + 4, first + 5});  // body below: looks up
  std::vector<int> walls(6);
  std::iota(walls.begin(), walls.end(), first);
  const auto links = pbd::find_internal_links(mesh, walls, {}, 0.0005);
  ASSERT_EQ(links.size(), walls.size());
  for (const auto& link : links) {
    EXPECT_NEAR(link.length, link.from < first + 3 ? 0.005 - height : 0.005 + height, 1e-9);
    EXPECT_LT(link.to, first);
  }
}

TEST(Surface, SaysWhatItFoundAndLeftOut) {
  Body ball;
  ball.shape = Shape::kBall;
  TriangleMesh mesh = triangulate(ball, 0.008);
  const std::size_t whole = mesh.triangles.size();
  std::swap(mesh.triangles[5][0], mesh.triangles[5][1]);  // faces inwards
  mesh.triangles.push_back(mesh.triangles[9]);            // twice
  mesh.triangles.push_back({0, 1, 1});                    // no area
  mesh.vertices.push_back(Vec3(1, 1, 1));                 // of no triangle
  mesh.triangles.erase(mesh.triangles.begin() + 20);      // a hole
  std::vector<std::string> notes;
  const SurfaceKind kind = tidy_surface(mesh, notes);
  EXPECT_EQ(mesh.triangles.size(), whole - 1);
  EXPECT_EQ(kind.open_edges, 3);
  EXPECT_EQ(kind.crowded_edges, 0);
  EXPECT_EQ(kind.parts, 1);
  EXPECT_EQ(notes.size(), 5u);
  EXPECT_GT(signed_volume(mesh), 0);
}

}  // namespace
}  // namespace tissue_sim
