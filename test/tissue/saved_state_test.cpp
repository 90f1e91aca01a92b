// A state that was saved goes on with the same bits in another simulation; what is no such state is
// refused with the reason.
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <sstream>

#include "frame/checksum.h"
#include "support/cut_paths.h"
#include "support/temporary_folder.h"
#include "support/test_scenes.h"
#include "tissue/each_method.h"
#include "tissue/saved_states.h"

namespace tissue_sim {
namespace {

class SavedState : public EachMethod {
 protected:
  /// Liver that a scalpel cuts through, a probe pushes and a grasper pinches; and a ball that
  /// falls.
  Scene operation() const {
    Scene s = on_this(operation_scene(Vec3(0.08, 0.048, 0.028), Vec3(0, 0, 0.015)));
    Tool grasper;
    grasper.name = "grasper";
    grasper.type = ToolType::kGrasper;
    s.tools.push_back(grasper);
    Body ball;
    ball.name = "ball";
    ball.shape = Shape::kBall;
    ball.radius = 0.01;
    ball.pose.position = Vec3(-0.01, 0, 0.042);
    s.bodies.push_back(ball);
    return s;
  }
  static void move(Simulation& simulation, std::int64_t frame) {
    const auto i = static_cast<double>(frame);
    const double t = i / 24;
    const Quat down(Eigen::AngleAxisd(M_PI, Vec3::UnitX()));
    simulation.set_tool(0, {Vec3(0.002 + 0.01 * t, 0.05 - 0.13 * t, -0.001), down});
    simulation.set_tool(1, {Vec3(0.03, -0.01, 0.036 - 0.012 * t), down});
    simulation.set_tool(2, {Vec3(-0.03, 0, 0.022), down}, 0.8 - 0.05 * i);
    if (frame == 12) simulation.cut(plane_cut(Vec3(-0.02, 0, 0), Vec3::UnitX()));
  }
  void expect_refused(const Scene& scene, const Bytes& bytes, const std::string& reason) {
    Simulation simulation(scene);
    try {
      simulation.restore(view(bytes));
      ADD_FAILURE() << "was restored: " << reason;
    } catch (const std::runtime_error& e) {
      EXPECT_NE(std::string(e.what()).find(reason), std::string::npos) << e.what();
    }
  }
};
FOR_EACH_METHOD(SavedState);

// As in a bag of a stranger, who knows how checksums are made.
TEST_P(SavedState, WithOtherBytesAndTheirChecksumIsRefusedOrGoesOn) {
  Scene scene = on_this(Scene());
  scene.cell_size = 0.01;
  scene.bodies.resize(1);
  scene.bodies[0].size = Vec3(0.04, 0.03, 0.02);
  scene.bodies[0].pose.position.z() = 0.0101;
  Anchor anchor;
  anchor.kind = Region::Kind::kBelow;
  anchor.z = 0.005;
  scene.bodies[0].anchors.push_back(anchor);
  scene.tools.resize(1);
  Simulation simulation(scene);
  simulation.cut(plane_cut(Vec3(0.003, 0, 0.01), Vec3::UnitX()));
  for (int i = 0; i < 3; ++i) simulation.advance_frame();
  const Bytes good = simulation.save();
  constexpr std::size_t kSum = 32, kHead = 40;  // frame/sealed_state.cpp
  // Behind the scene and the device, which are compared.
  std::size_t begin = kHead;
  for (int i = 0; i < 2; ++i) {
    std::uint64_t length;
    std::memcpy(&length, &good[begin], sizeof length);
    begin += sizeof length + length;
  }
  const std::uint32_t words[] = {0,           1,           0xffffffffu, 0x7fffffffu,
                                 0x80000000u, 0x7fc00000u, 0x7f800000u, 1000000};
  int refused = 0;
  for (unsigned seed = 1; seed <= 30; ++seed) {
    std::mt19937 random(seed);
    Bytes other = good;
    for (unsigned n = 1 + random() % 4; n > 0; --n) {
      const std::size_t at = begin + random() % (good.size() - begin - 4);
      if (random() % 2 == 0) {
        other[at] = static_cast<std::uint8_t>(random());
      } else {
        std::memcpy(&other[begin + (at - begin) / 4 * 4], &words[random() % 8], 4);
      }
    }
    Checksum checksum;
    checksum.add(Span<const std::uint8_t>(other.data() + kHead, other.size() - kHead));
    const std::uint64_t sum = checksum.value();
    std::memcpy(&other[kSum], &sum, sizeof sum);
    try {
      Simulation restored(scene);
      restored.restore(view(other));
      for (int i = 0; i < 3; ++i) restored.advance_frame();
    } catch (const std::runtime_error&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 10);
}

// Before the first frame, while it is cut, while tools touch, after.
TEST_P(SavedState, GoesOnWithTheSameBits) {
  const auto whole = go_on_from_states({operation(), move});
  EXPECT_GT(whole->tissue().fragment_count(), 2);
}

// One body, whose blocks are those of whole tissue until the cut; then its faces lie on one another
// and slide. Frames are shorter than the time between two searches for faces that may touch.
TEST_P(SavedState, GoesOnWhereCutFacesRestOnOneAnother) {
  Scene scene = on_this(operation_scene(Vec3(0.06, 0.03, 0.03), Vec3(0, 0, 0.015)));
  scene.bodies[0].anchors.clear();
  scene.tools.clear();
  scene.frame_rate = 240;
  const auto whole =
      go_on_from_states({scene,
                         [](Simulation& simulation, std::int64_t frame) {
                           if (frame == 7) {
                             simulation.cut(plane_cut(Vec3(0, 0, 0.016), Vec3(0.5, 0.1, 1)));
                           }
                           if (frame == 12) {
                             simulation.cut(plane_cut(Vec3(0, 0, 0.016), Vec3(1, 0.3, 0.1)));
                           }
                         },
                         33, 3});
  EXPECT_GE(whole->tissue().fragment_count(), 4);
}

TEST_P(SavedState, GoesOnWhileItTears) {
  Scene scene = on_this(free_box(Vec3(0.06, 0.012, 0.012), 0.002));
  scene.gravity.x() = 120;
  Material weak;
  weak.name = "weak";
  weak.tear_stretch = 1.25;
  scene.materials = {weak};
  scene.bodies[0].material = "weak";
  Region held;
  held.kind = Region::Kind::kBox;
  held.min = Vec3(-1, -1, -1);
  held.max = Vec3(0.01, 1, 1);
  scene.bodies[0].anchors = {held};
  const auto whole = go_on_from_states({scene, [](Simulation&, std::int64_t) {}, 15, 4});
  EXPECT_GT(whole->tissue().fragment_count(), 1);
}

// This program again, which finds the state where the environment says and leaves checksums there.
TEST_P(SavedState, GoesOnInAnotherProcess) {
  constexpr const char* kVariable = "TISSUE_SIM_TEST_STATE";
  const auto go_on = [](Simulation& simulation, std::ostream& checksums) {
    while (simulation.frame() < 16) {
      move(simulation, simulation.frame());
      simulation.advance_frame();
      checksums << simulation.frame() << ' ' << simulation.tissue().checksum() << '\n';
    }
  };
  if (const char* path = std::getenv(kVariable)) {
    std::ifstream file(path, std::ios::binary);
    const Bytes bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    Simulation simulation(operation());
    simulation.restore(view(bytes));
    std::ofstream checksums(std::string(path) + ".checksums");
    go_on(simulation, checksums);
    return;
  }
  Simulation simulation(operation());
  for (int i = 0; i < 10; ++i) {
    move(simulation, i);
    simulation.advance_frame();
  }
  const Bytes bytes = simulation.save();
  const TemporaryFolder folder;
  const std::string path = folder.path() + "/state";
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  setenv(kVariable, path.c_str(), 1);
  const auto* const test = testing::UnitTest::GetInstance()->current_test_info();
  const int ended =
      std::system(("env -u GTEST_TOTAL_SHARDS -u GTEST_SHARD_INDEX '" +
                   std::filesystem::read_symlink("/proc/self/exe").string() +
                   "' --gtest_filter=" + test->test_suite_name() + "." + test->name() + " >&2")
                      .c_str());
  unsetenv(kVariable);
  EXPECT_EQ(ended, 0);
  std::ostringstream here;
  go_on(simulation, here);
  std::ifstream checksums(path + ".checksums");
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(checksums), {}), here.str());
}

TEST_P(SavedState, WhatIsNoSuchStateIsRefusedWithTheReason) {
  Simulation simulation(operation());
  move(simulation, 0);
  simulation.advance_frame();
  const Bytes whole = simulation.save();
  for (const std::size_t size :
       {std::size_t(20), std::size_t(100), whole.size() / 2, whole.size() - 1}) {
    expect_refused(operation(), Bytes(whole.begin(), whole.begin() + size), "cut short");
  }
  expect_refused(operation(), {}, "no state");
  expect_refused(operation(), Bytes(5000, 7), "no state");
  Bytes changed = whole;
  changed[whole.size() / 2] ^= 1;
  expect_refused(operation(), changed, "damaged");
  changed = whole;
  changed.push_back(0);
  expect_refused(operation(), changed, "damaged");
  changed = whole;
  ++changed[16];
  expect_refused(operation(), changed, "version");
  Scene other = operation();
  other.gravity.z() = -1.62;
  expect_refused(other, whole, "another scene, whose");
  expect_refused(other, whole, "gravity");
  other = operation();
  other.threads = 1;
  Simulation same(other);
  same.restore(view(whole));
  EXPECT_EQ(same.frame(), 1);
  EXPECT_THROW(same.restore(view(whole)), std::runtime_error) << "has advanced";
}

}  // namespace
}  // namespace tissue_sim
