// A scene's checks, its YAML form and the built-in materials.
#include "tissue_sim/scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>

#include "temporary_folder.h"

namespace tissue_sim {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

// One of everything.
Scene full_scene() {
  Scene s;
  s.materials.resize(2);
  s.materials[0].name = "phantom";
  s.materials[1].name = "stiff phantom: \"b\"";
  s.materials[1].law = Law::kNeoHookean;
  s.materials[1].young_modulus = 1.0 / 3 * 1e5;
  s.materials[1].viscosity = 0.1 + 0.2;
  s.bodies.resize(5);
  const Shape shapes[] = {Shape::kBox, Shape::kBall, Shape::kEllipsoid, Shape::kCylinder,
                          Shape::kMesh};
  for (int i = 0; i < 5; ++i) {
    s.bodies[i].name = "body" + std::to_string(i);
    s.bodies[i].shape = shapes[i];
  }
  s.bodies[0].material = s.materials[1].name;
  s.bodies[0].size = Vec3(0.1, 1.0 / 7, 0.03);
  s.bodies[0].pose.position = Vec3(-0.1, 1e-17, 3);
  s.bodies[0].pose.orientation = Quat(0.3, -0.2, 0.7, 0.5).normalized();
  s.bodies[0].anchors.resize(3);
  s.bodies[0].anchors[0].z = -0.01;
  s.bodies[0].anchors[1].kind = Region::Kind::kBox;
  s.bodies[0].anchors[1].min = Vec3(-1, -2, -3);
  s.bodies[0].anchors[1].max = Vec3(1, 2, 0.1);
  s.bodies[0].anchors[2].kind = Region::Kind::kBall;
  s.bodies[0].anchors[2].center = Vec3(0.1, 0.2, 0.3);
  s.bodies[0].anchors[2].radius = 0.05;
  s.bodies[4].mesh = "package://some pack/kidney #1.stl";
  s.bodies[4].scale = 0.001;
  s.tools.resize(2);
  s.tools[0].name = "PSM1";
  s.tools[0].type = ToolType::kScalpel;
  s.tools[0].blade_width = 0.007;
  s.tools[1].name = "probe_2";
  s.tools[1].radius = 0.002;
  s.seed = 18446744073709551615ull;
  s.threads = 3;
  s.device = Device::kCuda;
  s.ground.enabled = false;
  s.ground.z = -0.5;
  return s;
}

std::string reason_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "nothing was thrown";
}

std::string reason_of_yaml(const std::string& yaml) {
  return reason_of([&] { scene_from_yaml(yaml); });
}

// A list of each numeric field with its range; the ends are allowed, beyond them is refused.
struct NumberCase {
  const char* field;
  std::function<double&(Scene&)> value;
  double low, high;
};

