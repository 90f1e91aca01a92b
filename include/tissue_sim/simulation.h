// Simulation: a scene, its tissue and the time. Read this first.
//
//   Simulation simulation(load_scene("scene.yaml"));
//   simulation.set_tool(0, pose);             // where tool 0 is to be at the end of the next frame
//   simulation.cut(path);                     // at the start of the next frame
//   FrameReport report = simulation.advance_frame();
//   simulation.tissue().read_points({}, cloud);
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tissue_sim/scene.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// Inputs as they were applied in one frame: world frame, doubles. Enough to repeat the frame.
struct AppliedInput {
  std::int64_t frame = 0;
  std::vector<ToolMotion> tools;  ///< parallels Scene::tools
  /// What graspers' jaws press with at most, parallels `tools` [Pa]; 0, or none at all: the scene's
  /// Tool::grip_pressure. A jaw_end below 0 squeezes with more: see tools/grip.h.
  std::vector<double> grip_pressures;
  std::vector<BladePath> cuts;
  std::vector<AnchorMotion> anchors;  ///< in the order of the scene; empty: they stay
  std::optional<Vec3> gravity;        ///< from this frame on, if given [m/s^2]
  std::optional<double> damping;      ///< the same [1/s]
};

/// When tissue counts as being at rest, and how long to wait for it.
struct SettleLimits {
  double speed = 1e-4;  ///< no point was faster for a tenth of a second [m/s]
  double time = 10;     ///< simulated at most [s]
  double damping = -1;  ///< meanwhile, instead of the scene's [1/s]; negative: the scene's
};
struct SettleReport {
  bool at_rest = false;
  double time = 0;   ///< that it took [s]
  double speed = 0;  ///< of the fastest point in the last tenth of a second [m/s]
};

struct FrameReport {
  AppliedInput input;
  FrameResult result;
  double cfl = 0;           ///< longest substep * wave speed / cell size
  double compute_time = 0;  ///< wall time that the frame took [s]
};

/// Not thread-safe: one thread owns it. Time is an integer count of frames.
class Simulation {
 public:
  /// Validates the scene and builds its tissue. Throws what validate() and make_tissue() throw.
  explicit Simulation(const Scene& scene);
  ~Simulation();

  const Scene& scene() const;
  Tissue& tissue();
  std::int64_t frame() const;  ///< frames completed
  double time() const;         ///< simulated time [s]
  /// As they stand after the last frame, and as they were set for the next.
  const std::vector<ToolMotion>& tools() const;

  /// The tool shall be there at the end of the next frame. Its first pose places it without motion.
  /// Throws std::invalid_argument for an unknown tool or a pose that is not finite or no rotation.
  void set_tool(int tool, const Pose& pose, double jaw = 0);
  /// What a grasper's jaws press with at most from the next frame on, in place of the scene's
  /// grip_pressure; 0 for the scene's [Pa]. Throws std::invalid_argument for an unknown tool and
  /// outside of 1 to 1e7.
  void set_grip_pressure(int tool, double pressure);
  /// Cuts at the start of the next frame. Throws std::invalid_argument for less than two poses or
  /// edge points, or values that are not finite.
  void cut(const BladePath& path);
  /// The anchor, by its number in the order of the scene, shall be there at the end of the next
  /// frame: what it holds moves as a rigid body from Anchor::origin(). Throws
  /// std::invalid_argument for an anchor that is not there or a pose that is not finite or no
  /// rotation.
  void set_anchor(int anchor, const Pose& pose);
  /// Where it is now, or shall be at the end of the next frame. Throws std::out_of_range.
  Pose anchor(int anchor) const;
  /// From the next frame on. Throw std::invalid_argument out of the scene's ranges.
  void set_gravity(const Vec3& gravity);
  void set_damping(double damping);
  double damping() const;  ///< as of the next frame [1/s]
  /// Puts exactly these inputs into the next frame (replay), instead of what was set.
  void apply(const AppliedInput& input);

  /// The whole state between two frames, with its scene, version and checksum: restore() of a new
  /// Simulation of the same scene goes on from there with the same bits, in another process too, on
  /// a device of the same kind.
  std::vector<std::uint8_t> save();
  /// Throws std::runtime_error with the reason for what is cut short, damaged, of another version,
  /// scene or device; then this simulation must not be used any more. A new one must not have
  /// advanced before.
  void restore(Span<const std::uint8_t> saved);

  /// Advances one frame. After a blow-up it throws std::runtime_error: build a new Simulation.
  FrameReport advance_frame();
  /// Advances frames until all is at rest or the time is over; tools stay where they are.
  SettleReport settle(const SettleLimits& limits = {});

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace tissue_sim
