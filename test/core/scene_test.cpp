// A scene's checks and the built-in materials.
#include "tissue_sim/scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "support/test_scenes.h"

namespace tissue_sim {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

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
      {"bodies[0].inclusions[1].material is \"wood\": ",
       [](Scene& s) { s.bodies[0].inclusions[1].material = "wood"; }},
      {"bodies[0].inclusions is a list of 256: ",
       [](Scene& s) { s.bodies[0].inclusions.resize(256); }},
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