const std::vector<NumberCase>& number_cases() {
#define AT(expression) [](Scene& s) -> double& { return s.expression; }
  static const std::vector<NumberCase> cases = {
      {"cell_size", AT(cell_size), 1e-5, 1},
      {"frame_rate", AT(frame_rate), 1, 2000},
      {"cfl", AT(cfl), 0.05, 0.9},
      {"damping", AT(damping), 0, 1000},
      {"gravity", AT(gravity.y()), -1000, 1000},
      {"ground.z", AT(ground.z), -100, 100},
      {"ground.friction", AT(ground.friction), 0, 2},
      {"materials[1].young_modulus", AT(materials[1].young_modulus), 1e-300, 1e8},
      {"materials[1].poisson_ratio", AT(materials[1].poisson_ratio), 0, 0.49},
      {"materials[1].density", AT(materials[1].density), 100, 20000},
      {"materials[1].viscosity", AT(materials[1].viscosity), 0, 1000},
      {"materials[1].friction", AT(materials[1].friction), 0, 2},
      {"bodies[0].size", AT(bodies[0].size.z()), 1e-4, 10},
      {"bodies[1].radius", AT(bodies[1].radius), 1e-4, 10},
      {"bodies[2].radii", AT(bodies[2].radii.x()), 1e-4, 10},
      {"bodies[3].radius", AT(bodies[3].radius), 1e-4, 10},
      {"bodies[3].height", AT(bodies[3].height), 1e-4, 10},
      {"bodies[4].scale", AT(bodies[4].scale), 1e-6, 1e3},
      {"bodies[2].pose.position", AT(bodies[2].pose.position.x()), -100, 100},
      {"bodies[0].anchors[0].below", AT(bodies[0].anchors[0].z), -100, 100},
      {"bodies[0].anchors[1].box.min", AT(bodies[0].anchors[1].min.x()), -100, 0.999},
      {"bodies[0].anchors[1].box.max", AT(bodies[0].anchors[1].max.x()), -0.999, 100},
      {"bodies[0].anchors[2].ball.center", AT(bodies[0].anchors[2].center.z()), -100, 100},
      {"bodies[0].anchors[2].ball.radius", AT(bodies[0].anchors[2].radius), 1e-4, 100},
      {"tools[0].blade_length", AT(tools[0].blade_length), 1e-3, 0.2},
      {"tools[0].blade_width", AT(tools[0].blade_width), 2e-4, 0.1},
      {"tools[0].blade_thickness", AT(tools[0].blade_thickness), 1e-5, 0.01},
      {"tools[0].friction", AT(tools[0].friction), 0, 2},
      {"tools[1].radius", AT(tools[1].radius), 1e-4, 0.1},
      {"tools[1].length", AT(tools[1].length), 1e-3, 1},
  };
#undef AT
  return cases;
}

TEST(SceneValidate, AcceptsTheEndsOfEachRange) {
  for (const NumberCase& c : number_cases()) {
    for (double value : {c.low, c.high}) {
      Scene s = full_scene();
      c.value(s) = value;
      EXPECT_NO_THROW(validate(s)) << c.field << " " << value;
    }
  }
}

TEST(SceneValidate, NamesTheFieldThatIsOutOfRange) {
  for (const NumberCase& c : number_cases()) {
    const double beyond = 1.01 * std::abs(c.high), before = c.low - 0.01 * std::abs(c.low) - 1e-9;
    for (double value : {before, beyond, -kInf, kInf, kNan}) {
      Scene s = full_scene();
      c.value(s) = value;
      const std::string reason = reason_of([&] { validate(s); });
      // A box's corner may be what is wrong with the other one.
      const std::string field = std::string(c.field) == "bodies[0].anchors[1].box.min" &&
                                        reason.find("box.max") != std::string::npos
                                    ? "bodies[0].anchors[1].box.max"
                                    : c.field;
      EXPECT_EQ(reason.rfind(field + " is ", 0), 0u) << c.field << " " << value << ": " << reason;
      EXPECT_NE(reason.find(": "), std::string::npos) << reason;
    }
  }
}

TEST(SceneValidate, SaysWhatIsAllowed) {
  Scene s = full_scene();
  s.bodies[0].size = Vec3(0, 0.1, 0.1);
  EXPECT_EQ(reason_of([&] { validate(s); }),
            "bodies[0].size is [0, 0.1, 0.1]: each edge must lie between 0.0001 and 10 m");
  s = full_scene();
  s.cfl = kNan;
  EXPECT_EQ(reason_of([&] { validate(s); }), "cfl is .nan: must lie between 0.05 and 0.9");
}

