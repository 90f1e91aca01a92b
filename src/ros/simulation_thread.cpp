#include "ros/simulation_thread.h"

#include <ros/console.h>
#include <ros/init.h>

#include <algorithm>
#include <utility>

#include "ros/diagnostics.h"
#include "ros/warn_seldom.h"
#include "scene/read_file.h"
#include "tools/points_inside.h"

namespace tissue_sim {
namespace {

constexpr std::chrono::milliseconds kShownAtRest(200);  // between two looks at a simulation at rest
constexpr std::chrono::milliseconds kHold(20);          // between its forces and transforms

}  // namespace

std::set<std::string> topics_of(const Session& session) {
  std::set<std::string> topics = session.publications->topics();
  for (const auto& tool : *session.tools) topics.merge(tool->topics());
  if (!session.simulation->tissue().moves_surface()) {
    topics.erase(session.publications->surface_topic());
  }
  return topics;
}

SimulationThread::SimulationThread(Session session, const Parameters& parameters,
                                   std::function<void(const ros::Time&)> say_time)
    : parameters_(parameters),
      say_time_(std::move(say_time)),
      session_(std::move(session)),
      clock_(parameters) {
  run_.paused = parameters.paused;
  start_session();
  if (parameters_.publish_clock) say_time_(clock_.stamp());
  thread_ = std::thread(&SimulationThread::run, this);
}

SimulationThread::~SimulationThread() { stop(); }

void SimulationThread::stop() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
  const std::lock_guard<std::mutex> lock(mutex_);
  work_.clear();  // what was promised in there is broken, which wakes who waits for it
  cuts_.clear();
  if (std::exchange(steps_left_, 0) > 0) step_reply_ = {};
}

void SimulationThread::start_session() {
  const Scene& scene = session_.simulation->scene();
  settling_.reset();  // the scene's own damping holds
  answer_step("the simulation was started anew");
  for (PendingCut& cut : std::exchange(cuts_, {})) {
    cut.reply.set_value({false, "the simulation was started anew", {}});
  }
  clock_.restart(scene.frame_rate);
  session_.scene_input->begin(*session_.simulation);
  real_time_factor_.restart();
  report_ = FrameReport();
  report_.input.tools = session_.simulation->tools();
  run_.blew_up = false;
  run_.real_time_factor = 0;
  problem_.clear();
  session_.publications->announce(clock_.stamp());
  update_status();
  std::set<std::string> topics = topics_of(session_);
  const std::lock_guard<std::mutex> lock(mutex_);
  tools_ = session_.tools;
  topics_ = std::move(topics);
}

bool SimulationThread::active() const {
  return !run_.blew_up && (!run_.paused || steps_left_ > 0 || !cuts_.empty());
}

bool SimulationThread::frame_due() {
  if (!active()) return false;
  // What somebody waits for does not wait for a clock or an instrument that stands still.
  const bool stepped = parameters_.time == TimeMode::kLockstep && !cuts_.empty();
  return steps_left_ > 0 || run_.paused || stepped || clock_.due(*session_.tools);
}

void SimulationThread::run() {
  try {
    run_frames();
  } catch (const Stopped&) {  // the node ends
  } catch (const std::exception& e) {
    // Of what is left nothing can be relied on; nor may it take others in this process along.
    ROS_FATAL("the simulation ends: %s", e.what());
    ros::requestShutdown();
  }
}

void SimulationThread::run_frames() {
  WallTime shown = WallClock::now();
  for (;;) {
    std::vector<std::function<void()>> work;
    std::optional<ros::Time> jumped_from;
    {
      const WallTime now = WallClock::now();
      const WallTime until = frame_due() ? now : active() ? clock_.wake() : now + kHold;
      std::unique_lock<std::mutex> lock(mutex_);
      wake_.wait_until(lock, until, [this] { return stop_ || woken_ || !work_.empty(); });
      if (stop_) return;
      work.swap(work_);
      woken_ = false;
      jumped_from = std::exchange(jumped_from_, std::nullopt);
      clock_.set_ros_time(ros_time_);
    }
    if (jumped_from) start_anew(*jumped_from, clock_.ros_time());
    for (const std::function<void()>& each : work) each();
    const WallTime now = WallClock::now();
    if (frame_due()) {
      frame();
      if (active()) shown = now;
      continue;
    }
    if (parameters_.publish_clock) say_time_(clock_.stamp());  // for who has just come
    if (!active() || parameters_.time != TimeMode::kWall) {
      if (now - shown >= kShownAtRest) {
        shown = now;
        run_.real_time_factor = 0;
        session_.publications->show(*session_.simulation, report_, run_, clock_.stamp());
        if (active()) update_status();
      }
      if (!active()) session_.publications->hold(report_, run_, clock_.stamp());
    }
  }
}

void SimulationThread::start_anew(const ros::Time& before, const ros::Time& now) {
  ROS_WARN("/clock jumped back to %.3f s: the scene starts anew", now.toSec());
  for (const auto& tool : *session_.tools) tool->restart(before, now);
  const Scene scene = session_.simulation->scene();
  const LimitWork limit(parameters_.limits());
  const PermitFolders folders(session_.folders);
  try {
    session_.simulation.reset();  // its memory, before the next one's
    session_.simulation = std::make_unique<Simulation>(scene);
  } catch (const std::exception& e) {
    ROS_FATAL("the scene cannot be built again: %s", e.what());
    throw;
  }
  start_session();
}

