// What a user of position-based dynamics takes for granted: a body's mass, that it comes to rest,
// that nothing blows up by itself. By the public interface.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "pbd/pbd_tissue.h"
#include "support/cut_paths.h"
#include "support/temporary_folder.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

constexpr double kPi = 3.14159265358979;

struct Rings {
  int around, along;
};

/// A closed surface by rings of vertices from pole to pole, without its first `left_out` triangles.
template <class Place>
std::string obj(const Rings& rings, const Place& place, int left_out = 0) {
  std::vector<Vec3> vertices = {place(0.0, 0.0)};
  const auto [a, b] = rings;
  for (int j = 1; j < b; ++j) {
    for (int i = 0; i < a; ++i) vertices.push_back(place(kPi * j / b, 2 * kPi * i / a));
  }
  vertices.push_back(place(kPi, 0.0));
  std::vector<std::array<int, 3>> triangles;
  const int last = static_cast<int>(vertices.size());
  for (int i = 0; i < a; ++i) triangles.push_back({1, 2 + i, 2 + (i + 1) % a});
  for (int j = 0; j + 2 < b; ++j) {
    for (int i = 0; i < a; ++i) {
      const int p = 2 + j * a + i, q = 2 + j * a + (i + 1) % a;
      triangles.push_back({p, p + a, q + a});
      triangles.push_back({p, q + a, q});
    }
  }
  for (int i = 0; i < a; ++i) {
    triangles.push_back({last, 2 + (b - 2) * a + (i + 1) % a, 2 + (b - 2) * a + i});
  }
  std::string text;
  for (const Vec3& v : vertices) {
    text += "v " + std::to_string(v.x()) + " " + std::to_string(v.y()) + " " +
            std::to_string(v.z()) + "\n";
  }
  for (std::size_t t = left_out; t < triangles.size(); ++t) {
    text += "f";
    for (const int v : triangles[t]) text += " " + std::to_string(v);
    text += "\n";
  }
  return text;
}

/// 50 mm of radius, in millimetres.
Vec3 on_ball(double t, double p) {
  return 50 * Vec3(std::sin(t) * std::cos(p), std::sin(t) * std::sin(p), std::cos(t));
}

/// Some 135 x 100 x 55 mm, smooth; long thin triangles at its poles.
Vec3 on_bumpy_ball(double t, double p) {
  const double r =
      45 * (1 + 0.25 * std::sin(3 * t) * std::cos(4 * p) + 0.1 * std::cos(7 * t) * std::sin(5 * p));
  return r * Vec3(1.5 * std::sin(t) * std::cos(p), std::sin(t) * std::sin(p), 0.6 * std::cos(t));
}

class PbdTrust : public testing::Test {
 protected:
  Scene mesh_scene(const std::string& text, const std::string& name = "body.obj") const {
    std::ofstream(folder_.path() + "/" + name) << text;
    Scene scene;
    scene.method = Method::kPbd;
    scene.device = Device::kCpu;
    scene.bodies.resize(1);
    scene.bodies[0].shape = Shape::kMesh;
    scene.bodies[0].mesh = folder_.path() + "/" + name;
    scene.bodies[0].scale = 0.001;
    scene.bodies[0].pose.position = Vec3(0, 0, 0.2);
    return scene;
  }
  static double volume(Simulation& simulation) {
    double sum = 0;
    for (const Fragment& f : simulation.tissue().fragments()) sum += f.volume;
    return sum;
  }
  static std::vector<double> heights(Simulation& simulation) {
    std::vector<std::uint8_t> cloud;
    const int count = simulation.tissue().read_points({}, cloud);
    std::vector<double> all(count);
    for (int i = 0; i < count; ++i) {
      float place[3];
      std::memcpy(place, cloud.data() + i * (cloud.size() / count), sizeof place);
      all[i] = place[2];
    }
    return all;
  }
  static std::string notes(Simulation& simulation) {
    std::string all;
    for (const std::string& note : simulation.tissue().notes()) all += note + "\n";
    return all;
  }

