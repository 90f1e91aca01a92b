#include "benchmark/camera_benchmark.h"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <future>
#include <string>
#include <vector>

#include "tissue_sim/renderer.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

using Clock = std::chrono::steady_clock;

/// An ellipsoid of liver of so many points, held at its bottom, pressed by a probe, seen by a
/// stereo camera.
Scene seen_organ(Device device, int points, double rate) {
  const Vec3 of_unit(1.6, 1.1, 0.75);
  const Vec3 r = 1e-3 * std::cbrt(points / 8.0 / (4.0 / 3 * EIGEN_PI * of_unit.prod())) * of_unit;
  const Quat down(Eigen::AngleAxisd(EIGEN_PI, Vec3::UnitX()));
  Scene scene;
  scene.device = device;
  scene.damping = 2;
  scene.cell_size = 1e-3;
  scene.ground.enabled = false;
  scene.bodies.resize(1);
  Body& body = scene.bodies[0];
  body.shape = Shape::kEllipsoid;
  body.radii = body.pose.position = r;
  Region below;
  below.z = 0.2 * r[2];
  body.anchors = {below};
  Material soft;
  soft.name = body.material = "soft";
  soft.young_modulus = 5e3;
  soft.poisson_ratio = 0.45;
  scene.materials = {soft};
  Tool probe;
  probe.type = ToolType::kProbe;
  probe.name = "probe";
  probe.radius = 0.3 * r[2];
  scene.tools = {probe};
  Camera camera;
  camera.baseline = 0.005;
  camera.rate = rate;
  camera.pose = {Vec3(r[0], r[1], 4.5 * r[2]), down};
  scene.cameras = {camera};
  return scene;
}

/// As the node's thread of images: a view is taken when one is due and the last is drawn.
class Eyes {
 public:
  Eyes(const Scene& scene) : camera_(scene.cameras[0]), renderer_(scene) {}
  ~Eyes() {
    if (drawn_.valid()) drawn_.wait();
  }
  /// Counts pairs of images begun.
  int pairs() const { return pairs_; }
  double tissue_pixels() const { return tissue_pixels_; }
  /// The simulation's thread has spent on views, and the other one on a pair, in the mean [s].
  double view_time() const { return viewed_ / pairs_; }
  double draw_time() const { return drew_ / pairs_; }
  void look(Simulation& simulation) {
    const double now = std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
    if (now < due_) return;
    if (drawn_.valid() && drawn_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) {
      return;
    }
    due_ = std::max(due_ + 1 / camera_.rate, now);
    const Clock::time_point begin = Clock::now();
    read_view(simulation, view_);
    viewed_ += std::chrono::duration<double>(Clock::now() - begin).count();
    ++pairs_;
    drawn_ = std::async(std::launch::async, [this] {
      const Clock::time_point start = Clock::now();
      renderer_.show(view_);
      Pose eye = camera_.pose;
      renderer_.render(camera_, eye, images_);
      eye.position += eye.orientation * Vec3(camera_.baseline, 0, 0);
      renderer_.render(camera_, eye, images_);
      drew_ += std::chrono::duration<double>(Clock::now() - start).count();
      const auto seen = std::count_if(images_.labels.begin(), images_.labels.end(),
                                      [](auto label) { return label >= kFirstFragmentLabel; });
      tissue_pixels_ = static_cast<double>(seen) / static_cast<double>(images_.labels.size());
    });
  }

 private:
  const Camera camera_;
  Renderer renderer_;
  SceneView view_;
  CameraImages images_;
  std::future<void> drawn_;
  double due_ = 0, tissue_pixels_ = 0, viewed_ = 0, drew_ = 0;
  int pairs_ = 0;
};

double median(std::vector<double> of) {
  std::sort(of.begin(), of.end());
  return of[of.size() / 2];
}

/// Frames as fast as they go, half of them with eyes open, in turn; clouds of all points at 30 Hz
/// of simulated time in both halves.
void watch(benchmark::State& bench, const Scene& scene) {
  constexpr int kTurn = 120;
  try {
    Simulation simulation(scene);
    Eyes eyes(scene);
    std::vector<std::uint8_t> cloud;
    const double top = 2 * scene.bodies[0].radii[2];
    const auto frame = [&] {
      const double deep = 0.13 * top * std::min(1.0, simulation.time() / 0.2) - 0.01 * top;
      Pose tip = scene.cameras[0].pose;
      tip.position[2] = top - deep;
      simulation.set_tool(0, tip);
      simulation.advance_frame();
      if (simulation.frame() % 2 == 0) simulation.tissue().read_points({}, cloud);
    };
    for (int i = 0; i < 20; ++i) frame();
    std::vector<double> seconds[2];
    double watched = 0;
    for (auto _ : bench) {
      for (const bool open : {false, true}) {
        const Clock::time_point begin = Clock::now();
        for (int i = 0; i < kTurn; ++i) {
          frame();
          if (open) eyes.look(simulation);
        }
        seconds[open].push_back(std::chrono::duration<double>(Clock::now() - begin).count());
        if (open) watched += seconds[open].back();
      }
    }
    const double alone = median(seconds[0]), beside = median(seconds[1]);
    bench.counters["slower"] = beside / alone - 1;
    bench.counters["pairs_per_s"] = eyes.pairs() / watched;
    bench.counters["real_time_factor"] = kTurn / scene.frame_rate / beside;
    bench.counters["view_ms"] = 1e3 * eyes.view_time();
    bench.counters["draw_ms"] = 1e3 * eyes.draw_time();
    bench.counters["tissue_pixels"] = eyes.tissue_pixels();
    bench.counters["points"] = simulation.tissue().point_count();
    bench.SetLabel(simulation.tissue().device_name());
  } catch (const std::exception& e) {  // no GPU, for instance
    bench.SkipWithError(e.what());
  }
}

}  // namespace

void add_camera_benchmarks(Device device) {
  if (!can_render()) return;
  const bool on_gpu = device == Device::kCuda;
  const int points = on_gpu ? 1000000 : 15000;
  const Scene scene = seen_organ(device, points, on_gpu ? 30 : 15);
  const std::string name =
      std::string("cameras/") + (on_gpu ? "cuda/" : "cpu/") + std::to_string(points);
  benchmark::RegisterBenchmark(name.c_str(), [scene](benchmark::State& s) { watch(s, scene); })
      ->UseRealTime()
      ->Iterations(7)
      ->Unit(benchmark::kMillisecond);
}

}  // namespace tissue_sim
