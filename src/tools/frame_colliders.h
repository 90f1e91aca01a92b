// The colliders of a frame: the ground first, then those of a scene's tools.
#pragma once

#include <vector>

#include "tissue_sim/scene.h"
#include "tissue_sim/tissue.h"
#include "tools/collider.h"
#include "tools/tool_motion.h"

namespace tissue_sim {

/// Box that a collider fills, moved by nobody [m].
Box bounds(const Collider& collider);

/// How fast any place of a collider moves at most [m/s].
double speed(const Collider& collider);

/// Number of a scene's colliders, the ground included.
int collider_count(const Scene& scene);

class FrameColliders {
 public:
  /// Of a frame of `duration` seconds. The scene and the tools' motions must outlive them.
  FrameColliders(const Scene& scene, const FrameInput& input, double duration);
  int count() const { return count_; }
  /// Writes the count() colliders as they are at the share (0 to 1) of the frame.
  void at(double share, Collider* out) const;
  void at(double share, std::vector<Collider>& out) const;
  /// As they are at the frame's end.
  const std::vector<Collider>& at_end() const { return at_end_; }
  /// What each of them sweeps during the frame; empty for a tool that is not there [m].
  const std::vector<Box>& reach() const { return reach_; }
  /// Adds what acts on the colliders `now`, in a substep that ends at the share of the frame, to
  /// the loads of their tools; `weight` is the substep's part of the frame.
  void add_loads(double share, const Collider* now, const ColliderLoad* on, double weight,
                 std::vector<ToolLoad>& loads) const;
  /// What the colliders `now` do to tissue while this acts on them [W].
  double power(const Collider* now, const ColliderLoad* on) const;

 private:
  double point_area_;  // [m^2]
  Collider ground_;
  std::vector<ToolPath> tools_;
  int count_ = 1;
  std::vector<Collider> at_end_;
  std::vector<Box> reach_;
};

}  // namespace tissue_sim
