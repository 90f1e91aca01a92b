// What cameras see: depth against analytic rays and brute force, labels, bits, and what is refused.
#include "tissue_sim/renderer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <map>
#include <set>
#include <vector>

#include "support/cut_paths.h"
#include "support/temporary_folder.h"
#include "support/test_scenes.h"
#include "tools/tool_shapes.h"

namespace tissue_sim {
namespace {

/// Looks straight down from `height` above the origin.
Camera from_above(double height, int width = 96, int rows = 64) {
  Camera camera;
  camera.width = width;
  camera.height = rows;
  camera.pose.position = Vec3(0, 0, height);
  camera.pose.orientation = Quat(0, 1, 0, 0);  // z down, y back
  return camera;
}

Scene scene_of(std::vector<Tool> tools = {}) {
  Scene scene;
  scene.method = Method::kPbd;
  scene.gravity = Vec3::Zero();
  scene.cell_size = 0.006;
  scene.bodies.resize(1);
  scene.bodies[0].size = Vec3(0.04, 0.03, 0.02);
  scene.bodies[0].pose.position = Vec3(0, 0, 0.01);
  scene.tools = std::move(tools);
  return scene;
}

CameraImages seen(Simulation& simulation, const Camera& camera) {
  Renderer renderer(simulation.scene(), 2);
  SceneView view;
  read_view(simulation, view);
  renderer.show(view);
  CameraImages images;
  renderer.render(camera, camera.pose, images);
  return images;
}

/// Of the pixel's middle, in world axes, of depth 1.
Vec3 ray(const Camera& camera, int x, int y) {
  const double f = camera.focal_length();
  return camera.pose.orientation *
         Vec3((x - 0.5 * (camera.width - 1)) / f, (y - 0.5 * (camera.height - 1)) / f, 1);
}

/// Depth of the nearest triangle by trying all, infinite for none.
double nearest_by_all(const SurfaceTriangles& surface, const Vec3& eye, const Vec3& along) {
  double nearest = INFINITY;
  for (std::size_t t = 0; t < surface.fragment.size(); ++t) {
    Vec3 x[3];
    for (int c = 0; c < 3; ++c) {
      for (int a = 0; a < 3; ++a) x[c][a] = surface.corners[9 * t + 3 * c + a];
    }
    const Vec3 a = x[1] - x[0], b = x[2] - x[0], p = along.cross(b);
    const double det = a.dot(p);
    if (std::fabs(det) < 1e-300) continue;
    const Vec3 s = eye - x[0], q = s.cross(a);
    const double u = s.dot(p) / det, v = along.dot(q) / det, d = b.dot(q) / det;
    if (u >= -1e-9 && v >= -1e-9 && u + v <= 1 + 1e-9 && d > 0) nearest = std::min(nearest, d);
  }
  return nearest;
}

class Renders : public testing::Test {
 protected:
  void SetUp() override {
    if (!can_render()) GTEST_SKIP() << "built without Embree";
  }
};

TEST_F(Renders, DepthOfTissueIsThatOfTheNearestOfAllTriangles) {
  for (const Method method : {Method::kMpm, Method::kMls, Method::kPbd}) {
    Scene scene = scene_of();
    scene.method = method;
    scene.bodies[0].shape = Shape::kEllipsoid;
    scene.bodies[0].radii = Vec3(0.02, 0.015, 0.01);
    scene.ground.enabled = false;
    Simulation simulation(scene);
    SurfaceTriangles surface;
    simulation.tissue().read_surface(surface);
    Camera camera = from_above(0.06);
    camera.pose.orientation = Quat(Eigen::AngleAxisd(0.2, Vec3::UnitX())) * camera.pose.orientation;
    const CameraImages images = seen(simulation, camera);
    int hit = 0, edges = 0;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const double right = nearest_by_all(surface, camera.pose.position, ray(camera, x, y));
        const float depth = images.depth[y * camera.width + x];
        if (std::isfinite(right) != std::isfinite(depth)) {
          ++edges;
          continue;
        }
        if (!std::isfinite(right)) continue;
        ++hit;
        ASSERT_NEAR(depth, right, 1e-5 * right) << x << ", " << y;
      }
    }
    EXPECT_GT(hit, 1000);
    EXPECT_LE(edges, 4);
  }
}

