// A bar that its own motion tears, for tests of what the fragment network does.
#pragma once

#include <string>

#include "mpm/mpm_state.h"
#include "support/cut_scenes.h"

namespace tissue_sim {

/// A bar that its own motion tears.
inline Scene torn_bar(const std::string& network) {
  Scene scene = free_box(Vec3(0.020, 0.008, 0.008), 0.002);
  Material m;
  m.name = "torn";
  m.tear_stretch = 1.25;
  m.tear_length = 0.003;
  scene.materials = {m};
  scene.bodies[0].material = m.name;
  scene.device = Device::kCpu;
  scene.threads = 1;
  scene.frame_rate = 960;
  scene.fragment_network = network;
  return scene;
}

/// Its ends move apart.
inline void pull_apart(MpmState& s) {
  for (const LatticeBody& b : s.bodies) {
    b.for_each_node([&](int node, int i, int j, int k) {
      s.nodes.v[0][node] = static_cast<float>(120 * (b.node_position(i, j, k).x() - 0.010));
    });
  }
}

}  // namespace tissue_sim
