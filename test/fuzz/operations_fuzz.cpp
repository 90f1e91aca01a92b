// Scenes and operations at random by the public API, each method: eight bytes are a seed, and a
// seed is a scene and all that is done in it, within what the node lets through (max_tool_speed,
// max_tool_turn_rate). What is refused is refused by its documented exceptions; nothing that is
// published is ever no number, a state is the same bytes after it was restored, tissue keeps its
// volume, and none blows up.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>
#include <stdexcept>
#include <vector>

#include "bytes.h"
#include "frame/out_of_control.h"
#include "tissue_sim/simulation.h"

namespace {

using namespace tissue_sim;

constexpr int kFrames = 60;
constexpr int kMostPoints = 2500;
constexpr double kSpeed = 5, kTurnRate = 60;  // the node's limits [m/s, rad/s]

class Random {
 public:
  explicit Random(std::uint64_t seed) : generator_(seed) {}
  double between(double low, double high) {
    return std::uniform_real_distribution<>(low, high)(generator_);
  }
  /// Of all magnitudes alike.
  double scale(double low, double high) { return std::exp(between(std::log(low), std::log(high))); }
  int whole(int low, int high) { return std::uniform_int_distribution<>(low, high)(generator_); }
  bool once_in(double n) { return between(0, n) < 1; }
  template <class T>
  T one_of(std::initializer_list<T> all) {
    return all.begin()[whole(0, static_cast<int>(all.size()) - 1)];
  }
  Vec3 place(double far) {
    const double x = between(-far, far), y = between(-far, far);
    return Vec3(x, y, between(-far, far));
  }
  Quat turn(double most) {
    const Vec3 axis = place(1) + Vec3(0, 0, 1e-3);
    return Quat(Eigen::AngleAxisd(between(-most, most), axis.normalized()));
  }

