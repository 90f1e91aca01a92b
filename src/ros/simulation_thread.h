// SimulationThread: owns the simulation and advances it, frame by frame as FrameClock says.
// Everything else talks to it between two frames, so nothing that is slow ever stops it.
#pragma once

#include <condition_variable>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "ros/frame_clock.h"
#include "ros/pace.h"
#include "ros/parameters.h"
#include "ros/publications.h"
#include "ros/scene_input.h"
#include "ros/tool_input.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {

/// One scene's simulation and its connections to ROS.
struct Session {
  std::vector<std::string> folders;  ///< that files of its scene are read from alone; none: any
  std::unique_ptr<Simulation> simulation;
  std::shared_ptr<ToolInputs> tools;
  std::shared_ptr<Publications> publications;
  std::shared_ptr<SceneInput> scene_input;
};

/// Names of the topics that a recording of it holds unless others are asked for: all but a surface
/// that is made of points, which replay makes again.
std::set<std::string> topics_of(const Session& session);

/// What diagnostics says.
struct RunStatus {
  RunState run;
  std::string problem;  ///< why it stands still, if it blew up
  std::int64_t frame = 0;
  double time = 0, frame_rate = 0;
  double aimed_factor = 0;  ///< real-time factor that is to be reached, 0 for none
  std::string coarser;      ///< what would reach it, where it is not: see coarser()
  double behind = 0;        ///< of ROS time, where frames keep to it [s]
  int substeps = 0;
  double substep = 0, compute_time = 0;
  int particles = 0;
  std::size_t fragments = 0;
  std::string device;
  std::string inside;  ///< inside_warning() of the last frame
};

struct CutReply {
  bool success = false;
  std::string message;
  CutReport report;
};

struct SavedFrame {
  std::int64_t frame = 0;
  std::vector<std::uint8_t> state;
};

struct ShownSurface {
  std::int64_t frame = 0;
  SurfaceTriangles triangles;
  std::vector<std::uint32_t> colours;  ///< 0x00RRGGBB of each, as its piece has
};

struct StepReply {
  bool success = false;
  std::string message;
  std::int64_t frame = 0;
  double time = 0;
  SettleReport settled;  ///< of settle()
};

/// The public functions are for other threads. They wait until the simulation's thread has done
/// what they ask, and throw std::runtime_error with the reason if it does not.
class SimulationThread {
 public:
  /// `say_time` is called with the time that it is after each frame, where this node is the clock.
  SimulationThread(Session session, const Parameters& parameters,
                   std::function<void(const ros::Time&)> say_time);
  ~SimulationThread();
  /// Ends the thread; who waits for an answer gets an exception.
  void stop();

  /// In the next frame, which is advanced even while paused.
  CutReply cut(const BladePath& path);
  /// Fills a body of that name to a `pressure`, or drains a `volume` out of it, from the next frame
  /// on; both must be above 0.
  void order(const std::string& body, const std::string& what, double amount);
  /// What /clock says. Where it jumps back the scene starts anew; tools keep what is latched.
  void on_clock(const ros::Time& now);
  /// A sample of an instrument came.
  void on_sample();

  /// `frames` frames as fast as they go.
  StepReply step(int frames);
  /// As many as it takes until all is at rest, within the limits.
  StepReply settle(const SettleLimits& limits);
  void set_paused(bool paused);
  /// Frame 0 of the same scene; the tools stay where they are.
  void reset(std::unique_ptr<Simulation> simulation);
  void replace(Session session);
  SavedFrame save();
  ShownSurface surface();
  /// Goes on from what `simulation` was restored to, out of `state`.
  void restore(std::unique_ptr<Simulation> simulation, const std::vector<std::uint8_t>& state);
  void record_scene();
  /// The state, where frames were done, into a recording that has just begun. Returns the frame, or
  /// -1 where the method cannot tell its state.
  std::int64_t record_state();

  RunStatus status() const;
  std::shared_ptr<ToolInputs> tools() const;
  /// topics_of() the present session: what a recording holds unless others are asked for.
  std::set<std::string> topics() const;

 private:
  struct PendingCut {
    BladePath path;
    std::promise<CutReply> reply;
  };

  void run();  // run_frames(), and what becomes of what it throws
  void run_frames();
  void frame();
  bool frame_due();
  FrameRequest request(const std::vector<PendingCut>& cuts);
  void start_anew(const ros::Time& before, const ros::Time& now);
  void answer_cuts(std::vector<PendingCut>& cuts, const FrameReport& report);
  void answer_step(const char* interrupted);
  void fail(const std::string& problem);
  void start_session();
  void update_status();
  bool active() const;
  /// Runs `work` between two frames and waits for its answer, which it gives to the promise now or
  /// moves to where a later frame gives it.
  template <class Reply, class Work>
  Reply ask(const Work& work);
  void call(const std::function<void()>& work);  ///< the same, with no answer
  void refuse_step() const;                      ///< throws where none can begin
  void begin_steps(int frames, std::promise<StepReply>& reply);
  void post(std::function<void()> work);

  const Parameters parameters_;
  const std::function<void(const ros::Time&)> say_time_;

  // Of the thread alone.
  Session session_;
  FrameClock clock_;
  RealTimeFactor real_time_factor_;
  FrameReport report_;  // of the last frame
  RunState run_;
  std::string problem_;
  bool resumed_ = false;  // no frame since the pause
  std::vector<PendingCut> cuts_;
  int steps_left_ = 0;
  std::promise<StepReply> step_reply_;
  std::optional<Settling> settling_;

  mutable std::mutex mutex_;  // of what follows
  std::condition_variable wake_;
  std::vector<std::function<void()>> work_;
  bool stop_ = false;
  bool woken_ = false;                    // by a sample or /clock
  std::optional<ros::Time> jumped_from_;  // /clock did, back
  ros::Time ros_time_;                    // what it says
  RunStatus status_;
  std::shared_ptr<ToolInputs> tools_;
  std::set<std::string> topics_;

  std::thread thread_;
};

}  // namespace tissue_sim
