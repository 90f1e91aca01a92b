#include "contact/frame_colliders.h"

#include "contact/block_contact.h"
#include "tools/tool_motion.h"

namespace tissue_sim {

std::vector<Collider> colliders_at(const Scene& scene, const FrameInput& input, double share,
                                   double duration) {
  std::vector<Collider> colliders(1);
  colliders[0].position[2] = static_cast<float>(scene.ground.enabled ? scene.ground.z : -1e6);
  colliders[0].friction = static_cast<float>(scene.ground.friction);
  for (std::size_t i = 0; i < input.tools.size(); ++i) {
    colliders.push_back(
        tool_collider(scene.tools[i], static_cast<int>(i), input.tools[i], share, duration));
  }
  return colliders;
}

std::vector<Box> collider_reach(const Scene& scene, const FrameInput& input, double duration) {
  std::vector<Box> reach;
  for (const double share : {0.0, 0.5, 1.0}) {
    const std::vector<Collider> colliders = colliders_at(scene, input, share, duration);
    reach.resize(colliders.size());
    for (std::size_t c = 0; c < reach.size(); ++c) {
      const bool absent = c > 0 && !input.tools[c - 1].present;
      if (absent) continue;
      const Box box = bounds(colliders[c]);
      reach[c].min = reach[c].min.cwiseMin(box.min);
      reach[c].max = reach[c].max.cwiseMax(box.max);
    }
  }
  return reach;
}

}  // namespace tissue_sim
