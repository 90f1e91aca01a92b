// Simulation: a scene, its tissue and the time. Read this first.
//
//   Simulation simulation(load_scene("scene.yaml"));
//   FrameRequest request;
//   request.tools = {ToolRequest{pose}};      // where tool 0 is to be at the end of the frame
//   request.cuts = {path};                    // at its start
//   FrameReport report = simulation.advance_frame(request);
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

/// What a frame is asked for. What is left out goes on as it was asked for last.
struct FrameRequest {
  std::vector<std::optional<ToolRequest>> tools;  ///< parallels Scene::tools, or empty
  std::vector<BladePath> cuts;                    ///< at the start of the frame
  /// In the order of the scene, or empty: where an anchor shall be at the end of the frame; what it
  /// holds moves as a rigid body from Anchor::origin().
  std::vector<std::optional<Pose>> anchors;
  std::vector<FluidOrder> fluid;  ///< at the start of the frame
  std::optional<Vec3> gravity;    ///< from this frame on [m/s^2]
  std::optional<double> damping;  ///< the same [1/s]
};

/// Inputs as they were applied in one frame: world frame, doubles. Enough to repeat the frame.
struct AppliedInput {
  std::int64_t frame = 0;
  std::vector<ToolMotion> tools;  ///< parallels Scene::tools
  /// What graspers' jaws press with at most, parallels `tools` [Pa]; 0, or none at all: the scene's
  /// Tool::grip_pressure. A jaw_end below 0 squeezes with more: see tools/grip.h.
  std::vector<double> grip_pressures;
  std::vector<BladePath> cuts;
  std::vector<AnchorMotion> anchors;  ///< in the order of the scene; empty: they stay
  std::vector<FluidOrder> fluid;
  std::optional<Vec3> gravity;    ///< from this frame on, if given [m/s^2]
  std::optional<double> damping;  ///< the same [1/s]
};

/// When tissue counts as being at rest, and how long to wait for it.
struct SettleLimits {
  double speed = 1e-4;  ///< no point was faster for a tenth of a second [m/s]
  double time = 10;     ///< simulated at most [s]
  double damping = -1;  ///< meanwhile, instead of the scene's [1/s]; negative: the scene's
};
/// How settle() ended.
struct SettleReport {
  bool at_rest = false;
  double time = 0;   ///< that it took [s]
  double speed = 0;  ///< of the fastest point in the last tenth of a second [m/s]; infinite before
};

/// What a frame was given and what came of it.
struct FrameReport {
  AppliedInput input;
  FrameResult result;
  double cfl = 0;                  ///< longest substep * wave speed / cell size
  double compute_time = 0;         ///< wall time that the frame took [s]
  std::vector<std::string> notes;  ///< of tools that are placed within tissue
};

/// Not thread-safe: one thread owns it. Time is an integer count of frames.
class Simulation {
 public:
  /// Validates the scene and builds its tissue. Throws what validate() and make_tissue() throw.
  explicit Simulation(const Scene& scene);
  ~Simulation();

  const Scene& scene() const;
  Tissue& tissue();
  std::int64_t frame() const;                    ///< frames completed
  double time() const;                           ///< simulated time [s]
  const std::vector<ToolMotion>& tools() const;  ///< at rest where the last frame left them
  Pose anchor(int anchor) const;                 ///< where it is now. Throws std::out_of_range
  double damping() const;                        ///< as it was last asked for [1/s]

  /// Advances one frame. Throws std::invalid_argument, and nothing was done, for what is not in the
  /// scene or out of its ranges, poses that are not finite or no rotation, cuts of less than two
  /// poses or edge points, and anchors that do not move with the scene's method. After a blow-up it
  /// throws std::runtime_error: build a new Simulation.
  FrameReport advance_frame(const FrameRequest& request = {});
  /// Advances one frame with exactly these inputs (replay). Throws as advance_frame() does.
  FrameReport repeat_frame(const AppliedInput& input);
  /// Advances frames until all is at rest or the time is over; tools stay where they are.
  SettleReport settle(const SettleLimits& limits = {});

  /// Parts of the next frame's request, one by one, with its checks.
  void set_tool(int tool, const Pose& pose, double jaw = 0);
  void set_grip_pressure(int tool, double pressure);
  void cut(const BladePath& path);
  void set_anchor(int anchor, const Pose& pose);
  /// Fills the hollow of a body that is filled until its mean pressure was once so high [Pa].
  void fill(int body, double pressure);
  /// Takes so much out of it [m^3].
  void drain(int body, double volume);
  void set_gravity(const Vec3& gravity);
  void set_damping(double damping);

  /// The whole state between two frames, with its scene, version and checksum: restore() of a new
  /// Simulation of the same scene goes on from there with the same bits, in another process too, on
  /// a device of the same kind.
  std::vector<std::uint8_t> save();
  /// Throws std::runtime_error with the reason for what is cut short, damaged, of another version,
  /// scene or device; then this simulation must not be used any more. A new one must not have
  /// advanced before.
  void restore(Span<const std::uint8_t> saved);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Settling frame by frame, for who does something between them: settle() is this.
class Settling {
 public:
  Settling(Simulation& simulation, const SettleLimits& limits);
  int most_frames() const;  ///< that it may take, at least one
  /// Whether it is over with this frame: all is at rest, or the time is over.
  bool is_over(const FrameReport& frame);
  /// The damping is what it was before.
  SettleReport end(Simulation& simulation) const;

 private:
  double fastest() const;

  const SettleLimits limits_;
  const double damping_, frame_rate_;
  std::vector<double> speeds_;  // of the last frames [m/s]
  int frames_ = 0;
};

}  // namespace tissue_sim