  /// 10 mm above the ground.
  static void raise(Scene& scene) {
    scene.bodies[0].pose.position = Vec3::Zero();
    Simulation still(scene);
    const std::vector<double> all = heights(still);
    scene.bodies[0].pose.position.z() = kDrop - *std::min_element(all.begin(), all.end());
  }
  struct Fall {
    double fastest = 0, late = 0;  ///< late: from two seconds on [m/s]
    double farthest = 0;           ///< that a vertex fell [m]
    double rests = 0;              ///< no vertex is faster than 0.1 m/s from then on [s]
    /// Once it landed, of vertices faster than 1.5 times its speed then, the largest speed over
    /// what that vertex's own fall gives: 1 of what falls freely, 1.22 of the end of a rod on a
    /// hinge.
    double over_own = 0;
    double of_energy = 0;  ///< once it landed, what all moves with, of what its centre's fall gave
  };
  static Fall watch(Simulation& simulation, int frames) {
    constexpr double kGravity = 9.81;
    const pbd::Vertices& v = static_cast<PbdTissue&>(simulation.tissue()).state().vertices;
    std::vector<double> begin;
    for (int i = 0; i < v.size(); ++i) begin.push_back(v.position(i).z());
    const Momentum held = simulation.tissue().momentum();
    const double landing = std::sqrt(2 * kGravity * kDrop);
    Fall seen;
    for (int frame = 1; frame <= frames; ++frame) {
      const FrameResult result = simulation.advance_frame().result;
      seen.fastest = std::max(seen.fastest, result.max_speed);
      if (result.max_speed > 0.1) seen.rests = frame / 60.0;
      if (frame > 120) seen.late = std::max(seen.late, result.max_speed);
      if (frame < 5) continue;  // it falls
      for (int i = 0; i < v.size(); ++i) {
        const double speed = v.velocity(i).norm(), fall = begin[i] - v.position(i).z();
        seen.farthest = std::max(seen.farthest, fall);
        if (speed < 1.5 * landing) continue;
        const double own = std::sqrt(2 * kGravity * std::max(1e-9, fall));
        seen.over_own = std::max(seen.over_own, speed / own);
      }
      const double fall = held.centre.z() - simulation.tissue().momentum().centre.z();
      const double energy = result.kinetic_energy / (held.mass * kGravity * fall);
      seen.of_energy = std::max(seen.of_energy, energy);
    }
    return seen;
  }

 private:
  static constexpr double kDrop = 0.01;  // [m]
  TemporaryFolder folder_;
};

// One triangle less tripled it.
TEST_F(PbdTrust, AHoleDoesNotChangeTheMass) {
  Simulation whole(mesh_scene(obj({24, 12}, on_ball)));
  const double expected = volume(whole);
  EXPECT_NEAR(expected, 4 * kPi / 3 * std::pow(0.05, 3), 0.05 * expected);
  EXPECT_EQ(notes(whole).find("weighed"), std::string::npos);
  for (const int left_out : {1, 20}) {
    Simulation holed(mesh_scene(obj({24, 12}, on_ball, left_out)));
    EXPECT_NEAR(volume(holed), expected, 0.01 * expected) << left_out;
    EXPECT_NE(notes(holed).find("weighed with 1 hole closed"), std::string::npos) << notes(holed);
  }
}

TEST_F(PbdTrust, ASheetHasTheVolumeOfItsThickness) {
  std::string text;
  for (int j = 0; j <= 10; ++j) {
    for (int i = 0; i <= 10; ++i)
      text += "v " + std::to_string(4 * i) + " " + std::to_string(4 * j) + " 0\n";
  }
  for (int j = 0; j < 10; ++j) {
    for (int i = 1; i <= 10; ++i) {
      const int a = 11 * j + i;
      for (const std::array<int, 3> t :
           {std::array<int, 3>{a, a + 1, a + 12}, std::array<int, 3>{a, a + 12, a + 11}}) {
        text += "f " + std::to_string(t[0]) + " " + std::to_string(t[1]) + " " +
                std::to_string(t[2]) + "\n";
      }
    }
  }
  Simulation sheet(mesh_scene(text));
  EXPECT_NEAR(volume(sheet), 0.04 * 0.04 * Scene().cell_size, 1e-9);
  EXPECT_NE(notes(sheet).find("1 sheet"), std::string::npos) << notes(sheet);
}

// A triangle and its back beside the body were a piece.
TEST_F(PbdTrust, ADoubledTriangleIsNoPiece) {
  const std::string ball = obj({24, 12}, on_ball);
  const std::string speck =
      "v 60 0 0\nv 60.01 0 0\nv 60 0.01 0\nv 60 0 0.000001\nf 267 268 269\nf 267 270 268\n"
      "f 267 269 270\nf 268 270 269\n";
  Simulation alone(mesh_scene(ball)), with_speck(mesh_scene(ball + speck));
  EXPECT_EQ(with_speck.tissue().point_count(), alone.tissue().point_count());
  EXPECT_NE(notes(with_speck).find("1 speck"), std::string::npos) << notes(with_speck);
}

