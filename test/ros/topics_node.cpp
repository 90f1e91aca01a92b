// What the node tells: state, clouds, fragments, the scene, diagnostics.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/String.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>

#include "simulator_client.h"

namespace tissue_sim {
namespace {

constexpr int kPoints = 8 * 4 * 4 * 8;  // of the slab: cells times points a cell

class Topics : public testing::Test {
 protected:
  void SetUp() override {
    pause(false);
    trigger("reset");
  }
};

TEST_F(Topics, StateSaysHowTheSimulationStands) {
  Topic<SimulationState> state("/simulator/state");
  const auto s = state.next();
  ASSERT_TRUE(s);
  EXPECT_EQ(s->header.frame_id, "world");
  EXPECT_EQ(s->particles, kPoints);
  EXPECT_EQ(s->fragments, 1);
  EXPECT_EQ(s->loose_fragments, 0);
  EXPECT_NEAR(s->fragment_volume, 16e-6, 1e-9);
  EXPECT_GT(s->substeps, 0);
  EXPECT_NEAR(s->time, s->frame / 60.0, 1e-9);
  EXPECT_FALSE(s->device.empty());
  EXPECT_EQ(s->device.find(','), std::string::npos) << "shifts the columns of rostopic echo -p";
  EXPECT_EQ(s->checksum.size(), 16u);
  EXPECT_EQ(s->checksum.find_first_not_of("0123456789abcdef"), std::string::npos) << s->checksum;
}

TEST_F(Topics, StateTellsTheLongestSubstepOfAFrame) {
  Topic<SimulationState> state("/simulator/state");
  const auto beyond_frame = [](const auto& s) { return s->substep * s->substeps - 1.0 / 60; };
  // Most frames have equal substeps; in some they grow or shrink little by little.
  EXPECT_TRUE(wait_until(
      [&] {
        const auto all = state.all();
        return std::any_of(all.begin(), all.end(),
                           [&](const auto& s) { return std::fabs(beyond_frame(s)) < 1e-9; });
      },
      20));
  for (const auto& s : state.all()) EXPECT_GT(beyond_frame(s), -1e-9) << "frame " << s->frame;
}

TEST_F(Topics, WallTimeIsKeptAndNeverCaughtUp) {
  Topic<SimulationState> state("/simulator/state");
  ASSERT_TRUE(wait_until([&] { return state.count() > 150; }, 60));
  const auto all = state.all();
  for (std::size_t i = 1; i < all.size(); ++i) ASSERT_EQ(all[i]->frame, all[i - 1]->frame + 1);
  const auto &a = all[20], &b = all[140];
  const double wall = (b->header.stamp - a->header.stamp).toSec();
  const double factor = (b->time - a->time) / wall;
  EXPECT_LT(factor, 1.03);
  EXPECT_NEAR(b->real_time_factor, factor, 0.35);  // it looks at the last second alone
}

TEST_F(Topics, CloudHasTheDocumentedLayout) {
  Topic<sensor_msgs::PointCloud2> clouds("/simulator/tissue/points");
  const auto c = clouds.next();
  ASSERT_TRUE(c);
  EXPECT_EQ(c->header.frame_id, "world");
  ASSERT_EQ(c->point_step, 32u);
  ASSERT_EQ(c->width * c->height, static_cast<unsigned>(kPoints));
  ASSERT_EQ(c->data.size(), 32u * kPoints);
  std::string fields;
  for (const auto& f : c->fields) fields += f.name + std::to_string(f.offset) + " ";
  EXPECT_EQ(fields, "x0 y4 z8 rgb12 id16 fragment20 stress24 damage28 ");
  std::set<std::uint32_t> ids;
  for (std::size_t i = 0; i < kPoints; ++i) {
    Point p;
    std::memcpy(&p, &c->data[32 * i], sizeof p);
    ids.insert(p.id);
    ASSERT_TRUE(std::isfinite(p.stress));
    ASSERT_LT(std::fabs(p.x), 0.022);
    ASSERT_LT(std::fabs(p.y), 0.012);
    ASSERT_GT(p.z, -0.002);
    ASSERT_LT(p.z, 0.022);
    ASSERT_EQ(p.fragment, 0);
    ASSERT_EQ(p.damage, 0);
  }
  EXPECT_EQ(ids.size(), static_cast<std::size_t>(kPoints));
}

TEST_F(Topics, FragmentsAndSceneAreThere) {
  Topic<FragmentArray> fragments("/simulator/fragments");
  const auto f = fragments.next();
  ASSERT_TRUE(f);
  ASSERT_EQ(f->fragments.size(), 1u);
  EXPECT_EQ(f->fragments[0].body, "slab");
  EXPECT_EQ(f->fragments[0].point_count, kPoints);
  EXPECT_NEAR(f->fragments[0].volume, 16e-6, 1e-9);
  EXPECT_NEAR(f->fragments[0].centroid.x, 0, 1e-3);
  EXPECT_NEAR(f->fragments[0].centroid.z, 0.01, 2e-3);
  EXPECT_NEAR(f->fragments[0].box_max.x - f->fragments[0].box_min.x, 0.0375, 3e-3);

  Topic<std_msgs::String> scenes("/simulator/scene");  // latched
  const auto s = scenes.last();
  ASSERT_TRUE(s);
  const Scene scene = scene_from_yaml(s->data);
  EXPECT_EQ(scene.name, "slab");
  EXPECT_EQ(scene.tools.size(), 5u);
}

TEST_F(Topics, DiagnosticsComesOnceASecond) {
  Topic<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  ASSERT_TRUE(wait_until([&] {
    std::set<std::string> names;
    for (const auto& m : diagnostics.all()) {
      for (const auto& s : m->status) names.insert(s.name);
    }
    return names.count("simulator: simulation") && names.count("simulator: tools") &&
           names.count("simulator: recording");
  }));
}

}  // namespace
}  // namespace tissue_sim

TISSUE_SIM_TEST_NODE("topics_test")