FrameRequest SimulationThread::request(const std::vector<PendingCut>& cuts) {
  Simulation& simulation = *session_.simulation;
  const double reach = parameters_.max_tool_speed / simulation.scene().frame_rate;
  const bool in_turn = !run_.paused && steps_left_ == 0;
  const std::int64_t until = clock_.begin_frame(in_turn, run_.paused);
  FrameRequest request;
  for (const auto& input : *session_.tools) {
    const ToolMotion& was = simulation.tools()[request.tools.size()];
    std::optional<ToolRequest>& tool = request.tools.emplace_back();
    input->ask(until, tool);
    // What an arm did during a pause must not cut a straight line through the tissue now.
    if (tool &&
        (!was.present || (resumed_ && (tool->pose.position - was.end.position).norm() > reach))) {
      tool->placed = true;
    }
  }
  resumed_ = false;
  for (const PendingCut& cut : cuts) request.cuts.push_back(cut.path);
  session_.scene_input->ask(simulation.tissue().moves_anchors(), request);
  return request;
}

void SimulationThread::frame() {
  Simulation& simulation = *session_.simulation;
  std::vector<PendingCut> cuts = std::exchange(cuts_, {});
  const LimitWork limit(parameters_.limits());
  try {
    report_ = simulation.advance_frame(request(cuts));
  } catch (const std::exception& e) {
    if (parameters_.work.stop != nullptr && *parameters_.work.stop) throw;  // the node ends
    for (PendingCut& cut : cuts) cut.reply.set_value({false, e.what(), {}});
    fail(std::string("the simulation failed: ") + e.what() + ": reset it");
    return;
  }
  for (const std::string& note : report_.notes) ROS_WARN("%s", note.c_str());
  const CutReport& by_blades = report_.result.blade_report;
  if (by_blades.pieces_left_whole > 0) {
    WARN_SELDOM(1, "an instrument's cut: %s", by_blades.why_left_whole.c_str());
  }
  if (!run_.paused && parameters_.time != TimeMode::kLockstep) {
    for (std::size_t i = 0; i < report_.result.loads.size(); ++i) {
      if (is_gone((*session_.tools)[i]->status())) report_.result.loads[i].mean = Wrench();
    }
  }
  real_time_factor_.add(WallClock::now(), simulation.time());
  run_.real_time_factor = real_time_factor_.value();
  if (report_.result.blew_up) {
    run_.blew_up = true;
    problem_ = "the simulation blew up in frame " + std::to_string(report_.input.frame) +
               " and stands still: reset it";
  }
  const bool last_step = steps_left_ == 1 || (run_.paused && steps_left_ == 0);
  run_.late_samples = 0;
  for (const auto& tool : *session_.tools) run_.late_samples += tool->late();
  session_.publications->publish(simulation, report_, run_, clock_.end_frame(), last_step);
  if (parameters_.publish_clock) say_time_(clock_.stamp());
  answer_cuts(cuts, report_);
  if (run_.blew_up) {
    fail(problem_);
    return;
  }
  update_status();
  if (steps_left_ > 0 && settling_ && settling_->is_over(report_)) steps_left_ = 1;
  if (steps_left_ > 0 && --steps_left_ == 0) {
    StepReply reply{true, "", simulation.frame(), simulation.time(), {}};
    if (settling_) reply.settled = settling_->end(simulation);
    settling_.reset();
    step_reply_.set_value(reply);
  }
}

void SimulationThread::answer_cuts(std::vector<PendingCut>& cuts, const FrameReport& report) {
  for (std::size_t i = 0; i < cuts.size(); ++i) {
    CutReply reply;
    if (i < report.result.cut_reports.size()) reply.report = report.result.cut_reports[i];
    reply.success = reply.report.points_separated > 0 && !run_.blew_up;
    if (run_.blew_up) {
      reply.message = problem_;
    } else if (reply.report.pieces_left_whole > 0) {
      reply.message = reply.report.why_left_whole;
      if (reply.success) ROS_WARN("cut: %s", reply.message.c_str());  // else its service does
    } else if (!reply.success) {
      reply.message =
          "the cut misses the tissue: nothing lies on the surface that the edge sweeps, or it is "
          "cut already";
    }
    cuts[i].reply.set_value(reply);
  }
}

void SimulationThread::answer_step(const char* interrupted) {
  if (std::exchange(steps_left_, 0) == 0) return;
  if (settling_) settling_->end(*session_.simulation);
  settling_.reset();
  step_reply_.set_value(
      {false, interrupted, session_.simulation->frame(), session_.simulation->time(), {}});
}

void SimulationThread::fail(const std::string& problem) {
  ROS_ERROR("%s", problem.c_str());
  run_.blew_up = true;
  problem_ = problem;
  answer_step(problem.c_str());
  update_status();
}

void SimulationThread::update_status() {
  Tissue& tissue = session_.simulation->tissue();
  RunStatus s;
  s.run = run_;
  s.problem = problem_;
  s.frame = session_.simulation->frame();
  s.time = session_.simulation->time();
  s.frame_rate = session_.simulation->scene().frame_rate;
  s.aimed_factor = parameters_.time == TimeMode::kWall ? parameters_.time_factor : 0;
  const double factor = run_.real_time_factor;
  if (factor > 0 && factor < 0.9 * s.aimed_factor) {
    s.coarser = coarser(session_.simulation->scene(), s.aimed_factor / factor);
  }
  s.behind = clock_.behind();
  s.substeps = report_.result.substeps;
  s.substep = report_.result.substep;
  s.compute_time = report_.compute_time;
  s.particles = tissue.point_count();
  s.fragments = tissue.fragment_count();
  s.device = tissue.device_name();
  s.inside = inside_warning(session_.simulation->scene(), report_.result);
  if (!s.inside.empty()) WARN_SELDOM(5, "%s", s.inside.c_str());
  const std::lock_guard<std::mutex> lock(mutex_);
  status_ = std::move(s);
}

}  // namespace tissue_sim
