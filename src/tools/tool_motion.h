// Where tools are within a frame, and what they are to the tissue.
#pragma once

#include <vector>

#include "tissue_sim/cut.h"
#include "tissue_sim/scene.h"
#include "tissue_sim/tissue.h"
#include "tissue_sim/tool.h"
#include "tools/collider.h"

namespace tissue_sim {

/// Pose at the share `s` (0 to 1) of the frame.
Pose pose_at(const ToolMotion& motion, double s);

/// Half of a tool's least thickness, which its tip's radius is; 0 for a blade [m].
double thinnest(const Tool& tool);

/// Number of colliders that a tool is made of: a grasper's jaws are two.
int collider_count(ToolType type);

/// The way of a tool's colliders through a frame that lasts `duration` seconds, in tissue whose
/// points have a surface of `point_area` [m^2]; what does not change on it is worked out once. The
/// tool and its motion must outlive it.
class ToolPath {
 public:
  ToolPath(const Tool& tool, int index, const ToolMotion& motion, double duration,
           double point_area);
  int count() const { return collider_count(tool_->type); }
  bool is_present() const { return motion_->present; }
  /// Where the tool's tip is at the share `s` (0 to 1) of the frame.
  Vec3 tip(double s) const;
  /// Writes the count() colliders as they are at the share `s` of the frame.
  void at(double s, Collider* out) const;

 private:
  void place_jaws(const Pose& pose, double s, Collider* out) const;
  const Tool* tool_;
  const ToolMotion* motion_;
  Vec3 spin_;         // [rad/s], world axes
  double jaw_speed_;  // [rad/s]
  Collider shape_;    // with all that the motion leaves as it is
};

/// The path of a scalpel's edge over the frame: down its front from the heel to the tip and along
/// its lower end to the spine, so that it cuts when it is drawn and when it is stabbed.
BladePath blade_path(const Tool& tool, const ToolMotion& motion);

/// The paths of all scalpels that are there, from the share `begin` of the frame to `end`.
std::vector<BladePath> blade_paths(const Scene& scene, const FrameInput& input, double begin,
                                   double end);

}  // namespace tissue_sim
