// A bar that its own motion tears, for tests of what the fragment network does.
#pragma once

#include <cmath>
#include <string>

#include "mpm/mpm_state.h"
#include "support/cut_scenes.h"

namespace tissue_sim {

/// A bar that its own motion tears, off its middle.
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

inline void set_going(MpmState& s) {
  for (const LatticeBody& b : s.bodies) {
    b.for_each_node([&](int node, int i, int j, int k) {
      const Vec3 x = b.node_position(i, j, k);
      s.nodes.v[0][node] = static_cast<float>(1.5 * std::tanh((x.x() - 0.014) / 0.003));
      s.nodes.v[1][node] = static_cast<float>(20 * (x.x() - 0.007));
    });
  }
}

}  // namespace tissue_sim