/// What a pixel sees is the piece that the nearest point of the cloud belongs to.
TEST_F(Renders, LabelsAreThePiecesOfTheCloud) {
  for (const Method method : {Method::kMpm, Method::kMls, Method::kPbd}) {
    Scene scene = scene_of();
    scene.method = method;
    scene.cell_size = 0.003;
    Simulation simulation(scene);
    const Vec3 through(0.003, 0, 0.01), normal = Vec3(1, 0.2, 0).normalized();
    simulation.cut(plane_cut(through, normal));
    simulation.advance_frame();
    std::vector<std::uint8_t> cloud;
    const int count = simulation.tissue().read_points(PointSelection(), cloud);
    const Camera camera = from_above(0.07);
    const CameraImages images = seen(simulation, camera);
    std::set<int> pieces;
    int tissue = 0, other = 0;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const int i = y * camera.width + x, label = images.labels[i];
        if (label < kFirstFragmentLabel) continue;
        const Vec3 at = camera.pose.position + images.depth[i] * ray(camera, x, y);
        double nearest = INFINITY;
        int fragment = -1;
        for (int p = 0; p < count; ++p) {
          Point point;
          std::memcpy(&point, cloud.data() + sizeof(Point) * p, sizeof(Point));
          const double d = (Vec3(point.x, point.y, point.z) - at).squaredNorm();
          if (d < nearest) nearest = d, fragment = point.fragment;
        }
        pieces.insert(label);
        if (std::fabs((at - through).dot(normal)) < scene.cell_size)
          continue;  // either may be nearer
        ++tissue;
        other += label != kFirstFragmentLabel + fragment ? 1 : 0;
      }
    }
    EXPECT_EQ(pieces.size(), 2u);
    EXPECT_GT(tissue, 1000);
    EXPECT_EQ(other, 0);
  }
}

TEST_F(Renders, StressIsDarkFarBelowTheScalesEndAndWhiteAboveIt) {
  Scene scene = scene_of();
  scene.gravity = Vec3(0, 0, -10);
  Camera camera = from_above(0.07);
  camera.colours = CameraColours::kStress;
  camera.light = false;
  scene.cameras = {camera};
  Simulation simulation(scene);
  simulation.settle();
  const std::size_t middle = 3 * (32 * 96 + 48);
  camera.stress_end = 1e9;
  CameraImages images = seen(simulation, camera);
  EXPECT_LT(images.rgb[middle + 1], 60);
  camera.stress_end = 1;
  images = seen(simulation, camera);
  EXPECT_GT(images.rgb[middle + 1], 200);
}

TEST_F(Renders, DepthOfTheGroundIsExact) {
  Scene scene = scene_of();
  Simulation simulation(scene);
  const Camera camera = from_above(0.25);
  const CameraImages images = seen(simulation, camera);
  EXPECT_NEAR(images.depth[0], 0.25, 1e-5 * 0.25);
  EXPECT_EQ(images.labels[0], kGroundLabel);
  const std::size_t middle = 32 * 96 + 48;
  EXPECT_NEAR(images.depth[middle], 0.23, 1e-3);
  EXPECT_EQ(images.labels[middle], kFirstFragmentLabel);
  EXPECT_EQ(images.inside_out, 0);
}

