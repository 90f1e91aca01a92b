// Particle updates a second of the material point method on the GPU (DESIGN section 7): a cube of
// tissue between two anchored faces that are held apart and sheared, so that it stays deformed.
#include <benchmark/benchmark.h>

#include <Eigen/SVD>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>

#include "benchmark/liver_benchmark.h"
#include "compute/cuda_check.h"
#include "math/bspline.h"
#include "mpm/cuda/cuda_mpm_tissue.h"
#include "mpm/mpm_tissue.h"

namespace tissue_sim {
namespace {

enum class Extra { kNone, kOrgan, kCutOrgan, kCut, kContact, kAtRest, kTools, kAll };

struct Size {
  int points;   // as the benchmark is called
  int x, y, z;  // cells
};
constexpr Size kSizes[] = {{25000, 15, 15, 14},   {100000, 23, 23, 24},  {262000, 32, 32, 32},
                           {1000000, 50, 50, 50}, {4100000, 80, 80, 80}, {16800000, 128, 128, 128}};

Scene cube(const Size& size, Law law) {
  Scene scene;
  scene.cell_size = 0.001;
  scene.ground.z = -1;
  scene.bodies.resize(1);
  Body& body = scene.bodies[0];
  body.size = 0.001 * Vec3(size.x, size.y, size.z);
  body.pose.position = 0.5 * body.size;
  Region below, above;
  below.z = 0.0011;
  above.kind = Region::Kind::kBox;
  above.min = Vec3(-1, -1, body.size[2] - 0.0011);
  above.max = Vec3(1, 1, 1);
  body.anchors = {below, above};
  scene.materials.resize(1);
  scene.materials[0].name = "test";
  scene.materials[0].law = law;
  body.material = "test";
  return scene;
}

/// An ellipsoid instead of the cube, of its volume, held at either end along z.
void make_organ(Scene& scene) {
  Body& body = scene.bodies[0];
  const Vec3 of_unit(1.6, 1.1, 0.75);
  const double scale = std::cbrt(body.size.prod() / (4.0 / 3 * M_PI * of_unit.prod()));
  body.shape = Shape::kEllipsoid;
  body.radii = scale * of_unit;
  body.pose.position = body.radii;
  body.anchors[0].z = 0.1 * body.radii[2];
  body.anchors[1].min[2] = 1.9 * body.radii[2];
}

/// Stretch along z by this much and shear, and waves of some cells' length.
void deform(MpmState& state, double stretch) {
  const LatticeBody& b = state.bodies[0];
  b.for_each_node([&](int node, int i, int j, int k) {
    const double x = i + 1, y = j + 1, z = k + 1;
    const double h = b.cell_size;
    const double u[3] = {h * (0.3 * z + 0.1 * std::sin(0.4 * y)), h * 0.1 * std::sin(0.5 * x + z),
                         h * (stretch * z + 0.1 * std::sin(0.3 * x))};
    for (int a = 0; a < 3; ++a) state.nodes.u[a][node] = static_cast<float>(u[a]);
  });
}

void add_probes(Scene& scene, std::vector<ToolMotion>& motions) {
  const Vec3 size = scene.bodies[0].size;
  scene.tools.resize(3);
  motions.resize(3);
  for (int i = 0; i < 3; ++i) {
    scene.tools[i].name = "probe" + std::to_string(i);
    // From the side: its tip a millimetre deep in the face y = 0.
    ToolMotion& m = motions[i];
    m.present = true;
    m.begin.orientation = Quat::FromTwoVectors(Vec3::UnitZ(), Vec3::UnitY());
    m.begin.position = Vec3(0.25 * (i + 1) * size[0] + 0.15 * size[2], 0.0015, 0.5 * size[2]);
    m.end = m.begin;
  }
}

/// Largest ||F - R||, from the clouds' von Mises stress being no measure of it: on the host.
double largest_strain(const MpmState& s) {
  double largest = 0;
  const LatticeBody& b = s.bodies[0];
  for (int p = 0; p < s.points.size(); p += 1 + s.points.size() / 20000) {
    const Points::Site& site = s.points.site[p];
    Eigen::Matrix3d F = Eigen::Matrix3d::Identity();
    for (int k = 0; k < 27; ++k) {
      const int n = s.fields->node(b, site, k);
      const int i[3] = {k % 3, k / 3 % 3, k / 9}, t[3] = {site.x & 1, site.y & 1, site.z & 1};
      for (int a = 0; a < 3; ++a) {
        double w = 1 / b.cell_size;
        for (int c = 0; c < 3; ++c) {
          w *= c == a ? lattice_slope(t[c], i[c]) : lattice_weight(t[c], i[c]);
        }
        for (int c = 0; c < 3; ++c) F(c, a) += w * s.nodes.u[c][n];
      }
    }
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
    largest = std::max(largest, (F - svd.matrixU() * svd.matrixV().transpose()).norm());
  }
  return largest;
}

/// A second material, viscosity, a limit at which it tears, and a scalpel beside it.
void add_options(Scene& scene, std::vector<ToolMotion>& motions) {
  Material other = scene.materials[0];
  other.name = "other";
  other.young_modulus *= 1.5;
  scene.materials.push_back(other);
  for (Material& m : scene.materials) {
    m.viscosity = 1;
    m.tear_stretch = 50;
  }
  const Vec3 size = scene.bodies[0].size;
  Inclusion ball;
  ball.material = other.name;
  ball.region.kind = Region::Kind::kBall;
  // Beside the cut: a facet of two materials is one on the CPU and two on the GPU.
  ball.region.center = Vec3(0.5, 0.22, 0.5).cwiseProduct(size);
  ball.region.radius = 0.15 * size[0];
  scene.bodies[0].inclusions.push_back(ball);
  scene.tools.emplace_back();
  scene.tools.back().name = "scalpel";
  scene.tools.back().type = ToolType::kScalpel;
  scene.tools.back().blade_length = 0.01;
  motions.emplace_back();
  ToolMotion& m = motions.back();
  m.present = true;
  m.begin.position = Vec3(size[0] + 0.15 * size[2] + 0.002, 0.5 * size[1], 0.5 * size[2]);
  m.end = m.begin;
}

/// Of the nodes of `a`; `b` may have more, for it numbers all of its box.
double difference(const MpmState& a, const MpmState& b, double& moved) {
  double worst = 0;
  moved = 0;
  const auto compare = [&](int i, int j) {
    for (int c = 0; c < 3; ++c) {
      if (a.nodes.inv_mass[i] == 0) continue;
      worst = std::max<double>(worst, std::fabs(a.nodes.v[c][i] - b.nodes.v[c][j]));
      moved = std::max<double>(moved, std::fabs(a.nodes.v[c][i]));
    }
  };
  a.bodies[0].for_each_node(
      [&](int node, int x, int y, int z) { compare(node, b.bodies[0].node(x, y, z)); });
  const int split = lattice_node_count(a.bodies), other = lattice_node_count(b.bodies);
  for (int i = split; i < static_cast<int>(a.nodes.size()); ++i) compare(i, i - split + other);
  return worst;
}

/// The faces of a cut that was made, or that a torn thread left, shall not touch: for the cost of
/// the cut alone.
void let_pass(MpmState& state) { state.faces.until_search = 1e9; }

void run(benchmark::State& bench, const Size& size, Law law, Extra extra) {
  const std::string why = why_no_gpu();
  if (!why.empty()) {
    bench.SkipWithError(why.c_str());
    return;
  }
  Scene scene = cube(size, law);
  if (extra == Extra::kOrgan || extra == Extra::kCutOrgan) make_organ(scene);
  std::vector<ToolMotion> tools;
  if (extra == Extra::kTools || extra == Extra::kAll) add_probes(scene, tools);
  if (extra == Extra::kAll) add_options(scene, tools);
  CudaMpmTissue tissue(scene);
  // Pressed flat, the two halves bulge against one another.
  const bool in_contact =
      extra == Extra::kContact || extra == Extra::kAtRest || extra == Extra::kAll;
  const double stretch = in_contact ? -0.15 : 0.15;
  deform(tissue.state(), stretch);
  tissue.push();
  const float dt = 0.5f * tissue.stable_substep();
  std::vector<BladePath> cuts;
  const bool passes = extra == Extra::kCut || extra == Extra::kCutOrgan;
  const bool is_cut = passes || in_contact;
  if (is_cut) {
    BladePath path;
    path.edge = {Vec3(0, 0, -1), Vec3(0, 0, 1)};
    const Vec3 middle = scene.bodies[0].pose.position;
    path.poses = {{Vec3(-0.5, middle[1] - 0.02, 0), Quat::Identity()},
                  {Vec3(0.5, middle[1] + 0.02, 0), Quat::Identity()}};
    cuts.push_back(path);
  }
  tissue.advance(0, dt, {tools, cuts});
  const FrameResult cut = tissue.finish();
  if (is_cut && cut.cut_reports[0].bonds_broken == 0) bench.SkipWithError("no cut");
  if (passes) let_pass(tissue.state());
  if (size.points <= 1000000) {  // against the CPU, ten substeps on
    MpmTissue cpu(scene);
    deform(cpu.state(), stretch);
    measure_motion(cpu.state());
    cpu.advance(0, dt, {tools, cuts});
    if (passes) let_pass(cpu.state());
    cpu.advance(10, dt, {tools, {}});
    cpu.finish();
    tissue.advance(10, dt, {tools, {}});
    tissue.finish();
    tissue.pull();
    double moved = 0;
    const double worst = difference(cpu.state(), tissue.state(), moved);
    bench.counters["v_error"] = worst / moved;
    // Faces of a fresh cut are zero deep in one another: whether one touches is a matter of
    // rounding, and light nodes show it.
    const double bound = in_contact ? 2e-2 : 1e-3;
    if (!(worst < bound * moved)) {
      const std::string by = std::to_string(worst / moved);
      bench.SkipWithError(("the GPU's velocities are not the CPU's, by " + by).c_str());
    }
  }
  constexpr int kSubsteps = 200;
  // Substeps so short that next to nothing moves, and nothing is searched anew: as at rest.
  const float substep = extra == Extra::kAtRest ? 0.01f * dt : dt;
  bool blew_up = false;
  const auto advance = [&] {
    if (passes) let_pass(tissue.state());
    tissue.advance(kSubsteps, substep, {tools, {}});
    blew_up = tissue.finish().blew_up || blew_up;
  };
  advance();
  const auto begin = std::chrono::steady_clock::now();
  for (auto _ : bench) advance();
  const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - begin;
  tissue.pull();
  const double strain = largest_strain(tissue.state());
  if (blew_up) bench.SkipWithError("blew up");
  if (!(strain > 0.1)) bench.SkipWithError("not deformed any more");
  const double updates = static_cast<double>(bench.iterations()) * kSubsteps;
  bench.SetItemsProcessed(static_cast<std::int64_t>(updates * tissue.point_count()));
  bench.counters["us_per_substep"] = took.count() / updates;
  bench.counters["points"] = tissue.point_count();
  bench.counters["strain"] = strain;
  if (in_contact) {
    const FaceContacts& faces = tissue.state().faces;
    int touching = 0;
    for (const std::int32_t i : faces.active) touching += faces.all[i].touching ? 1 : 0;
    bench.counters["contacts"] = static_cast<double>(faces.active.size());
    bench.counters["touching"] = touching;
  }
  const auto bytes_per_point = [&] {
    return static_cast<double>(tissue.device_bytes()) / tissue.point_count();
  };
  bench.counters["bytes_per_point"] = bytes_per_point();
  std::vector<std::uint8_t> cloud;
  tissue.read_points({}, cloud);
  bench.counters["bytes_with_cloud"] = bytes_per_point();
  bench.SetLabel(tissue.plan());
}

/// From the last substep to the bytes of a cloud of all points. A message that is new each time has
/// memory that is new to it, which costs more than what is copied into it.
void read(benchmark::State& bench, const Size& size, bool new_memory) {
  const std::string why = why_no_gpu();
  if (!why.empty()) {
    bench.SkipWithError(why.c_str());
    return;
  }
  CudaMpmTissue tissue(cube(size, Law::kFixedCorotated));
  std::vector<std::uint8_t> cloud;
  tissue.read_points({}, cloud);
  for (auto _ : bench) {
    if (new_memory) {
      bench.PauseTiming();
      cloud = {};
      bench.ResumeTiming();
    }
    benchmark::DoNotOptimize(tissue.read_points({}, cloud));
  }
  bench.counters["points"] = tissue.point_count();
  bench.SetBytesProcessed(static_cast<std::int64_t>(bench.iterations() * cloud.size()));
}

void add(const std::string& name, const Size& size, Law law, Extra extra) {
  benchmark::RegisterBenchmark((name + std::to_string(size.points)).c_str(), run, size, law, extra)
      ->UseRealTime()
      ->Unit(benchmark::kMillisecond);
}

}  // namespace
}  // namespace tissue_sim

