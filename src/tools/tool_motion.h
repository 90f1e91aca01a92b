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

/// Number of colliders that a tool is made of: jaws are two.
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
  /// Its moment about the hinge that opens the jaw on that `side`, of what acts on it [N m].
  double opening(double s, int side, const Collider& jaw, const ColliderLoad& on) const;
  /// Writes the count() colliders as they are at the share `s` of the frame.
  void at(double s, Collider* out) const;

 private:
  void place_jaws(const Pose& pose, double s, Collider* out) const;
  const Tool* tool_;
  const ToolMotion* motion_;
  bool cuts_;
  Vec3 spin_;         // [rad/s], world axes
  double jaw_speed_;  // [rad/s]
  Collider shape_;    // with all that the motion leaves as it is
};

/// A blade at the share `s` of the frame: its edge lies along z, its tip at the origin, its spine
/// at -x. Of scissors that on `side` 0 or 1 of their x = 0.
Pose blade_at(const Tool& tool, const ToolMotion& motion, double s, int side);

/// From a scissors' hinge to where its edges cross at the share `s` of the frame [m].
double crossing_at(const Tool& tool, const ToolMotion& motion, double s);
/// Whether its blades cut what they sweep in this frame: those of scissors while they close, until
/// they cross at their tips.
bool cuts(const Tool& tool, const ToolMotion& motion);

/// The path of a blade's edge over the frame. A scalpel's: down its front from the heel to the tip
/// and along its lower end to the spine, so that it cuts when it is drawn and when it is stabbed.
/// Of scissors: from the tip of a blade to where the edges cross and to the tip of the other.
BladePath blade_path(const Tool& tool, const ToolMotion& motion);

/// The paths of all blades that cut, from the share `begin` of the frame to `end`, and of which
/// tool each is.
std::vector<BladePath> blade_paths(const Scene& scene, const FrameInput& input, double begin,
                                   double end, std::vector<int>* tools = nullptr);

}  // namespace tissue_sim