TEST_F(Renders, DepthOfABallIsThatOfItsEquation) {
  Tool ball;
  ball.name = "ball";
  ball.type = ToolType::kBall;
  ball.radius = 0.008;
  Scene scene = scene_of({ball});
  Simulation simulation(scene);
  const Vec3 tip(0.002, 0.001, 0.05);
  simulation.set_tool(0, {tip, Quat(0, 1, 0, 0)});  // its shaft, and so its middle, above the tip
  simulation.advance_frame();
  const Camera camera = from_above(0.12);
  const CameraImages images = seen(simulation, camera);
  const Vec3 centre = tip + Vec3(0, 0, ball.radius);
  int hit = 0;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      if (images.labels[y * camera.width + x] != kFirstToolLabel) continue;
      const Vec3 d = ray(camera, x, y), o = camera.pose.position - centre;
      const double b = o.dot(d), root = b * b - d.squaredNorm() * (o.squaredNorm() - 0.008 * 0.008);
      ASSERT_GE(root, -1e-12);
      const double right = (-b - std::sqrt(std::max(0.0, root))) / d.squaredNorm();
      EXPECT_NEAR(images.depth[y * camera.width + x], right, 1e-5 * right);
      ++hit;
    }
  }
  EXPECT_GT(hit, 50);
}

TEST_F(Renders, TheSameViewHasTheSameBitsWithAnyThreads) {
  Simulation simulation(scene_of());
  SceneView view;
  read_view(simulation, view);
  CameraImages one, more;
  for (const int threads : {1, 3}) {
    Renderer renderer(simulation.scene(), threads);
    renderer.show(view);
    Camera camera = from_above(0.1);
    camera.distortion = {-0.2, 0.05, 0.001, -0.002, 0};
    renderer.render(camera, camera.pose, threads == 1 ? one : more);
  }
  EXPECT_EQ(one.rgb, more.rgb);
  EXPECT_EQ(one.labels, more.labels);
  ASSERT_EQ(one.depth.size(), more.depth.size());
  EXPECT_EQ(std::memcmp(one.depth.data(), more.depth.data(), 4 * one.depth.size()), 0);
}

TEST_F(Renders, ColoursHaveTheSameBitsWithAnyInstructions) {
  Simulation simulation(scene_of());
  const Camera camera = from_above(0.06, 61);
  ASSERT_EQ(setenv("TISSUE_SIM_INSTRUCTION_SET", "sse2", 1), 0);
  const CameraImages least = seen(simulation, camera);
  unsetenv("TISSUE_SIM_INSTRUCTION_SET");
  EXPECT_EQ(least.rgb, seen(simulation, camera).rgb);
}

/// Of the place that a pixel sees, in pixels of another look.
Eigen::Vector2d pixel_of(const Camera& camera, const Pose& eye, const Vec3& place) {
  const Vec3 x = eye.orientation.conjugate() * (place - eye.position);
  return camera.focal_length() * Eigen::Vector2d(x.x(), x.y()) / x.z() +
         0.5 * Eigen::Vector2d(camera.width - 1, camera.height - 1);
}

