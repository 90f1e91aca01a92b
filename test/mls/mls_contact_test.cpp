// Contact of nodes with one another and with the ground.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "mls_scenes.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

/// Two boxes, one a little above the other.
Scene two_boxes() {
  Scene scene = mls_box(Vec3(0.008, 0.006, 0.004), 0.001);
  scene.bodies.push_back(scene.bodies[0]);
  scene.bodies[1].name = "above";
  scene.bodies[1].pose.position += Vec3(0.0007, 0.0004, 0.0055);
  return scene;
}

/// Whatever touches was listed, however long a list was kept; what a frame applies is `input`'s.
template <class Input>
void expect_all_are_listed(MlsTissue& tissue, const Input& input) {
  MlsState& s = tissue.state();
  int touches = 0;
  const double frame = 1 / 240.0;  // s
  for (int f = 0; f < 24; ++f) {
    tissue.advance(frame, input(frame * f, frame * (f + 1)));
    ASSERT_FALSE(tissue.finish().blew_up);
    const MlsNodeContacts& contacts = s.node_contacts;
    for (int i = 0; i < s.count(); ++i) {
      for (int j = 0; j < s.count(); ++j) {
        if (s.nodes.body[i] == s.nodes.body[j]) continue;
        if ((s.position(i) - s.position(j)).norm() > 0.5 * (s.edge[i] + s.edge[j])) continue;
        ++touches;
        const auto first = contacts.other.begin() + contacts.begin[i],
                   last = contacts.other.begin() + contacts.begin[i + 1];
        ASSERT_NE(std::find(first, last, j), last) << i << " and " << j << ", frame " << f;
      }
    }
  }
  EXPECT_GT(touches, 20);
}

TEST(MlsContact, ListsHoldAllThatTouch) {
  MlsTissue tissue(two_boxes());
  MlsState& s = tissue.state();
  for (int i = 0; i < s.count(); ++i) {
    if (s.nodes.body[i] == 1) s.v[4 * i + 2] = -0.3f;
  }
  expect_all_are_listed(tissue, [](double, double) { return FrameInput(); });
}

// What rests when it is looked for is pushed by a tool at once.
TEST(MlsContact, ListsHoldAllThatAToolPushes) {
  Scene scene = two_boxes();
  scene.tools.resize(1);
  scene.tools[0].type = ToolType::kPlate;
  scene.tools[0].size = Vec3(0.02, 0.02, 0.002);
  MlsTissue tissue(scene);
  ToolMotion plate;
  const auto tool_at = [](double time) {
    Pose pose;
    pose.position = Vec3(0.0047, 0.0034, std::max(0.006, 0.0105 - 0.5 * time));
    pose.orientation = Quat(0, 1, 0, 0);
    return pose;
  };
  expect_all_are_listed(tissue, [&](double begin, double end) {
    plate.present = true;
    plate.begin = tool_at(begin);
    plate.end = tool_at(end);
    return FrameInput{{&plate, 1}, {}};
  });
}

// Nodes lie below the surface; tools and the ground act at it.
TEST(MlsContact, IsAtTheTrueSurface) {
  for (const MlsPlacement placement : {MlsPlacement::kRegular, MlsPlacement::kGraded}) {
    Scene scene = mls_box(Vec3(0.012, 0.012, 0.008), 0.001, placement);
    scene.ground.enabled = true;
    scene.gravity = Vec3(0, 0, -1);
    scene.damping = 20;
    Simulation simulation(scene);
    for (int f = 0; f < 60; ++f) simulation.advance_frame();
    // Under its weight it sinks some micrometres, by what the springs of a layer bear.
    EXPECT_NEAR(simulation.tissue().fragments()[0].centroid[2], 0.004, 5e-5);
  }
}

}  // namespace
}  // namespace tissue_sim