 private:
  std::mt19937_64 generator_;
};

Body body_of(Random& r, double cell, int number) {
  const auto extent = [&] { return cell * r.between(2.2, 9); };
  Body b;
  b.name = "b" + std::to_string(number);
  b.shape = r.one_of({Shape::kBox, Shape::kBox, Shape::kBall, Shape::kEllipsoid, Shape::kCylinder});
  b.material = "m";
  for (double& x : b.size) x = extent();
  for (double& x : b.radii) x = extent() / 2;
  b.radius = extent() / 2;
  b.height = extent();
  const double half = b.shape == Shape::kBox         ? b.size.z() / 2
                      : b.shape == Shape::kBall      ? b.radius
                      : b.shape == Shape::kEllipsoid ? b.radii.z()
                                                     : b.height / 2;
  b.pose.position = r.place(0.02) + Vec3(0.08 * number, 0, 0);
  b.pose.position.z() = half + r.between(0.0001, 0.02);
  if (!r.once_in(1.4)) return b;
  Anchor a;
  a.kind = r.one_of({Region::Kind::kBox, Region::Kind::kBall, Region::Kind::kBelow});
  a.min = b.pose.position - Vec3(0.2, 0.2, 0.2);
  a.max = b.pose.position + Vec3(-0.2 * half, 0.2, 0.2);
  a.center = b.pose.position - Vec3(half, 0, 0);
  a.radius = half * r.between(0.3, 1.2);
  a.z = b.pose.position.z() - half * r.between(0, 0.9);
  b.anchors.push_back(a);
  return b;
}

Scene scene_of(Random& r) {
  Scene s;
  s.device = Device::kCpu;
  s.threads = 1;
  s.method = r.one_of({Method::kMpm, Method::kMls, Method::kPbd});
  s.cell_size = r.once_in(3) ? r.scale(0.002, 0.02) : 0.006;
  s.frame_rate = r.once_in(3) ? r.scale(30, 1000) : 60;
  s.damping = r.once_in(2) ? r.scale(0.01, 100) : 2;
  if (r.once_in(5)) s.gravity = r.place(20);
  if (r.once_in(5)) s.mpm.boundary = MpmBoundary::kLattice;
  if (r.once_in(2)) s.mls.spacing = s.cell_size;
  s.mls.contact = r.one_of({MlsContact::kNodes, MlsContact::kFaces});
  s.pbd.model = r.one_of({PbdModel::kSurface, PbdModel::kTetrahedra});
  s.pbd.elasticity = r.one_of({PbdElasticity::kMaterial, PbdElasticity::kStrain});
  s.ground.enabled = !r.once_in(3);
  Material m;
  m.name = "m";
  m.law = r.one_of({Law::kFixedCorotated, Law::kNeoHookean});
  m.young_modulus = r.once_in(2) ? r.scale(100, 1e5) : 5000;
  m.poisson_ratio = r.between(0, 0.49);
  m.viscosity = r.one_of({0.0, 1.0, r.scale(0.01, 20)});
  if (r.once_in(3)) m.tear_stretch = r.between(1.05, 2);
  s.materials.push_back(m);
  for (int i = 0, n = r.once_in(4) ? 2 : 1; i < n; ++i) {
    s.bodies.push_back(body_of(r, s.cell_size, i));
  }
  for (int i = 0, n = r.whole(0, 3); i < n; ++i) {
    Tool t;
    t.name = "t" + std::to_string(i);
    t.type = r.one_of({ToolType::kScalpel, ToolType::kProbe, ToolType::kGrasper, ToolType::kBall,
                       ToolType::kPunch, ToolType::kPlate});
    t.radius = r.scale(0.0015, 0.02);
    t.edge_radius = std::min(0.4 * t.radius, 0.0005);
    s.tools.push_back(t);
  }
  return s;
}

BladePath path_through(Random& r, const Scene& s) {
  BladePath path;
  const Vec3 centre = s.bodies.front().pose.position + r.place(4 * s.cell_size);
  const Quat turn = r.turn(M_PI);
  for (int i = 0, n = r.whole(2, 8); i < n; ++i) {
    path.poses.push_back({centre + turn * Vec3(0, -0.15 + 0.3 * i / (n - 1), 0), turn});
  }
  path.edge = {Vec3(0, 0, -0.15), Vec3(0, 0, r.once_in(3) ? 0 : 0.15)};
  return path;
}

[[noreturn]] void fail(std::uint64_t seed, std::int64_t frame, const char* what) {
  std::fprintf(stderr, "seed %llu, frame %lld: %s\n", static_cast<unsigned long long>(seed),
               static_cast<long long>(frame), what);
  std::abort();
}

double volume_of(Simulation& s) {
  double volume = 0;
  for (const Fragment& f : s.tissue().fragments()) volume += f.volume;
  return volume;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto seed = FuzzBytes(data, size).take<std::uint64_t>();
  Random r(seed);
  const Scene scene = scene_of(r);
  std::unique_ptr<Simulation> simulation;
  try {
    simulation = std::make_unique<Simulation>(scene);
  } catch (const std::invalid_argument&) {
    return 0;
  }
  if (simulation->tissue().point_count() > kMostPoints) return 0;
  const double volume = volume_of(*simulation);
  const double far = kSpeed / scene.frame_rate, turn = kTurnRate / scene.frame_rate;
  const double hurry = r.one_of({0.001, 0.004, far});  // of this run, a frame [m]
  std::vector<Pose> poses(scene.tools.size(), Pose{Vec3(0, 0, 0.1), Quat(0, 1, 0, 0)});
  std::vector<std::uint8_t> saved;
  for (int i = 0; i < kFrames; ++i) {
    for (std::size_t t = 0; t < poses.size(); ++t) {
      if (r.once_in(3)) continue;
      const Vec3 way = scene.bodies.front().pose.position + r.place(0.03) - poses[t].position;
      poses[t].position += way * std::min(1.0, std::min(hurry, far) / std::max(way.norm(), 1e-9));
      if (r.once_in(10)) {
        poses[t].orientation = (poses[t].orientation * r.turn(std::min(0.3, turn))).normalized();
      }
      simulation->set_tool(static_cast<int>(t), poses[t], r.between(0, 1.2));
    }
    try {
      const int what = r.whole(0, 40);
      if (what < 4) simulation->cut(path_through(r, scene));
      if (what == 4) simulation->set_gravity(r.place(20));
      if (what == 5) simulation->set_damping(r.between(0, 10));
      if (what == 6) simulation->set_damping(std::nan(""));
      if (what == 7) saved = simulation->save();
      if (what == 8 && !saved.empty()) {
        simulation = std::make_unique<Simulation>(scene);
        simulation->restore({saved.data(), saved.size()});
        if (simulation->save() != saved) fail(seed, i, "another state after it was restored");
        for (std::size_t t = 0; t < poses.size(); ++t) poses[t] = simulation->tools()[t].end;
      }
    } catch (const std::invalid_argument&) {
    }
    FrameReport report;
    try {
      report = simulation->advance_frame();
    } catch (const std::exception& e) {
      fail(seed, i, e.what());
    }
    if (report.result.blew_up) fail(seed, i, "blew up");
    if (!is_finite(report.result)) fail(seed, i, "a number that is none");
    // Surfaces of positions close their wounds as they can.
    const double change = std::abs(volume_of(*simulation) / volume - 1);
    if (scene.method != Method::kPbd && !(change < 1e-6)) fail(seed, i, "another volume");
  }
  return 0;
}