TEST(SceneValidate, ChecksNamesListsAndReferences) {
  const std::vector<std::pair<std::string, std::function<void(Scene&)>>> cases = {
      {"name is \"\": ", [](Scene& s) { s.name.clear(); }},
      {"threads is -1: ", [](Scene& s) { s.threads = -1; }},
      {"threads is 1025: ", [](Scene& s) { s.threads = 1025; }},
      {"bodies is empty: ", [](Scene& s) { s.bodies.clear(); }},
      {"bodies[1].name is \"body0\": ", [](Scene& s) { s.bodies[1].name = "body0"; }},
      {"bodies[1].name is \"\": ", [](Scene& s) { s.bodies[1].name.clear(); }},
      {"bodies[1].material is \"wood\": ", [](Scene& s) { s.bodies[1].material = "wood"; }},
      {"bodies[4].mesh is \"\": ", [](Scene& s) { s.bodies[4].mesh.clear(); }},
      {"bodies[3].pose.orientation is [0, 0, 0, 1.01]: ",
       [](Scene& s) { s.bodies[3].pose.orientation.w() = 1.01; }},
      {"bodies[3].pose.orientation is [.nan, 0, 0, 1]: ",
       [](Scene& s) { s.bodies[3].pose.orientation.x() = kNan; }},
      {"bodies[0].anchors[1].box.max is [1, 2, -3]: ",
       [](Scene& s) { s.bodies[0].anchors[1].max.z() = -3; }},
      {"materials[1].name is \"phantom\": ", [](Scene& s) { s.materials[1].name = "phantom"; }},
      {"materials[0].name is \"\": ", [](Scene& s) { s.materials[0].name.clear(); }},
      {"materials[0].young_modulus is 0: ", [](Scene& s) { s.materials[0].young_modulus = 0; }},
      {"tools[1].name is \"PSM1\": ", [](Scene& s) { s.tools[1].name = "PSM1"; }},
      {"tools[0].name is \"\": ", [](Scene& s) { s.tools[0].name.clear(); }},
      {"tools[0].name is \"1a\": ", [](Scene& s) { s.tools[0].name = "1a"; }},
      {"tools[0].name is \"a/b\": ", [](Scene& s) { s.tools[0].name = "a/b"; }},
      {"tools[0].name is \"a b\": ", [](Scene& s) { s.tools[0].name = "a b"; }},
      {"bodies[0].shape is 77: ", [](Scene& s) { s.bodies[0].shape = static_cast<Shape>(77); }},
  };
  for (const auto& c : cases) {
    Scene s = full_scene();
    ASSERT_NO_THROW(validate(s));
    c.second(s);
    const std::string reason = reason_of([&] { validate(s); });
    EXPECT_EQ(reason.rfind(c.first, 0), 0u) << c.first << "\n" << reason;
  }
}

TEST(SceneYaml, ComesBackAsItWasWritten) {
  const Scene s = full_scene();
  const std::string yaml = scene_to_yaml(s);
  const Scene r = scene_from_yaml(yaml);
  EXPECT_EQ(scene_to_yaml(r), yaml);
  Scene copy = s, back = r;
  for (const NumberCase& c : number_cases()) EXPECT_EQ(c.value(copy), c.value(back)) << c.field;
  EXPECT_EQ(r.seed, s.seed);
  EXPECT_EQ(r.threads, 3);
  EXPECT_EQ(r.device, Device::kCuda);
  EXPECT_FALSE(r.ground.enabled);
  EXPECT_EQ(r.materials[1].law, Law::kNeoHookean);
  EXPECT_EQ(r.materials[1].name, s.materials[1].name);
  EXPECT_EQ(r.bodies[4].mesh, s.bodies[4].mesh);
  EXPECT_EQ(r.bodies[0].pose.orientation.coeffs(), s.bodies[0].pose.orientation.coeffs());
  EXPECT_EQ(r.bodies[0].pose.position, s.bodies[0].pose.position);
  EXPECT_EQ(r.bodies[0].size, s.bodies[0].size);
  EXPECT_EQ(r.bodies[0].anchors[1].kind, Region::Kind::kBox);
  EXPECT_EQ(r.bodies[0].anchors[1].min, s.bodies[0].anchors[1].min);
  EXPECT_EQ(r.tools[0].type, ToolType::kScalpel);
}

TEST(SceneYaml, KeepsTheBitsOfOrientations) {
  Scene s;
  s.bodies.resize(1);
  for (int i = 1; i <= 200; ++i) {
    Quat& q = s.bodies[0].pose.orientation;
    q = Quat(std::sin(i), std::cos(2 * i), std::sin(3 * i), std::cos(5 * i)).normalized();
    ASSERT_EQ(scene_from_yaml(scene_to_yaml(s)).bodies[0].pose.orientation.coeffs(), q.coeffs());
  }
}

