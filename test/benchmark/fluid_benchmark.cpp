#include "fluid_benchmark.h"

#include <benchmark/benchmark.h>

#include <string>

#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

/// Water in a dish of tissue: 10 000 drops beside 25 000 points, or 100 000 beside 80 000.
struct Dish {
  double width = 1, spacing = 0.003;  ///< times the smaller's; of drops [m]
};
constexpr Dish kSmall{}, kLarge{2, 0.0023};

/// The dish alone where it is not full.
Scene scene_of(const Dish& dish, bool full, Device device, int threads) {
  Scene scene;
  scene.device = device;
  scene.threads = threads;
  scene.cell_size = 0.004;
  scene.fluid_spacing = dish.spacing;
  Material soft;
  soft.name = "soft";
  soft.young_modulus = 10e3;
  soft.poisson_ratio = 0.4;
  scene.materials = {soft};
  Body slab;
  slab.material = "soft";
  slab.size = Vec3(0.152 * dish.width, 0.096 * dish.width, 0.008);
  slab.pose.position.z() = 0.004;
  Region below;
  below.z = 0.004;
  slab.anchors = {below};
  scene.bodies = {slab};
  Body wall = slab;
  wall.size = Vec3(0.012, 0.096 * dish.width, 0.036);
  for (const double side : {-1.0, 1.0}) {
    wall.name = side < 0 ? "left" : "right";
    wall.pose.position = Vec3((0.076 * dish.width - 0.006) * side, 0, 0.0261);
    wall.anchors[0].z = 0.0121;  // its lowest cells
    scene.bodies.push_back(wall);
  }
  Pool pool;
  pool.region.kind = Region::Kind::kBox;
  const double inner = 0.076 * dish.width - 0.012;
  pool.region.min = Vec3(-inner, -0.048 * dish.width, 0.008);
  pool.region.max = Vec3(inner, 0.048 * dish.width, 0.032);
  if (full) scene.pools = {pool};
  for (int k = 0; k < 2; ++k) {
    Tool plate;
    plate.name = "plate" + std::to_string(k);
    plate.type = ToolType::kPlate;
    plate.size = Vec3(0.3 * dish.width, 0.14, 0.01);
    scene.tools.push_back(plate);
  }
  return scene;
}

void add_row(const std::string& name, const Dish& dish, bool full, Device device, int threads) {
  benchmark::RegisterBenchmark(
      name.c_str(),
      [=](benchmark::State& bench) {
        Simulation simulation(scene_of(dish, full, device, threads));
        FrameRequest request;
        for (const double side : {-1.0, 1.0}) {
          ToolRequest plate;
          plate.pose = {Vec3(0, (0.048 * dish.width + 0.0002) * side, 0.06),
                        Quat::FromTwoVectors(Vec3::UnitZ(), Vec3(0, -side, 0))};
          request.tools.emplace_back(plate);
        }
        for (int i = 0; i < 3; ++i) simulation.advance_frame(request);
        for (auto _ : bench) {
          if (simulation.advance_frame().result.blew_up) return bench.SkipWithError("blew up");
        }
        bench.counters["fluid"] = simulation.tissue().fluid_particle_count();
        bench.counters["tissue"] = simulation.tissue().point_count();
        bench.counters["of_real_time"] = benchmark::Counter(
            static_cast<double>(bench.iterations()) / simulation.scene().frame_rate,
            benchmark::Counter::kIsRate);
      })
      ->Unit(benchmark::kMillisecond)
      ->UseRealTime()
      ->Iterations(8);
}

}  // namespace

void add_fluid_rows() {
  for (const bool full : {false, true}) {
    for (const int threads : {1, 2}) {
      add_row("fluid/cpu/" + std::string(full ? "10000_beside_25000" : "tissue_alone") +
                  "/threads:" + std::to_string(threads),
              kSmall, full, Device::kCpu, threads);
    }
  }
}

void add_fluid_cuda_rows() {
  add_row("fluid/cuda/10000_beside_25000", kSmall, true, Device::kCuda, 0);
  add_row("fluid/cuda/100000_beside_80000", kLarge, true, Device::kCuda, 0);
}

}  // namespace tissue_sim
