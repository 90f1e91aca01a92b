// The points that bodies are made of: their places, order and volumes.
#include "geometry/lattice.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <map>
#include <tuple>

#include "support/temporary_folder.h"
#include "support/test_meshes.h"

namespace tissue_sim {
namespace {

Body shaped(Shape shape) {
  Body body;
  body.shape = shape;
  return body;
}

Quat tilted() { return Quat(0.8, 0.3, -0.4, 0.2).normalized(); }

double volume_of(const Lattice& lattice) {
  double volume = 0;
  for (const Lattice::Site& s : lattice.sites) volume += s.volume;
  return volume;
}

// Middle of a site's half cell, in world axes.
Vec3 place(const Lattice& lattice, const Lattice::Site& s) {
  return lattice.origin + (Vec3(s.x, s.y, s.z).array() + 0.5).matrix() * (lattice.cell_size / 2);
}

Vec3 centroid_of(const Lattice& lattice) {
  Vec3 sum = Vec3::Zero();
  for (const Lattice::Site& s : lattice.sites) sum += s.volume * place(lattice, s);
  return sum / volume_of(lattice);
}

void expect_well_formed(const Lattice& lattice) {
  for (std::size_t i = 0; i < lattice.sites.size(); ++i) {
    const Lattice::Site& s = lattice.sites[i];
    ASSERT_TRUE(s.x >= 0 && s.x < 2 * lattice.nx && s.y >= 0 && s.y < 2 * lattice.ny && s.z >= 0 &&
                s.z < 2 * lattice.nz);
    ASSERT_GT(s.volume, 0);
    if (i == 0) continue;
    const Lattice::Site& p = lattice.sites[i - 1];
    ASSERT_LT(std::make_tuple(p.z, p.y, p.x), std::make_tuple(s.z, s.y, s.x));
  }
}

std::string reason_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "nothing was thrown";
}

TEST(Lattice, FillsABoxOfWholeCellsExactly) {
  Body body = shaped(Shape::kBox);
  body.size = Vec3(0.03, 0.02, 0.01);
  body.pose.position = Vec3(1, -2, 0.5);
  const Lattice lattice = make_lattice(body, 0.002, nullptr);
  expect_well_formed(lattice);
  EXPECT_LT((lattice.origin - Vec3(0.985, -2.01, 0.495)).norm(), 1e-12);
  EXPECT_EQ(std::make_tuple(lattice.nx, lattice.ny, lattice.nz), std::make_tuple(15, 10, 5));
  ASSERT_EQ(lattice.sites.size(), 30u * 20 * 10);
  for (const Lattice::Site& s : lattice.sites) ASSERT_NEAR(s.volume, 1e-9, 1e-15);
}

TEST(Lattice, GivesABoxesLastPointsTheirShare) {
  Body body = shaped(Shape::kBox);
  body.size = Vec3(0.0053, 0.0049, 0.004);  // 5.3, 4.9 and 4 half cells of 1 mm
  const Lattice lattice = make_lattice(body, 0.002, nullptr);
  expect_well_formed(lattice);
  EXPECT_EQ(std::make_tuple(lattice.nx, lattice.ny, lattice.nz), std::make_tuple(3, 3, 2));
  ASSERT_EQ(lattice.sites.size(), 6u * 5 * 4);
  for (const Lattice::Site& s : lattice.sites) {
    const double expected = (s.x == 5 ? 0.3e-3 : 1e-3) * (s.y == 4 ? 0.9e-3 : 1e-3) * 1e-3;
    ASSERT_NEAR(s.volume, expected, 1e-15) << s.x << " " << s.y;
  }
}

TEST(Lattice, HasTheVolumeAndCentreOfTheShape) {
  const TemporaryFolder folder;
  std::vector<std::pair<Body, double>> cases;
  Body body = shaped(Shape::kBall);
  body.radius = 0.02;
  cases.push_back({body, 4 * M_PI / 3 * 8e-6});
  body = shaped(Shape::kEllipsoid);
  body.radii = Vec3(0.03, 0.02, 0.024);
  cases.push_back({body, 4 * M_PI / 3 * body.radii.prod()});
  body = shaped(Shape::kCylinder);
  body.radius = 0.02;
  body.height = 0.05;
  cases.push_back({body, M_PI * 4e-4 * 0.05});
  body = shaped(Shape::kBox);
  body.size = Vec3(0.04, 0.05, 0.0433);
  cases.push_back({body, body.size.prod()});
  body = shaped(Shape::kMesh);
  const Vec3 half = Vec3(0.04, 0.05, 0.0433) / 2;
  body.mesh = folder.write("a.stl", stl_text(box_mesh(-half, half)));
  cases.push_back({body, 8 * half.prod()});
  for (auto& c : cases) {
    for (const Quat& q : {Quat::Identity(), Quat(std::sqrt(0.5), 0, std::sqrt(0.5), 0), tilted()}) {
      for (const Vec3& p : {Vec3(0, 0, 0), Vec3(0.0123, -0.3456, 0.0789)}) {
        c.first.pose.position = p;
        c.first.pose.orientation = q;
        const Lattice lattice = make_lattice(c.first, 0.004, nullptr);
        expect_well_formed(lattice);
        EXPECT_NEAR(volume_of(lattice) / c.second, 1, 0.003) << static_cast<int>(c.first.shape);
        EXPECT_LT((centroid_of(lattice) - p).norm(), 0.01 * 0.004)
            << static_cast<int>(c.first.shape) << " " << q.coeffs().transpose();
      }
    }
  }
}

TEST(Lattice, OrientsEllipsoidsAndCylinders) {
  // Second moments of the points against those of the shape: tells each axis from the others.
  Body ellipsoid = shaped(Shape::kEllipsoid), cylinder = shaped(Shape::kCylinder);
  ellipsoid.radii = Vec3(0.04, 0.02, 0.03);
  cylinder.radius = 0.02;
  cylinder.height = 0.08;
  const Vec3 moments[] = {ellipsoid.radii.cwiseAbs2() / 5, Vec3(1e-4, 1e-4, 0.08 * 0.08 / 12)};
  int i = 0;
  for (Body body : {ellipsoid, cylinder}) {
    body.pose.orientation = tilted();
    const Eigen::Matrix3d r = body.pose.orientation.toRotationMatrix();
    const Eigen::Matrix3d expected = r * moments[i++].asDiagonal() * r.transpose();
    const Lattice lattice = make_lattice(body, 0.002, nullptr);
    Eigen::Matrix3d found = Eigen::Matrix3d::Zero();
    for (const Lattice::Site& s : lattice.sites) {
      found += s.volume * place(lattice, s) * place(lattice, s).transpose();
    }
    found /= volume_of(lattice);
    EXPECT_LT((found - expected).norm(), 0.01 * expected.norm());
  }
}

TEST(Lattice, SamplesABallSymmetrically) {
  Body body = shaped(Shape::kBall);
  body.radius = 0.01037;
  const Lattice lattice = make_lattice(body, 0.002, nullptr);
  const int last = static_cast<int>(std::lround(-2 * lattice.origin.x() / 0.001)) - 1;
  EXPECT_NEAR(last + 1, -2 * lattice.origin.x() / 0.001, 1e-9);  // whole half cells, centred
  std::map<std::tuple<int, int, int>, float> volumes;
  for (const Lattice::Site& s : lattice.sites) volumes[{s.x, s.y, s.z}] = s.volume;
  for (const Lattice::Site& s : lattice.sites) {
    ASSERT_NEAR(volumes[std::make_tuple(last - s.x, s.y, s.z)], s.volume, 1e-15);
    ASSERT_NEAR(volumes[std::make_tuple(s.x, last - s.y, last - s.z)], s.volume, 1e-15);
  }
}

TEST(Lattice, MeshOfABoxEqualsTheBox) {
  const TemporaryFolder folder;
  Body box = shaped(Shape::kBox);
  box.size = Vec3(0.03, 0.02, 0.01);
  Body mesh = shaped(Shape::kMesh);
  mesh.mesh = folder.write("a.obj", obj_text(box_mesh(-box.size / 2, box.size / 2)));
  const Lattice a = make_lattice(box, 0.002, nullptr), b = make_lattice(mesh, 0.002, nullptr);
  EXPECT_LT((a.origin - b.origin).norm(), 1e-8);  // the file holds floats
  ASSERT_EQ(a.sites.size(), b.sites.size());
  for (std::size_t i = 0; i < a.sites.size(); ++i) {
    ASSERT_EQ(std::memcmp(&a.sites[i], &b.sites[i], 12), 0);
    ASSERT_NEAR(a.sites[i].volume, b.sites[i].volume, 1e-5 * a.sites[i].volume);
  }
}

TEST(Lattice, LeavesNotchesAndVoidsEmpty) {
  const TemporaryFolder folder;
  Body body = shaped(Shape::kMesh);
  body.mesh = folder.write("l.stl", stl_text(l_shape()));
  body.scale = 0.01;
  Lattice lattice = make_lattice(body, 0.001, nullptr);
  EXPECT_NEAR(volume_of(lattice), 3e-6, 1e-11);
  for (const Lattice::Site& s : lattice.sites) {
    const Vec3 p = place(lattice, s);
    ASSERT_FALSE(p.x() > 0.01 && p.y() > 0.01);
  }

  const Vec3 zero = Vec3::Zero();
  const TriangleMesh outer = icosphere(zero, 2, 3), inner = icosphere(zero, 1, 3);
  body.mesh = folder.write("void.stl", binary_stl(both(outer, inverted(inner))));
  lattice = make_lattice(body, 0.002, nullptr);
  const double expected = 1e-6 * (signed_volume(outer) - signed_volume(inner));
  EXPECT_NEAR(volume_of(lattice) / expected, 1, 0.002);
  for (const Lattice::Site& s : lattice.sites) ASSERT_GT(place(lattice, s).norm(), 0.008);
}

TEST(Lattice, TakesTheUnionOfOverlappingParts) {
  const TemporaryFolder folder;
  Body body = shaped(Shape::kMesh);
  body.mesh = folder.write(
      "two.stl", stl_text(both(box_mesh(Vec3(0, 0, 0), Vec3(0.02, 0.02, 0.02)),
                               box_mesh(Vec3(0.01, 0.01, 0.01), Vec3(0.03, 0.03, 0.03)))));
  std::vector<std::string> notes;
  const Lattice lattice = make_lattice(body, 0.001, &notes);
  EXPECT_NEAR(volume_of(lattice), 15e-6, 1e-10);
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_NE(notes[0].find("2 separate parts"), std::string::npos);
}

TEST(Lattice, AlignedMeshesHaveNoStrayLines) {
  // Vertices and edges exactly where lattice lines would run.
  const TemporaryFolder folder;
  TriangleMesh mesh = icosphere(Vec3::Zero(), 1, 0);
  for (Vec3& v : mesh.vertices) v = (v * 16).array().round() / 16 * 0.02;
  Body body = shaped(Shape::kMesh);
  body.mesh = folder.write("a.obj", obj_text(mesh));
  for (double cell : {0.02 / 16, 0.02 / 8, 0.02 / 4}) {
    EXPECT_NEAR(volume_of(make_lattice(body, cell, nullptr)) / signed_volume(mesh), 1, 0.01)
        << cell;
  }
}

TEST(Lattice, GivesTheVolumeOfDroppedPointsToTheOthers) {
  Body body = shaped(Shape::kBox);
  body.size = Vec3(0.01002, 0.01, 0.01);  // the last layer along x would be a fiftieth thick
  const Lattice lattice = make_lattice(body, 0.002, nullptr);
  EXPECT_EQ(lattice.sites.size(), 1000u);
  EXPECT_NEAR(volume_of(lattice), body.size.prod(), 1e-12);
  for (const Lattice::Site& s : lattice.sites) ASSERT_GE(s.volume, 1e-9 / 32);
}

TEST(Lattice, HasTheSameBitsForAnyNumberOfThreads) {
  const TemporaryFolder folder;
  Body body = shaped(Shape::kMesh);
  body.mesh = folder.write("a.stl", binary_stl(icosphere(Vec3::Zero(), 0.03, 3)));
  body.pose.orientation = tilted();
  const auto run = [&](int threads) {
    Lattice lattice;
    tbb::task_arena arena(threads);
    arena.execute([&] { lattice = make_lattice(body, 0.002, nullptr); });
    return lattice;
  };
  const Lattice a = run(1), b = run(2);
  ASSERT_EQ(a.sites.size(), b.sites.size());
  EXPECT_EQ(std::memcmp(a.sites.data(), b.sites.data(), a.sites.size() * sizeof(Lattice::Site)), 0);
}

TEST(Lattice, RefusesWhatHasNoOrTooManyPoints) {
  Body body = shaped(Shape::kBox);
  body.name = "sheet";
  body.size = Vec3(0.1, 0.1, 1e-4);
  std::string reason = reason_of([&] { make_lattice(body, 0.01, nullptr); });
  EXPECT_EQ(reason,
            "body 'sheet': no points at cell_size 0.01 m (it measures 0.1 x 0.1 x 0.0001 m): lower "
            "cell_size");
  body.size = Vec3(0.1, 0.1, 0.1);
  reason = reason_of([&] { make_lattice(body, 0.01, nullptr, 7999); });
  EXPECT_EQ(
      reason,
      "body 'sheet': it takes more than 7999 points at cell_size 0.01 m (it measures 0.1 x 0.1 "
      "x 0.1 m): raise cell_size");
  EXPECT_NO_THROW(make_lattice(body, 0.01, nullptr, 8000));
  EXPECT_NE(reason_of([&] { make_lattice(body, 1e-5, nullptr); }).find("more than 200000000"),
            std::string::npos);
}

TEST(Lattice, SaysThatAMeshInAnotherUnitIsNoMatterOfCellSize) {
  const TemporaryFolder folder;
  Body body = shaped(Shape::kMesh);
  body.mesh = folder.write("a.stl", stl_text(box_mesh(Vec3(0, 0, 0), Vec3(6.5, 6, 5))));
  const std::string reason = reason_of([&] { make_lattice(body, 0.003, nullptr); });
  EXPECT_NE(reason.find("did you forget scale: 0.01? Else raise cell_size"), std::string::npos)
      << reason;
}

TEST(Lattice, WarnsOfABodyWithFewerThanTwoPointsAcross) {
  const auto note = [](Body body, double cell_size) {
    std::vector<std::string> notes;
    make_lattice(body, cell_size, &notes);
    return notes.empty() ? "" : notes.back();
  };
  Body sheet = shaped(Shape::kBox);
  for (int axis = 0; axis < 3; ++axis) {
    sheet.size = Vec3(0.06, 0.042, 0.03);
    sheet.size[axis] = 0.0012;
    const std::string said = note(sheet, 0.003);
    EXPECT_EQ(said, std::string("body 'tissue': has fewer than two points across (0.8 along ") +
                        "xyz"[axis] +
                        " on the mean, 1.2 mm thick, at cell_size 0.003 m): it hardly resists "
                        "bending; lower cell_size to 0.0012");
    EXPECT_EQ(note(sheet, 0.0012), "") << "what it says to do";
  }
  sheet.pose.orientation = tilted();  // fewer than two points, whatever its slant
  EXPECT_NE(note(sheet, 0.003), "");
  Body ball = shaped(Shape::kBall);
  ball.radius = 0.002;
  EXPECT_NE(note(ball, 0.004), "") << "eight points that are not full";
  EXPECT_EQ(note(ball, 0.002), "") << "four across";
  EXPECT_EQ(note(shaped(Shape::kBall), 0.003), "");
  Body plate = shaped(Shape::kCylinder);
  plate.height = 0.0031;
  EXPECT_EQ(note(plate, 0.003), "");
}

}  // namespace
}  // namespace tissue_sim