// Vertices of its long thin triangles shook at 85 m/s, for ever: bends there were as stiff as a
// plate as thick as the triangles are long.
TEST_F(PbdTrust, UnevenTrianglesComeToRest) {
  Scene scene = mesh_scene(obj({96, 48}, on_bumpy_ball));
  raise(scene);
  Simulation simulation(scene);
  const Fall seen = watch(simulation, 150);
  std::printf(
      "fastest %.3f m/s, %.2f of its own fall's, %.2f of the energy, from two seconds on %.3f\n",
      seen.fastest, seen.over_own, seen.of_energy, seen.late);
  // It lands at 0.44 m/s, and so soft its upper half falls on by another 15 mm: 0.70 m/s.
  EXPECT_LT(seen.fastest, 0.9);
  // Nothing is thrown: nor is anything faster than what fell farthest would be, had nothing held
  // it.
  EXPECT_LT(seen.fastest, std::sqrt(2 * 9.81 * seen.farthest));
  EXPECT_LT(seen.over_own, std::sqrt(1.5));
  EXPECT_LT(seen.of_energy, 1);
  EXPECT_LT(seen.late, 0.02);
  // As it lies it is bent, and so is a plane's wound at rest: slivers there left it whole.
  simulation.cut(plane_cut(simulation.tissue().fragments()[0].centroid, Vec3(1, 0, 0)));
  const CutReport report = simulation.advance_frame().result.cut_reports.at(0);
  EXPECT_EQ(report.pieces_left_whole, 0) << report.why_left_whole;
  EXPECT_EQ(simulation.tissue().fragments().size(), 2u);
}

// Long spikes on coarse triangles crumple where they land: bends so far from rest fed vertices with
// up to 2.3 m/s, for ever.
TEST_F(PbdTrust, CrumpledSpikesComeToRest) {
  struct Ball {
    Rings rings;
    double radius, high, low;
    int around, along;
  };
  for (const Ball& ball : {Ball{{24, 12}, 80, 0.6, 0.2, 3, 3}, Ball{{32, 16}, 70, 0.5, 0.1, 3, 4},
                           Ball{{40, 20}, 90, 0.6, 0.1, 5, 3}}) {
    const auto place = [&ball](double t, double p) {
      const double r =
          ball.radius * (1 + ball.high * std::sin(ball.around * t) * std::cos(ball.along * p) +
                         ball.low * std::cos(7 * t) * std::sin(5 * p));
      return Vec3(
          r * Vec3(1.5 * std::sin(t) * std::cos(p), std::sin(t) * std::sin(p), 0.8 * std::cos(t)));
    };
    Scene scene = mesh_scene(obj(ball.rings, place));
    raise(scene);
    Simulation simulation(scene);
    const double late = watch(simulation, 180).late;
    std::printf("from two seconds on %.3f m/s\n", late);
    EXPECT_LT(late, 0.5) << ball.radius;
  }
}

// Held vertices left constraints of strain next to no slope: not a number in the first frame.
TEST_F(PbdTrust, AHeldCylinderOfStrainStays) {
  Simulation simulation(scene_from_yaml(
      "{method: pbd, device: cpu, pbd: {elasticity: strain, model: tetrahedra}, bodies: [{shape: "
      "cylinder, radius: 0.007744681545495561, height: 0.02408052080337735, pose: {position: [0, "
      "0, 0.0131]}, anchors: [{ball: {center: [-0.012, 0, 0.0131], radius: 0.0077}}]}]}"));
  for (int frame = 0; frame < 60; ++frame) {
    const FrameReport report = simulation.advance_frame();
    ASSERT_FALSE(report.result.blew_up) << frame;
    EXPECT_LT(report.result.max_speed, 0.2);
  }
  EXPECT_LT((simulation.tissue().fragments()[0].centroid - Vec3(0, 0, 0.0131)).norm(), 1e-3);
}