TEST(SceneYaml, KeepsNamesThatLookLikeSomethingElse) {
  for (const char* name :
       {"null", "true", "12", "1e3", "~", "a: b", "# c", "- d", "\"q\"", " e "}) {
    Scene s = full_scene();
    s.name = name;
    EXPECT_EQ(scene_from_yaml(scene_to_yaml(s)).name, name);
  }
}

TEST(SceneYaml, WritesOnlyTheFieldsOfTheShape) {
  Scene s;
  s.bodies.resize(1);
  s.bodies[0].shape = Shape::kBall;
  const std::string yaml = scene_to_yaml(s);
  EXPECT_NE(yaml.find("radius"), std::string::npos);
  for (const char* field : {" size:", " height:", " mesh:", " scale:", " radii:"}) {
    EXPECT_EQ(yaml.find(field), std::string::npos) << field;
  }
}

TEST(SceneYaml, FillsInDefaults) {
  const Scene s = scene_from_yaml("bodies: [{}]");
  EXPECT_EQ(s.cell_size, 0.003);
  EXPECT_EQ(s.bodies.at(0).shape, Shape::kBox);
  EXPECT_EQ(s.bodies[0].material, "liver");
}

TEST(SceneYaml, ReadsOrientationsAsRosWritesThem) {
  const Scene s = scene_from_yaml(
      "bodies: [{pose: {orientation: [0, 0.0, 0.70711, 0.70711]}, anchors: [{below: 0.25}]}]");
  const Quat& q = s.bodies[0].pose.orientation;
  EXPECT_NEAR(q.norm(), 1, 1e-15);
  EXPECT_LT((q * Vec3::UnitX() - Vec3::UnitY()).norm(), 1e-4);
  EXPECT_EQ(s.bodies[0].anchors[0].kind, Region::Kind::kBelow);
  EXPECT_EQ(s.bodies[0].anchors[0].z, 0.25);
}