int main(int argc, char** argv) {
  using namespace tissue_sim;
  for (const Size& size : kSizes) {
    add("mpm/cuda/", size, Law::kFixedCorotated, Extra::kNone);
    add("mpm/cuda/neo_hookean/", size, Law::kNeoHookean, Extra::kNone);
    add("mpm/cuda/ellipsoid/", size, Law::kFixedCorotated, Extra::kOrgan);
    add("mpm/cuda/cut_ellipsoid/", size, Law::kFixedCorotated, Extra::kCutOrgan);
    add("mpm/cuda/cut/", size, Law::kFixedCorotated, Extra::kCut);
    add("mpm/cuda/contact/", size, Law::kFixedCorotated, Extra::kContact);
    add("mpm/cuda/contact_at_rest/", size, Law::kFixedCorotated, Extra::kAtRest);
    add("mpm/cuda/tools/", size, Law::kFixedCorotated, Extra::kTools);
    add("mpm/cuda/all_options/", size, Law::kFixedCorotated, Extra::kAll);
  }
  for (const bool new_memory : {false, true}) {
    benchmark::RegisterBenchmark(
        new_memory ? "mpm/cuda/read_points/new/1000000" : "mpm/cuda/read_points/1000000",
        [=](benchmark::State& bench) { read(bench, kSizes[3], new_memory); })
        ->UseRealTime()
        ->Unit(benchmark::kMillisecond);
  }
  add_liver_benchmarks();
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