// Strain that a tool pressed flat came back ever further: 6 000 m/s in the first frame.
TEST_F(PbdTrust, StrainThatIsPressedFlatStays) {
  Simulation simulation(scene_from_yaml(
      "{method: pbd, device: cpu, cell_size: 0.006, damping: 0.03, tools: [{name: t, type: punch, "
      "radius: 0.0164762}], pbd: {elasticity: strain, model: tetrahedra}, bodies: [{shape: "
      "ellipsoid, radii: [0.0165054, 0.0215638, 0.0258803], pose: {position: [-0.008619, "
      "0.015494, 0.03101]}}]}"));
  for (int frame = 0; frame < 10; ++frame) {
    simulation.set_tool(0, {Vec3(-0.0102039, 0.0132314, 0.018359), Quat(0, 1, 0, 0)});
    const FrameReport report = simulation.advance_frame();
    ASSERT_FALSE(report.result.blew_up) << frame;
    EXPECT_LT(report.result.max_speed, 2) << frame;
  }
}

// A link from a vertex to itself, where those around had no room: its state was refused.
TEST_F(PbdTrust, TheStateOfAThinBodyIsRestored) {
  Scene scene = mesh_scene(obj({12, 4}, [](double t, double p) {
    const double wide = std::sin(t) * (1 - t / kPi);
    return Vec3(50 * wide * std::cos(p), 10 * wide * std::sin(p), 3 * std::cos(t));
  }));
  scene.bodies[0].pose.position = Vec3::Zero();
  Simulation simulation(scene), restored(scene);
  const std::vector<std::uint8_t> saved = simulation.save();
  restored.restore({saved.data(), saved.size()});
  EXPECT_EQ(restored.save(), saved);
}

// It fell, and a note said so: vertices lie on the face of the region, not in it.
TEST_F(PbdTrust, AnAnchorAtABodysOwnFaceHoldsIt) {
  for (const char* anchor : {"{below: 0}", "{box: {min: [-1, -1, -1], max: [-0.02, 1, 1]}}",
                             "{box: {min: [0.02, -1, -1], max: [1, 1, 1]}}"}) {
    for (const char* model : {"surface", "tetrahedra"}) {
      Simulation simulation(scene_from_yaml(
          std::string("{method: pbd, device: cpu, ground: {enabled: false}, pbd: {model: ") +
          model + "}, bodies: [{size: [0.04, 0.02, 0.02], pose: {position: [0, 0, 0.01]}, " +
          "anchors: [" + anchor + "]}]}"));
      EXPECT_EQ(notes(simulation).find("hold none"), std::string::npos) << notes(simulation);
      for (int frame = 0; frame < 60; ++frame) simulation.advance_frame();
      EXPECT_LT((simulation.tissue().fragments()[0].centroid - Vec3(0, 0, 0.01)).norm(), 0.03)
          << anchor << ' ' << model;  // 4.9 m where it falls
    }
  }
}

// Triangles that nothing holds in shape grow without bound; their cells of the search must not:
// 14 s a frame, then no memory.
TEST_F(PbdTrust, StretchedTrianglesTakeNoMoreMemory) {
  Simulation simulation(scene_from_yaml(
      "{method: pbd, device: cpu, cell_size: 0.005, ground: {enabled: false}, gravity: [9, 9, 9], "
      "pbd: {edge: 0, bending: 0, internal: 0}, bodies: [{name: a, size: [0.04, 0.04, 0.02], "
      "anchors: [{below: 0.0}]}, {name: b, size: [0.04, 0.04, 0.02], pose: {position: [0.06, 0, "
      "0.0]}}]}"));
  for (int frame = 0; frame < 120; ++frame) {
    EXPECT_FALSE(simulation.advance_frame().result.blew_up);
  }
}