/// A camera that moves and turns sees tissue that moves and is cut, the ground and a tool: each
/// pixel's point is found in the last image by its rest place.
TEST_F(Renders, FlowIsTheWayOfEachPixelsPointSinceTheLastImage) {
  for (const Method method : {Method::kMpm, Method::kMls, Method::kPbd}) {
    Tool ball;
    ball.type = ToolType::kBall;
    ball.radius = 0.004;
    Scene scene = scene_of({ball});
    scene.method = method;
    scene.gravity = Vec3(0, 0, -9.81);
    scene.bodies[0].pose.position.z() = 0.03;  // falls
    Simulation simulation(scene);
    Renderer renderer(scene, 2);
    const Camera camera = from_above(0.12);
    Pose eyes[2] = {camera.pose, camera.pose};
    eyes[1].position += Vec3(0.003, -0.002, 0.004);
    eyes[1].orientation = eyes[1].orientation * Quat(Eigen::AngleAxisd(0.1, Vec3::UnitZ()));
    FrameRequest request;
    request.tools = {ToolRequest()};
    SceneView views[2];
    CameraImages images;
    LastLook last;
    Pose tips[2];
    for (int k = 0; k < 2; ++k) {
      tips[k].position = Vec3(0.03, 0.005 * k, 0.05);
      tips[k].orientation = Quat(Eigen::AngleAxisd(0.3 * k, Vec3::UnitX()));
      request.tools[0]->pose = tips[k];
      request.cuts.clear();
      if (k == 1) request.cuts = {plane_cut(Vec3(0, 0, 0.03), Vec3(1, 0.2, 0))};
      for (int frame = 0; frame < (k == 0 ? 1 : 2); ++frame) simulation.advance_frame(request);
      read_view(simulation, views[k]);
      renderer.show(views[k]);
      renderer.render(camera, eyes[k], images, &last);
      if (k == 1) break;
      EXPECT_EQ(images.flow.size(), 2u * camera.width * camera.height);
      for (const float f : images.flow) EXPECT_TRUE(std::isnan(f)) << "of the first image";
    }
    // Which of the first view's triangles has these corners at rest.
    std::map<std::vector<float>, std::size_t> first;
    const auto at_rest = [](const SurfaceTriangles& s, std::size_t t) {
      return std::vector<float>(&s.rest[9 * t], &s.rest[9 * t] + 9);
    };
    for (std::size_t t = 0; t < views[0].surface.fragment.size(); ++t) {
      first[at_rest(views[0].surface, t)] = t;
    }
    int checked = 0, opened = 0, of_ground = 0, of_tool = 0;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const int i = y * camera.width + x;
        if (images.labels[i] == kNoLabel) continue;
        const Vec3 along =
            eyes[1].orientation * (camera.pose.orientation.conjugate() * ray(camera, x, y));
        const Vec3 place = eyes[1].position + images.depth[i] * along;
        Vec3 before = place;
        if (images.labels[i] == kFirstToolLabel) {
          ++of_tool;
          before = tips[0] * (tips[1].orientation.conjugate() * (place - tips[1].position));
        } else if (images.labels[i] == kGroundLabel) {
          ++of_ground;
        } else {
          const SurfaceTriangles& s = views[1].surface;
          double nearest = INFINITY;
          std::size_t hit = 0;
          Vec3 weights = Vec3::Zero();
          for (std::size_t t = 0; t < s.fragment.size(); ++t) {
            Eigen::Matrix3d c;
            for (int k = 0; k < 9; ++k) c(k % 3, k / 3) = s.corners[9 * t + k] - place[k % 3];
            const Vec3 normal = (c.col(1) - c.col(0)).cross(c.col(2) - c.col(0));
            const double off = std::fabs(normal.normalized().dot(c.col(0)));
            Vec3 w;
            for (int k = 0; k < 3; ++k) {
              w[k] =
                  c.col((k + 1) % 3).cross(c.col((k + 2) % 3)).dot(normal) / normal.squaredNorm();
            }
            if (w.minCoeff() < -1e-4 || off > nearest) continue;
            nearest = off, hit = t, weights = w;
          }
          const auto found = first.find(at_rest(s, hit));
          if (found == first.end()) {
            opened += std::isnan(images.flow[2 * i]);
            continue;
          }
          before.setZero();
          for (int k = 0; k < 9; ++k) {
            before[k % 3] += weights[k / 3] * views[0].surface.corners[9 * found->second + k];
          }
        }
        ++checked;
        const Eigen::Vector2d moved = Eigen::Vector2d(x, y) - pixel_of(camera, eyes[0], before);
        ASSERT_NEAR(images.flow[2 * i], moved.x(), 0.1) << x << ", " << y;
        ASSERT_NEAR(images.flow[2 * i + 1], moved.y(), 0.1) << x << ", " << y;
      }
    }
    EXPECT_GT(checked, 5000);
    EXPECT_GT(of_ground, 100);
    EXPECT_GT(of_tool, 20);
    EXPECT_GT(opened, 0) << "what the cut opened was not there";
  }
}

