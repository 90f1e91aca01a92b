// A scene's YAML form: read, written, refused.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "support/temporary_folder.h"
#include "support/test_scenes.h"
#include "tissue_sim/scene.h"

namespace tissue_sim {
namespace {

std::string reason_of_yaml(const std::string& yaml) {
  return reason_of([&] { scene_from_yaml(yaml); });
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
  for (const char* name : {"null", "true", "12", "1e3", "~", "a: b", "# c", "- d", "\"q\"", " e ",
                           "[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[["}) {
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

TEST(SceneYaml, TakesToughnessAsItWasMeasured) {
  const auto toughness = [](const std::string& material) {
    return scene_from_yaml("bodies: [{}]\nmaterials: [{" + material + "}]").materials[0].toughness;
  };
  EXPECT_EQ(toughness("name: liver"), 0);
  EXPECT_EQ(toughness("name: liver, toughness: measured"), 206);
  EXPECT_EQ(toughness("name: liver, toughness: 12"), 12);
}

// What tissue bears comes of its toughness and of the method's cells, and is written as it came.
TEST(SceneYaml, WorksOutWhereTissueTearsFromItsToughness) {
  const auto read = [](const std::string& options) {
    return scene_from_yaml(options +
                           "\nbodies: [{}]\nmaterials: [{name: gel, young_modulus: 1e5, " +
                           "toughness: 100, tear: measured}]");
  };
  const Scene fine = read("cell_size: 0.001"), coarse = read("cell_size: 0.004");
  EXPECT_GT(fine.materials[0].tear_stretch, 1.2 * coarse.materials[0].tear_stretch);
  EXPECT_DOUBLE_EQ(coarse.materials[0].tear_length, 0.002);
  const Scene meshless = read("method: mls\nmls: {spacing: 0.002}");
  EXPECT_GT(meshless.materials[0].tear_stretch, coarse.materials[0].tear_stretch);
  EXPECT_EQ(meshless.materials[0].tear_length, 0);
  const Scene again = scene_from_yaml(scene_to_yaml(fine));
  EXPECT_EQ(again.materials[0].tear_stretch, fine.materials[0].tear_stretch);
}

TEST(SceneYaml, NamesWhatItRefuses) {
  const std::pair<const char*, const char*> cases[] = {
      {"colour: red\nbodies: [{}]", "colour: unknown field, known here are name, method, "},
      {"bodies: [{colour: red}]", "bodies[0].colour: unknown field"},
      {"bodies: [{}]\ntools: [{weight: 1}]", "tools[0].weight: unknown field"},
      {"bodies: [{}]\nground: {y: 1}", "ground.y: unknown field"},
      {"bodies: [{pose: {xyz: [1, 2, 3]}}]", "bodies[0].pose.xyz: unknown field"},
      {"materials: [{name: a, young: 1}]", "materials[0].young: unknown field"},
      {"materials: [{young_modulus: 1}]", "materials[0].name is missing: "},
      {"materials: [{name: kidney, toughness: measured}]",
       "materials[0].toughness is measured: was not measured of 'kidney', only of liver"},
      {"materials: [{name: a, toughness: much}]",
       "materials[0].toughness is much: must be a number"},
      {"materials: [{name: a, toughness: -1}]\nbodies: [{}]", "materials[0].toughness is -1: "},
      {"materials: [{name: a, toughness: .nan}]\nbodies: [{}]", "materials[0].toughness is .nan: "},
      {"materials: [{name: a, toughness: 1, tear: much}]",
       "materials[0].tear is much: must be measured, from toughness, or left out"},
      {"materials: [{name: a, tear: measured}]",
       "materials[0].tear is measured: needs a toughness"},
      {"materials: [{name: a, toughness: 1, tear: measured, tear_stretch: 2}]",
       "materials[0].tear is measured: leaves no room for tear_stretch"},
      {"materials: [{name: a, toughness: 1e-7, tear: measured}]",
       "materials[0].tear is measured: toughness 1e-07 J/m^2 over young_modulus 5000 Pa is too "
       "little"},
      {"materials: [{name: a, young_modulus: 1, toughness: 1e5, tear: measured}]",
       "materials[0].tear is measured: toughness 100000 J/m^2 over young_modulus 1 Pa is too much"},
      {"materials: [{name: a, toughness: -1, tear: measured}]\nbodies: [{}]",
       "materials[0].toughness is -1: "},
      {"method: pbd\nmaterials: [{name: a, toughness: 1, tear: measured}]",
       "materials[0].tear is measured: materials have no toughness with method pbd"},
      {"method: pbd\nmaterials: [{name: a, toughness: 1}]\nbodies: [{}]",
       "materials[0].toughness is 1: must be 0 with method pbd"},
      {"bodies: [{}]\ntools: [{type: scalpel, edge_radius: 0.0003}]",
       "tools[0].edge_radius is 0.0003: must lie between 0 and 0.0002 m"},
      {"bodies: [{anchors: [{above: 1}]}]", "bodies[0].anchors[0].above: unknown field"},
      {"bodies: [{anchors: [{}]}]", "bodies[0].anchors[0] is a map of 0 fields: must be one of"},
      {"bodies: [{anchors: [{below: 1, ball: {center: [0, 0, 0], radius: 1}}]}]",
       "bodies[0].anchors[0] is a map of 2 fields: must be one of"},
      {"bodies: [{anchors: [{ball: {center: [0, 0, 0]}}]}]",
       "bodies[0].anchors[0].ball.radius is missing: "},
      {"bodies: [{anchors: [{box: {min: [0, 0, 0]}}]}]",
       "bodies[0].anchors[0].box.max is missing: "},
      {"bodies: [{inclusions: 3}]", "bodies[0].inclusions is 3: must be a list"},
      {"bodies: [{inclusions: [{region: {below: 1}}]}]",
       "bodies[0].inclusions[0].material is missing: "},
      {"bodies: [{inclusions: [{material: fat}]}]", "bodies[0].inclusions[0].region is missing: "},
      {"bodies: [{inclusions: [{material: fat, below: 1}]}]",
       "bodies[0].inclusions[0].below: unknown field"},
      {"bodies: [{inclusions: [{material: fat, region: {}}]}]",
       "bodies[0].inclusions[0].region is a map of 0 fields: must be one of"},
      {"bodies: [{inclusions: [{material: fat, region: {ball: {center: [0, 0, 0]}}}]}]",
       "bodies[0].inclusions[0].region.ball.radius is missing: "},
      {"bodies: [{inclusions: [{material: wood, region: {below: 1}}]}]",
       "bodies[0].inclusions[0].material is \"wood\": must be one of"},
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
      {"- a", "the scene is a list: must be a map"},
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

TEST(LoadScene, SaysWhereARelativePathWasLookedFor) {
  EXPECT_EQ(reason_of([] { load_scene("nowhere/scene.yaml"); }),
            "nowhere/scene.yaml: no such file in " + std::filesystem::current_path().string() +
                ", the folder that this program runs in, give the full path");
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

}  // namespace
}  // namespace tissue_sim