TEST(SceneYaml, NamesWhatItRefuses) {
  const std::pair<const char*, const char*> cases[] = {
      {"colour: red\nbodies: [{}]", "colour is red: unknown field, known here are name, method, "},
      {"bodies: [{colour: red}]", "bodies[0].colour is red: unknown field"},
      {"bodies: [{}]\ntools: [{size: 1}]", "tools[0].size is 1: unknown field"},
      {"bodies: [{}]\nground: {y: 1}", "ground.y is 1: unknown field"},
      {"bodies: [{pose: {xyz: [1, 2, 3]}}]", "bodies[0].pose.xyz is [1, 2, 3]: unknown field"},
      {"materials: [{name: a, young: 1}]", "materials[0].young is 1: unknown field"},
      {"materials: [{young_modulus: 1}]", "materials[0].name is missing: "},
      {"bodies: [{anchors: [{above: 1}]}]", "bodies[0].anchors[0].above is 1: unknown field"},
      {"bodies: [{anchors: [{}]}]", "bodies[0].anchors[0] is a map of 0 fields: must be one of"},
      {"bodies: [{anchors: [{below: 1, ball: {center: [0, 0, 0], radius: 1}}]}]",
       "bodies[0].anchors[0] is a map of 2 fields: must be one of"},
      {"bodies: [{anchors: [{ball: {center: [0, 0, 0]}}]}]",
       "bodies[0].anchors[0].ball.radius is missing: "},
      {"bodies: [{anchors: [{box: {min: [0, 0, 0]}}]}]",
       "bodies[0].anchors[0].box.max is missing: "},
      {"bodies: [{shape: ball, height: 0.1}]", "bodies[0].height is 0.1: a ball has no height"},
      {"bodies: [{shape: ellipsoid, size: [1, 1, 1]}]",
       "bodies[0].size is [1, 1, 1]: an ellipsoid has no size"},
      {"bodies: [{radius: 0.1}]", "bodies[0].radius is 0.1: a box has no radius"},
      {"bodies: [{shape: mesh, mesh: a.stl, radii: 1}]",
       "bodies[0].radii is 1: a mesh has no radii"},
      {"bodies: [{shape: cylinder, scale: 1}]", "bodies[0].scale is 1: a cylinder has no scale"},
      {"bodies: [{}]\ntools: [{type: scalpel, length: 1}]",
       "tools[0].length is 1: a scalpel has no length"},
      {"bodies: [{}]\ntools: [{blade_width: 1}]",
       "tools[0].blade_width is 1: a probe has no blade"},
      {"bodies: [{shape: cube}]", "bodies[0].shape is cube: must be one of box, ball, ellipsoid, "},
      {"device: gpu", "device is gpu: must be one of auto, cpu, cuda"},
      {"method: fem", "method is fem: must be one of mpm"},
      {"materials: [{name: a, law: hooke}]",
       "materials[0].law is hooke: must be one of fixed_corotated, neo_hookean"},
      {"tools: [{type: saw}]", "tools[0].type is saw: must be one of scalpel, probe"},
      {"cell_size: small", "cell_size is small: must be a number"},
      {"cell_size: 0,003", "cell_size is 0,003: must be a number"},
      {"cell_size: 3 mm", "cell_size is 3 mm: must be a number"},
      {"cell_size: \"0.003\"", "cell_size is \"0.003\": must be a number"},
      {"cell_size: [0.003]", "cell_size is [0.003]: must be a number"},
      {"cell_size:", "cell_size is empty: must be a number"},
      {"cfl: .nan\nbodies: [{}]", "cfl is .nan: must lie between 0.05 and 0.9"},
      {"frame_rate: .inf\nbodies: [{}]", "frame_rate is .inf: must lie between"},
      {"threads: 1.5", "threads is 1.5: must be a whole number"},
      {"threads: 99999999999", "threads is 99999999999: must be a whole number"},
      {"seed: -1", "seed is -1: must be a whole number between 0"},
      {"ground: {enabled: 1}", "ground.enabled is 1: must be true or false"},
      {"ground: 3", "ground is 3: must be a map of the fields enabled, z, friction"},
      {"gravity: -9.81", "gravity is -9.81: must be three numbers"},
      {"gravity: [0, 0]", "gravity is [0, 0]: must be three numbers"},
      {"gravity: [0, 0, down]", "gravity is [0, 0, down]: must be three numbers"},
      {"name: [a]", "name is [a]: must be a text"},
      {"bodies: 3", "bodies is 3: must be a list"},
      {"tools:", "tools is empty: must be a list"},
      {"bodies: [3]", "bodies[0] is 3: must be a map"},
      {"bodies: [{pose: {orientation: [0, 0, 0, 2]}}]",
       "bodies[0].pose.orientation is [0, 0, 0, 2]: must be a unit quaternion"},
      {"bodies: [{pose: {orientation: [0, 0, 1]}}]",
       "bodies[0].pose.orientation is [0, 0, 1]: must be four numbers"},
      {"bodies: [{shape: mesh}]", "bodies[0].mesh is \"\": must be the path"},
      {"bodies: [{size: [0, 0.1, 0.1]}]",
       "bodies[0].size is [0, 0.1, 0.1]: each edge must lie between 0.0001 and 10 m"},
      {"cfl: 0.5\ncfl: 0.6", "cfl is given twice"},
      {"name: a", "bodies is empty: a scene needs at least one body"},
      {"", "the scene is empty: must be a map"},
      {"- a", "the scene is [a]: must be a map"},
      {"a: [", "the scene is no valid YAML: "},
  };
  for (const auto& c : cases) {
    const std::string reason = reason_of_yaml(c.first);
    EXPECT_EQ(reason.rfind(c.second, 0), 0u) << c.first << "\n" << reason;
  }
}