/// A box as a text STL in millimetres, its face at z = 0.
std::string box_stl(const Vec3& size) {
  std::string text = "solid box\n";
  for (int axis = 0; axis < 3; ++axis) {
    for (const int side : {-1, 1}) {
      const int b = (axis + (side > 0 ? 1 : 2)) % 3, c = 3 - axis - b;
      const double square[6][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, -1}, {1, 1}, {-1, 1}};
      for (int i = 0; i < 6; ++i) {
        Vec3 x = Vec3::Constant(side);
        x[b] = square[i][0], x[c] = square[i][1];
        x = 500 * x.cwiseProduct(size) - Vec3(0, 0, 500 * size.z());
        text += i % 3 == 0 ? "facet normal 0 0 0\nouter loop\n" : "";
        text += "vertex " + std::to_string(x.x()) + " " + std::to_string(x.y()) + " " +
                std::to_string(x.z()) + "\n";
        text += i % 3 == 2 ? "endloop\nendfacet\n" : "";
      }
    }
  }
  return text + "endsolid box\n";
}

TEST_F(Renders, AToolsMeshInPlaceOfItsShapes) {
  const TemporaryFolder folder;
  Tool plate;
  plate.type = ToolType::kPlate;
  plate.size = Vec3(0.02, 0.01, 0.004);
  plate.edge_radius = 0.001;
  const std::string path = folder.write("plate.stl", box_stl(plate.size));
  FrameRequest request;
  request.tools = {ToolRequest()};
  request.tools[0]->pose.position = Vec3(0.004, 0, 0.04);
  request.tools[0]->pose.orientation =
      Quat(Eigen::AngleAxisd(0.4, Vec3(0.5, 0.7, 0.2).normalized()));
  CameraImages images[2];
  for (const int k : {0, 1}) {
    if (k == 1) plate.mesh = path, plate.scale = 0.001;
    Simulation simulation(scene_of({plate}));
    simulation.advance_frame(request);
    images[k] = seen(simulation, from_above(0.1));
  }
  int of_tool = 0, others = 0;
  for (std::size_t i = 0; i < images[0].labels.size(); ++i) {
    of_tool += images[1].labels[i] == kFirstToolLabel;
    if (images[0].labels[i] != images[1].labels[i]) {
      ++others;
      continue;
    }
    EXPECT_NEAR(images[0].depth[i], images[1].depth[i], 1e-6);
  }
  EXPECT_GT(of_tool, 300);
  EXPECT_LE(others, 2) << "at edges";

  plate.mesh = folder.path() + "/missing.stl";
  try {
    Renderer(scene_of({plate}), 1);
    ADD_FAILURE() << "a mesh that is missing";
  } catch (const std::invalid_argument& e) {
    EXPECT_NE(std::string(e.what()).find("missing.stl"), std::string::npos) << e.what();
  }
}

TEST_F(Renders, ACameraBehindTheGroundSeesItsUnderside) {
  Scene scene = scene_of();
  scene.bodies[0].pose.position.z() += 0.002;  // resting on it, either could be met first
  Simulation simulation(scene);
  Camera camera = from_above(-0.05);
  camera.pose.orientation = Quat::Identity();  // upwards
  const CameraImages images = seen(simulation, camera);
  for (std::size_t i = 0; i < images.labels.size(); ++i) {
    ASSERT_EQ(images.labels[i], kGroundLabel);
    ASSERT_NEAR(images.depth[i], 0.05, 1e-6);
  }
}

TEST_F(Renders, ACameraWithinTissueSeesItsInside) {
  Simulation simulation(scene_of());
  Camera camera = from_above(0.01);
  EXPECT_GT(seen(simulation, camera).inside_out, 0.9);
}