// Two cubes in five tetrahedra each, the second a copy of the first, not its mirror image.
TEST_F(PbdTrust, FacesThatDoNotMatchAreSaid) {
  const auto mesh = [](bool is_mirrored) {
    std::string text = "MeshVersionFormatted 1\nDimension 3\nVertices\n12\n";
    for (int x = 0; x < 3; ++x) {
      for (int k = 0; k < 4; ++k) {
        text += std::to_string(10 * x) + " " + std::to_string(10 * (k % 2)) + " " +
                std::to_string(10 * (k / 2)) + " 1\n";
      }
    }
    text += "Tetrahedra\n10\n";
    constexpr int kFive[5][4] = {
        {0, 3, 5, 6}, {1, 0, 3, 5}, {2, 0, 6, 3}, {4, 0, 5, 6}, {7, 3, 6, 5}};
    for (int cube = 0; cube < 2; ++cube) {
      for (const auto& t : kFive) {
        for (const int c : t) {
          // Corner c: x by 4, y by 1, z by 2.
          const int corner = cube == 1 && is_mirrored ? c ^ 4 : c;
          text += std::to_string(1 + 4 * (cube + corner / 4) + corner % 4) + " ";
        }
        text += "1\n";
      }
    }
    return text + "End\n";
  };
  for (const bool is_mirrored : {false, true}) {
    Scene scene = mesh_scene(mesh(is_mirrored), "cubes.mesh");
    scene.pbd.model = PbdModel::kTetrahedra;
    Simulation simulation(scene);
    const bool is_said = notes(simulation).find("do not match at 1 face ") != std::string::npos;
    EXPECT_EQ(is_said, !is_mirrored) << notes(simulation);
  }
}

// An edge of the line that the trace of the blade left out held a body together that a plane went
// through, and nothing was said; tetrahedra came off alone beside such a plane.
TEST_F(PbdTrust, APlaneThroughWhatMovesPartsIt) {
  struct Case {
    PbdModel model;
    double cell;
    int frames;
    Vec3 point, normal;
  };
  const Case cases[] = {
      {PbdModel::kSurface, 0.006, 8, {0.0136, 0.0078, 0.0155}, {-0.231, -0.064, 0.830}},
      {PbdModel::kTetrahedra, 0.008, 14, {-0.0108, -0.0082, 0.0205}, {0.218, 0.711, -0.655}},
      {PbdModel::kTetrahedra, 0.008, 6, {-0.0149, 0.0088, 0.0098}, {-0.368, -0.985, -0.002}},
      {PbdModel::kTetrahedra, 0.008, 3, {-0.0007, -0.0109, 0.0146}, {-0.206, -0.672, -0.424}}};
  for (const Case& c : cases) {
    Scene scene;
    scene.method = Method::kPbd;
    scene.device = Device::kCpu;
    scene.cell_size = c.cell;
    scene.pbd.model = c.model;
    scene.bodies.resize(1);
    scene.bodies[0].shape = Shape::kEllipsoid;
    scene.bodies[0].radii = Vec3(0.05, 0.03, 0.02);
    scene.bodies[0].pose.position.z() = 0.03;
    Simulation simulation(scene);
    for (int frame = 0; frame < c.frames; ++frame) simulation.advance_frame();
    simulation.cut(plane_cut(c.point, c.normal));
    const CutReport report = simulation.advance_frame().result.cut_reports.at(0);
    EXPECT_EQ(report.pieces_left_whole, 0) << report.why_left_whole;
    ASSERT_EQ(simulation.tissue().fragments().size(), 2u);
    for (const Fragment& f : simulation.tissue().fragments()) EXPECT_GT(f.point_count, 8);
  }
}

// scripts/pbd_meshes: a row for each of "mesh,scale;...", dropped by 10 mm, then cut through its
// middle.
TEST_F(PbdTrust, MeshTable) {
  const char* meshes = std::getenv("TISSUE_SIM_MESHES");
  if (meshes == nullptr) GTEST_SKIP() << "TISSUE_SIM_MESHES names no mesh";
  std::istringstream all(meshes);
  for (std::string one; std::getline(all, one, ';');) {
    const std::size_t comma = one.rfind(',');
    Scene scene = mesh_scene("");
    Body& body = scene.bodies[0];
    body.mesh = one.substr(0, comma);
    body.scale = std::stod(one.substr(comma + 1));
    raise(scene);
    Simulation simulation(scene);
    const double litres = 1e3 * volume(simulation);
    const Fall seen = watch(simulation, 180);
    const Vec3 middle = simulation.tissue().fragments()[0].centroid;
    simulation.cut(plane_cut(middle, Vec3(1, 0, 0)));
    const CutReport report = simulation.advance_frame().result.cut_reports.at(0);
    std::printf("| %s | %.4g | %.2f | %.2f | %.2f | %.1f | %d%s |\n",
                one.substr(one.rfind('/') + 1, comma - one.rfind('/') - 1).c_str(), litres,
                seen.fastest, seen.over_own, seen.of_energy, seen.rests,
                static_cast<int>(simulation.tissue().fragments().size()),
                report.pieces_left_whole > 0 ? " (left whole)" : "");
  }
}

}  // namespace
}  // namespace tissue_sim