TEST(LoadScene, PutsThePathInFront) {
  const TemporaryFolder folder;
  const std::string path = folder.write("scene.yaml", "cfl: 7\nbodies: [{}]");
  EXPECT_EQ(reason_of([&] { load_scene(path); }),
            path + ": cfl is 7: must lie between 0.05 and 0.9");
  EXPECT_EQ(reason_of([&] { load_scene(path + ".not"); }).rfind(path + ".not: no such file", 0),
            0u);
  EXPECT_EQ(reason_of([&] { load_scene(folder.path()); }).rfind(folder.path() + ": is a folder", 0),
            0u);
  EXPECT_NE(reason_of([&] { load_scene(folder.write("empty.yaml", "")); }).find("is empty"),
            std::string::npos);
}

TEST(LoadScene, TakesMeshPathsRelativeToTheFile) {
  const TemporaryFolder folder;
  const std::string path =
      folder.write("scene.yaml",
                   "bodies:\n- {name: a, shape: mesh, mesh: ./liver.stl}\n"
                   "- {name: b, shape: mesh, mesh: /x/liver.stl}\n"
                   "- {name: c, shape: mesh, mesh: 'package://p/liver.stl'}\n");
  const Scene s = load_scene(path);
  EXPECT_EQ(s.bodies[0].mesh, folder.path() + "/liver.stl");
  EXPECT_EQ(s.bodies[1].mesh, "/x/liver.stl");
  EXPECT_EQ(s.bodies[2].mesh, "package://p/liver.stl");
}

TEST(Region, HoldsWhatLiesInIt) {
  Region below, box, ball;
  below.z = 0.5;
  EXPECT_TRUE(below.contains(Vec3(9, 9, 0.4)));
  EXPECT_FALSE(below.contains(Vec3(0, 0, 0.5)));
  box.kind = Region::Kind::kBox;
  box.min = Vec3(0, 0, 0);
  box.max = Vec3(1, 2, 3);
  EXPECT_TRUE(box.contains(Vec3(0.5, 1.5, 2.5)));
  EXPECT_FALSE(box.contains(Vec3(1.5, 0.5, 0.5)));
  EXPECT_FALSE(box.contains(Vec3(0.5, 0.5, -0.1)));
  ball.kind = Region::Kind::kBall;
  ball.center = Vec3(1, 0, 0);
  ball.radius = 0.5;
  EXPECT_TRUE(ball.contains(Vec3(1.3, 0.3, 0)));
  EXPECT_FALSE(ball.contains(Vec3(1.4, 0.4, 0)));
}

TEST(Materials, PresetsAreValidAndComplete) {
  for (const char* name : {"liver", "kidney", "fat", "muscle", "skin", "vessel", "gelatine"}) {
    Scene s;
    s.bodies.resize(1);
    s.materials = {find_material(Scene(), name)};  // so that its values are checked too
    s.bodies[0].material = name;
    EXPECT_EQ(s.materials[0].name, name);
    EXPECT_NO_THROW(validate(s)) << name;
  }
  EXPECT_EQ(material_presets().size(), 7u);
}

TEST(Materials, TheScenesOwnWinAndUnknownOnesAreRefused) {
  Scene s;
  s.materials.resize(1);
  s.materials[0].young_modulus = 1234;  // named liver
  EXPECT_EQ(find_material(s, "liver").young_modulus, 1234);
  EXPECT_EQ(find_material(s, "fat").young_modulus, 3250);
  EXPECT_EQ(reason_of([&] { find_material(s, "wood"); }),
            "material is \"wood\": must be one of fat, gelatine, kidney, liver, muscle, skin, "
            "vessel");
}

TEST(Materials, LameParametersAndWaveSpeed) {
  Material m;
  m.young_modulus = 2600;
  m.poisson_ratio = 0.3;
  m.density = 1400;
  EXPECT_NEAR(lame_mu(m), 1000, 1e-9);
  EXPECT_NEAR(lame_lambda(m), 1500, 1e-9);
  EXPECT_NEAR(wave_speed(m), std::sqrt(2.5), 1e-12);
}

}  // namespace
}  // namespace tissue_sim