TEST_F(Renders, RefusesAPoseThatIsNotFinite) {
  Simulation simulation(scene_of());
  Renderer renderer(simulation.scene(), 1);
  CameraImages images;
  Camera camera = from_above(0.1);
  Pose pose;
  pose.position.x() = NAN;
  EXPECT_THROW(renderer.render(camera, pose, images), std::invalid_argument);
}

TEST(Cameras, AreRefusedOutOfRange) {
  const auto refused = [](const std::string& fields) {
    try {
      scene_from_yaml("bodies: [{}]\ncameras: [{" + fields + "}]\n");
    } catch (const std::invalid_argument& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  EXPECT_EQ(refused("name: eye"), "");
  EXPECT_NE(refused("width: 0").find("cameras[0].width is 0"), std::string::npos);
  EXPECT_NE(refused("height: 20000").find("cameras[0].height is 20000"), std::string::npos);
  EXPECT_NE(refused("near: 1, far: 0.5").find("cameras[0].far is 0.5"), std::string::npos);
  EXPECT_NE(refused("depth: inches").find("cameras[0].depth is inches"), std::string::npos);
  EXPECT_NE(refused("hfov: .nan").find("cameras[0].hfov is .nan"), std::string::npos);
  EXPECT_NE(refused("distortion: [1, 2]").find("must be 5 numbers"), std::string::npos);
}

TEST(Cameras, ComeBackFromYaml) {
  Scene scene = scene_of();
  Camera camera = from_above(0.1);
  camera.name = "eye";
  camera.baseline = 0.005;
  camera.colours = CameraColours::kFragments;
  camera.distortion = {-0.2, 0.05, 0.001, -0.002, 0};
  camera.depth = DepthUnit::kMillimetres;
  camera.flow = true;
  scene.cameras = {camera};
  const std::string text = scene_to_yaml(scene);
  EXPECT_EQ(scene_to_yaml(scene_from_yaml(text)), text);
}

/// Rays from all around that meet a shape do so on its surface, and those that miss it nowhere do.
TEST(ToolShapes, AreMetOnTheirSurface) {
  Tool tool;
  ToolMotion motion;
  motion.end.orientation = Quat(0.5, 0.5, -0.5, 0.5);
  motion.end.position = Vec3(0.01, 0.02, 0.03);
  for (const ToolType type :
       {ToolType::kScalpel, ToolType::kProbe, ToolType::kBall, ToolType::kPunch, ToolType::kPlate,
        ToolType::kGrasper, ToolType::kScissors}) {
    tool.type = type;
    for (const ToolShape& shape : tool_shapes(tool, motion)) {
      int met = 0;
      for (int i = 0; i < 400; ++i) {
        const Vec3 eye =
            shape.pose.position + 0.3 * Vec3(std::sin(i), std::cos(1.7 * i), std::sin(2.3 * i));
        const Vec3 aim =
            shape.pose * (0.45 * shape.size.cwiseProduct(Vec3(std::sin(3.1 * i), std::cos(5.3 * i),
                                                              std::sin(7.7 * i))));
        double t;
        Vec3 normal;
        if (!meet(shape, eye, aim - eye, 0, 10, t, normal)) continue;
        ++met;
        const Vec3 at =
            shape.pose.orientation.conjugate() * (eye + t * (aim - eye) - shape.pose.position);
        const Vec3 half = 0.5 * shape.size;
        double off = 0;
        if (shape.kind == ToolShape::kBox) {
          off = (at.cwiseAbs() - half).maxCoeff();
        } else if (shape.kind == ToolShape::kBall) {
          off = at.norm() - half.x();
        } else {
          off = std::max(at.head<2>().norm() - half.x(), std::fabs(at.z()) - half.z());
        }
        EXPECT_NEAR(off, 0, 1e-9);
        EXPECT_LT(normal.dot(aim - eye), 0);
        EXPECT_NEAR(normal.norm(), 1, 1e-9);
      }
      EXPECT_GT(met, 150);
    }
  }
}

}  // namespace
}  // namespace tissue_sim
