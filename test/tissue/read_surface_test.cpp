// The surface as triangles: closed around each piece, as large as it, and cut where the cut was.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "support/cut_paths.h"
#include "support/temporary_folder.h"
#include "support/test_meshes.h"
#include "tissue/each_method.h"

namespace tissue_sim {
namespace {

using Corner = std::array<float, 3>;

struct PieceSurface {
  double volume = 0;                               ///< that it encloses [m^3]
  std::map<std::pair<Corner, Corner>, int> edges;  ///< how often more from the first on than back
  bool is_closed() const {
    for (const auto& [edge, more] : edges) {
      if (more != 0) return false;
    }
    return true;
  }
};

Corner corner_of(const SurfaceTriangles& s, std::size_t triangle, int k) {
  const float* x = s.corners.data() + 9 * triangle + 3 * k;
  return {x[0], x[1], x[2]};
}

Vec3 place_of(const Corner& c) { return {c[0], c[1], c[2]}; }

/// By piece.
std::map<int, PieceSurface> pieces_of(const SurfaceTriangles& s) {
  std::map<int, PieceSurface> pieces;
  for (std::size_t t = 0; t < s.fragment.size(); ++t) {
    PieceSurface& piece = pieces[s.fragment[t]];
    Vec3 x[3];
    for (int k = 0; k < 3; ++k) {
      const Corner from = corner_of(s, t, k), to = corner_of(s, t, (k + 1) % 3);
      x[k] = place_of(from);
      if (from == to) continue;
      if (from < to) {
        ++piece.edges[{from, to}];
      } else {
        --piece.edges[{to, from}];
      }
    }
    piece.volume += x[0].dot(x[1].cross(x[2])) / 6;
  }
  return pieces;
}

enum class Kind { kBox, kEllipsoid, kMesh };

class ReadSurface : public EachMethod {
 protected:
  Scene scene_of(Kind kind) {
    Scene scene = free_box(Vec3(0.04, 0.03, 0.02), 0.003);
    scene.threads = 2;
    Body& body = scene.bodies[0];
    body.pose.position = Vec3::Zero();
    if (kind == Kind::kEllipsoid) {
      body.shape = Shape::kEllipsoid;
      body.radii = Vec3(0.024, 0.019, 0.015);
    } else if (kind == Kind::kMesh) {
      body.shape = Shape::kMesh;
      body.mesh = folder_.write("l.obj", obj_text(l_shape()));
      body.scale = 0.018;
      body.pose.position = Vec3(-0.012, -0.012, -0.009);
    }
    return on_this(scene);
  }
  TemporaryFolder folder_;
};

/// Each piece's surface is closed and encloses its volume.
void expect_closed(Tissue& tissue, std::size_t pieces) {
  SurfaceTriangles s;
  tissue.read_surface(s);
  ASSERT_EQ(s.corners.size(), 9 * s.fragment.size());
  ASSERT_EQ(s.cut.size(), s.fragment.size());
  const auto found = pieces_of(s);
  ASSERT_EQ(found.size(), pieces);
  ASSERT_EQ(tissue.fragments().size(), pieces);
  for (const Fragment& f : tissue.fragments()) {
    ASSERT_EQ(found.count(f.id), 1u);
    EXPECT_TRUE(found.at(f.id).is_closed());
    EXPECT_NEAR(found.at(f.id).volume, f.volume, 0.01 * f.volume);
  }
}

int cut_triangles(Tissue& tissue) {
  SurfaceTriangles s;
  tissue.read_surface(s);
  return static_cast<int>(std::count(s.cut.begin(), s.cut.end(), 1));
}

const Vec3 kAcross(1, 0.3, 0.2);

TEST_P(ReadSurface, IsClosedAroundEachPieceAndEnclosesIt) {
  for (const Kind kind : {Kind::kBox, Kind::kEllipsoid, Kind::kMesh}) {
    SCOPED_TRACE(static_cast<int>(kind));
    Scene scene = scene_of(kind);
    scene.gravity = Vec3(1, 0, -4);
    scene.ground.enabled = true;
    scene.ground.z = kind == Kind::kBox ? -0.01 : kind == Kind::kMesh ? -0.009 : -0.015;
    Simulation simulation(scene);
    expect_closed(simulation.tissue(), 1);
    for (int f = 0; f < 6; ++f) simulation.advance_frame();
    expect_closed(simulation.tissue(), 1);
    EXPECT_EQ(cut_triangles(simulation.tissue()), 0);
    simulation.cut(plane_cut(Vec3::Zero(), kAcross));
    for (int f = 0; f < 6; ++f) simulation.advance_frame();
    expect_closed(simulation.tissue(), 2);
    EXPECT_GT(cut_triangles(simulation.tissue()), 0);
  }
}

TEST_P(ReadSurface, IsClosedAroundASlit) {
  Simulation simulation(scene_of(Kind::kBox));
  simulation.cut(upright_blade({Vec3(-0.1, 0.001, 0), Vec3(0.003, 0.002, 0)}));
  simulation.advance_frame();
  expect_closed(simulation.tissue(), 1);
  EXPECT_GT(cut_triangles(simulation.tissue()), 0);
}

TEST_P(ReadSurface, SaysWhichTrianglesTheCutMade) {
  Simulation simulation(scene_of(Kind::kBox));
  const Vec3 normal = kAcross.normalized();
  simulation.cut(plane_cut(Vec3::Zero(), kAcross));
  simulation.advance_frame();
  SurfaceTriangles s;
  simulation.tissue().read_surface(s);
  double most = 0;           // from the blade's plane to a face of the cut [m]
  std::map<int, Vec3> area;  // of the cut's faces, by piece
  for (std::size_t t = 0; t < s.fragment.size(); ++t) {
    Vec3 x[3];
    double farthest = 0;
    for (int k = 0; k < 3; ++k) {
      x[k] = place_of(corner_of(s, t, k));
      farthest = std::max(farthest, std::fabs(x[k].dot(normal)));
    }
    const Vec3 of = (x[1] - x[0]).cross(x[2] - x[0]) / 2;
    if (s.cut[t] != 0) {
      most = std::max(most, farthest);
      area.emplace(s.fragment[t], Vec3::Zero()).first->second += of;
    } else if (of.norm() > 1e-8) {  // [m^2], of some 1e-6: not what is thin at the rim
      EXPECT_GT(farthest, 1e-4);
    }
  }
  // Where tetrahedra part, vertices are moved onto the cut where these stay sound. At the rim two
  // planes meet at a flat angle, and `mls` knows a cut by places of 1/254 of a pair.
  EXPECT_LT(most, GetParam().method == Method::kPbd   ? 2e-3
                  : GetParam().method == Method::kMls ? 2e-4
                                                      : 1e-4);
  ASSERT_EQ(area.size(), 2u);
  const double whole = 0.03 * 0.02 / normal.x();
  double sides = 0;
  for (const auto& [id, of] : area) {
    EXPECT_NEAR(of.norm(), whole, 0.03 * whole);
    EXPECT_GT(std::fabs(of.dot(normal)), 0.999 * of.norm());
    sides += of.dot(normal);
  }
  EXPECT_NEAR(sides, 0, 1e-3 * whole);  // one looks each way
}

TEST_P(ReadSurface, SaysWhetherMoreThanCornersChanged) {
  Scene scene = scene_of(Kind::kBox);
  scene.gravity = Vec3(0, 0, -4);
  Simulation simulation(scene);
  SurfaceTriangles kept, anew;
  simulation.tissue().read_surface(kept);
  const std::uint64_t whole = kept.made;
  EXPECT_NE(whole, 0u);
  const auto is_as_read_anew = [&] {
    anew = {};
    simulation.tissue().read_surface(anew);
    return anew.made != kept.made && anew.corners == kept.corners && anew.rest == kept.rest &&
           anew.fragment == kept.fragment && anew.point == kept.point && anew.cut == kept.cut;
  };
  const std::vector<float> before = kept.corners;
  for (int i = 0; i < 5; ++i) simulation.advance_frame();
  simulation.tissue().read_surface(kept);
  EXPECT_EQ(kept.made, whole);
  EXPECT_NE(kept.corners, before) << "it falls";
  EXPECT_TRUE(is_as_read_anew());
  simulation.cut(plane_cut(Vec3::Zero(), kAcross));
  simulation.advance_frame();
  simulation.tissue().read_surface(kept);
  EXPECT_NE(kept.made, whole);
  EXPECT_TRUE(is_as_read_anew());
}

TEST(ReadSurfaceOfPbd, IsClosedWhereAWoundOfASurfaceModelWas) {
  Scene scene = free_box(Vec3(0.04, 0.03, 0.02), 0.003);
  scene.method = Method::kPbd;
  Simulation simulation(scene);
  simulation.cut(plane_cut(Vec3(0.02, 0.015, 0.01), kAcross));
  simulation.advance_frame();
  expect_closed(simulation.tissue(), 2);
  EXPECT_GT(cut_triangles(simulation.tissue()), 0);
  const int cut = cut_triangles(simulation.tissue());
  simulation.cut(plane_cut(Vec3(0.02, 0.015, 0.01), Vec3::UnitY()));
  simulation.advance_frame();
  EXPECT_GT(cut_triangles(simulation.tissue()), cut);
}

FOR_EACH_METHOD(ReadSurface);

}  // namespace
}  // namespace tissue_sim
