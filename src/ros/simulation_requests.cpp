// What other threads ask of the simulation's thread.
#include <ros/console.h>

#include <algorithm>
#include <map>
#include <stdexcept>
#include <utility>

#include "fragments/piece_colour.h"
#include "ros/simulation_thread.h"

namespace tissue_sim {
namespace {

std::runtime_error ended() { return std::runtime_error("the node is shutting down"); }

}  // namespace

void SimulationThread::post(std::function<void()> work) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (stop_) throw ended();
    work_.push_back(std::move(work));
  }
  wake_.notify_all();
}

template <class Reply, class Work>
Reply SimulationThread::ask(const Work& work) {
  const auto promise = std::make_shared<std::promise<Reply>>();
  std::future<Reply> reply = promise->get_future();
  post([&work, promise] {
    try {
      work(*promise);
    } catch (...) {
      promise->set_exception(std::current_exception());
    }
  });
  try {
    return reply.get();
  } catch (const std::future_error&) {
    throw ended();
  }
}

void SimulationThread::call(const std::function<void()>& work) {
  ask<void>([&work](std::promise<void>& done) {
    work();
    done.set_value();
  });
}

CutReply SimulationThread::cut(const BladePath& path) {
  return ask<CutReply>([&](std::promise<CutReply>& reply) {
    if (run_.blew_up) throw std::runtime_error(problem_);
    cuts_.push_back({path, std::move(reply)});
  });
}

void SimulationThread::order(const std::string& body, const std::string& what, double amount) {
  call([&] {
    if (run_.blew_up) throw std::runtime_error(problem_);
    Simulation& simulation = *session_.simulation;
    const std::vector<Body>& bodies = simulation.scene().bodies;
    const auto of = std::find_if(bodies.begin(), bodies.end(),
                                 [&body](const Body& b) { return b.name == body; });
    if (of == bodies.end()) throw std::runtime_error("body '" + body + "' is not in the scene");
    if (!(amount > 0)) {
      throw std::runtime_error(what + " is " + std::to_string(amount) + ": must be above 0");
    }
    const auto index = static_cast<int>(of - bodies.begin());
    what == "pressure" ? simulation.fill(index, amount) : simulation.drain(index, amount);
  });
}

void SimulationThread::begin_steps(int frames, std::promise<StepReply>& reply) {
  steps_left_ = frames;
  step_reply_ = std::move(reply);
  real_time_factor_.restart();
}

void SimulationThread::refuse_step() const {
  if (run_.blew_up) throw std::runtime_error(problem_);
  if (steps_left_ == 0) return;
  throw std::runtime_error("another step has " + std::to_string(steps_left_) +
                           " frames to go: wait for it");
}

StepReply SimulationThread::step(int frames) {
  return ask<StepReply>([&](std::promise<StepReply>& reply) {
    refuse_step();
    if (!run_.paused && parameters_.time != TimeMode::kLockstep) {
      throw std::runtime_error("the simulation is running: pause it to step it");
    }
    begin_steps(frames, reply);
  });
}

StepReply SimulationThread::settle(const SettleLimits& limits) {
  return ask<StepReply>([&](std::promise<StepReply>& reply) {
    refuse_step();
    settling_.emplace(*session_.simulation, limits);
    begin_steps(settling_->most_frames(), reply);
  });
}

void SimulationThread::set_paused(bool paused) {
  call([this, paused] {
    if (steps_left_ > 0) throw std::runtime_error("a step is running: wait for it");
    if (!paused && run_.blew_up) throw std::runtime_error(problem_);
    if (paused == run_.paused) return;
    run_.paused = paused;
    resumed_ = !paused;
    clock_.resume();
    // What no longer answers to a hand must not go on pushing it.
    for (ToolLoad& load : report_.result.loads) load.mean = Wrench();
    for (Wrench& load : report_.result.anchor_loads) load = Wrench();
    real_time_factor_.restart();
    update_status();
  });
}

void SimulationThread::reset(std::unique_ptr<Simulation> simulation) {
  // The old one is destroyed by the caller, not in the simulation's time.
  call([&] {
    std::swap(session_.simulation, simulation);
    for (const auto& tool : *session_.tools) tool->rewind();
    start_session();
  });
}

void SimulationThread::replace(Session session) {
  call([&] {
    std::swap(session_, session);
    start_session();
  });
}

SavedFrame SimulationThread::save() {
  SavedFrame saved;
  call([&] {
    if (run_.blew_up) throw std::runtime_error(problem_);
    saved = {session_.simulation->frame(), session_.simulation->save()};
  });
  return saved;
}

ShownSurface SimulationThread::surface() {
  ShownSurface shown;
  call([&] {
    if (run_.blew_up) throw std::runtime_error(problem_);
    Tissue& tissue = session_.simulation->tissue();
    shown.frame = session_.simulation->frame();
    tissue.read_surface(shown.triangles);
    std::map<int, std::uint32_t> of_piece;
    for (const Fragment& f : tissue.fragments()) of_piece[f.id] = piece_colour(f);
    for (const std::int32_t id : shown.triangles.fragment) shown.colours.push_back(of_piece[id]);
  });
  return shown;
}

void SimulationThread::restore(std::unique_ptr<Simulation> simulation,
                               const std::vector<std::uint8_t>& state) {
  call([&] {
    std::swap(session_.simulation, simulation);
    const std::vector<ToolMotion>& motions = session_.simulation->tools();
    for (std::size_t i = 0; i < motions.size(); ++i) {
      ToolInput& tool = *(*session_.tools)[i];
      motions[i].present ? tool.go_on(motions[i]) : tool.rewind();
    }
    start_session();
    session_.publications->record_state(*session_.simulation, state, clock_.stamp());
  });
}

std::int64_t SimulationThread::record_state() {
  std::int64_t frame = -1;
  call([&] {
    frame = session_.simulation->frame();
    if (frame == 0) return;
    try {
      session_.publications->record_state(*session_.simulation, session_.simulation->save(),
                                          clock_.stamp());
    } catch (const std::exception& e) {
      ROS_WARN("the recording begins without a state: %s", e.what());
      frame = -1;
    }
  });
  return frame;
}

void SimulationThread::record_scene() {
  call([this] { session_.publications->record_scene(clock_.stamp()); });
}

void SimulationThread::on_clock(const ros::Time& now) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (now < ros_time_) jumped_from_ = std::max(ros_time_, jumped_from_.value_or(ros_time_));
    ros_time_ = now;
    woken_ = true;
  }
  wake_.notify_all();
}

void SimulationThread::on_sample() {
  if (parameters_.time == TimeMode::kWall) return;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    woken_ = true;
  }
  wake_.notify_all();
}

RunStatus SimulationThread::status() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return status_;
}

std::shared_ptr<ToolInputs> SimulationThread::tools() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return tools_;
}

std::set<std::string> SimulationThread::topics() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return topics_;
}

}  // namespace tissue_sim
