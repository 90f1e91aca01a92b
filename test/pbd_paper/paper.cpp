// The experiments of Lee et al. 2022 with meshes of one's own: CSV on the standard output.
//   tissue_sim_pbd_paper MODEL EXPERIMENT SURFACE TETRAHEDRA [NAME=NUMBER ...]
// NAME: young_modulus, poisson_ratio, damping, steps, iterations, edge, bending, internal, stretch,
// shear, turn_x (the body's, in degrees). MODEL: internal (surface with internal constraints), bare
// (without), strain (the paper's tetrahedra), material. EXPERIMENT: fall (extent and volume over
// time, and the surface's vertices where a body of internal constraints has some), plate, rate
// (solver time of a frame). Bodies are scaled to 20 cm and stand upright on the ground.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "geometry/mesh.h"
#include "pbd/pbd_tissue.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

constexpr double kSize = 0.2;  // [m]

struct Extent {
  Vec3 min = Vec3::Constant(1e9), max = Vec3::Constant(-1e9), mean = Vec3::Zero();
};

Extent extent(const pbd::State& s) {
  Extent e;
  int count = 0;
  for (int i = 0; i < s.vertices.size(); ++i) {
    if (s.vertices.surface[i] == 0) continue;
    const Vec3 x = s.vertices.position(i);
    e.min = e.min.cwiseMin(x);
    e.max = e.max.cwiseMax(x);
    e.mean += x;
    ++count;
  }
  e.mean /= count;
  return e;
}

/// What the surface encloses [m^3]; of an open one, about its own middle.
double enclosed(const pbd::State& s) {
  const Vec3 o = extent(s).mean;
  double six = 0;
  for (const pbd::Triangle& t : s.triangles) {
    const Vec3 a = s.vertices.position(t[0]) - o, b = s.vertices.position(t[1]) - o;
    six += a.cross(b).dot(s.vertices.position(t[2]) - o);
  }
  return six / 6;
}

pbd::State& state(Simulation& simulation) {
  return static_cast<PbdTissue&>(simulation.tissue()).state();
}

/// Sets what NAME=NUMBER says.
void set(Scene& scene, const std::string& asked) {
  const std::size_t sign = asked.find('=');
  const std::string name = asked.substr(0, sign);
  const double value = sign == std::string::npos ? 0 : std::stod(asked.substr(sign + 1));
  PbdOptions& pbd = scene.pbd;
  const std::map<std::string, double*> fields = {
      {"young_modulus", &scene.materials[0].young_modulus},
      {"poisson_ratio", &scene.materials[0].poisson_ratio},
      {"damping", &scene.damping},
      {"edge", &pbd.edge},
      {"bending", &pbd.bending},
      {"internal", &pbd.internal},
      {"stretch", &pbd.stretch},
      {"shear", &pbd.shear}};
  if (name == "turn_x") {
    scene.bodies[0].pose.orientation =
        Quat(Eigen::AngleAxisd(value / 180 * std::acos(-1), Vec3::UnitX()));
  } else if (name == "iterations") {
    pbd.iterations = static_cast<int>(value);
  } else if (name == "steps") {
    pbd.steps = static_cast<int>(value);
  } else if (fields.count(name) != 0) {
    *fields.at(name) = value;
  } else {
    throw std::invalid_argument(name + " is no name that this program knows");
  }
}

Scene scene_of(const std::string& model, const std::string& mesh,
               const std::vector<std::string>& asked) {
  Scene scene;
  scene.method = Method::kPbd;
  scene.device = Device::kCpu;
  scene.pbd.steps = 20;
  Material m;
  m.name = "rubber";
  m.young_modulus = 3e4;
  m.poisson_ratio = 0.4;
  m.density = 1000;
  scene.damping = 1;
  scene.materials = {m};
  scene.bodies.resize(1);
  scene.bodies[0].shape = Shape::kMesh;
  scene.bodies[0].mesh = mesh;
  scene.bodies[0].material = m.name;
  scene.pbd.model =
      model == "internal" || model == "bare" ? PbdModel::kSurface : PbdModel::kTetrahedra;
  if (model == "bare") scene.pbd.internal = 0;
  if (model == "strain") scene.pbd.elasticity = PbdElasticity::kStrain;
  for (const std::string& a : asked) set(scene, a);
  // Its size in the file's units is not known before it was read.
  scene.gravity = Vec3::Zero();
  scene.ground.enabled = false;
  Extent e;
  try {
    Simulation once(scene);
    e = extent(state(once));
  } catch (const std::invalid_argument&) {  // larger than 10 m
    scene.bodies[0].scale = 0.01;
    Simulation once(scene);
    e = extent(state(once));
  }
  const double more = kSize / (e.max - e.min).maxCoeff();
  scene.bodies[0].scale *= more;
  const Vec3 middle = 0.5 * (e.min + e.max);
  scene.bodies[0].pose.position = Vec3(-more * middle.x(), -more * middle.y(), -more * e.min.z());
  scene.gravity = Vec3(0, 0, -9.81);
  scene.ground.enabled = true;
  scene.ground.friction = 0.5;
  return scene;
}

void print_counts(Simulation& simulation) {
  const pbd::State& s = state(simulation);
  std::printf(
      "# vertices %d, triangles %zu, tetrahedra %zu; constraints: distance %d (internal "
      "%zu), bending %d, strain %d, material %d\n",
      s.vertices.size(), s.triangles.size(), s.tetrahedra.size(), s.links.size(), s.internal.size(),
      s.bends.size(), s.strains.size(), s.elastics.size());
}

void print_row(Simulation& simulation, double whole) {
  const Extent e = extent(state(simulation));
  const Vec3 size = e.max - e.min;
  std::printf("%.4f,%.5f,%.5f,%.5f,%.5f,%.5f,%.5f,%.5f,%.4f\n", simulation.time(), size.x(),
              size.y(), size.z(), e.mean.x(), e.mean.y(), e.mean.z(), e.min.z(),
              enclosed(state(simulation)) / whole);
}

void fall(Scene scene) {
  scene.bodies[0].pose.position.z() += 0.1;
  Simulation simulation(scene);
  print_counts(simulation);
  const double whole = enclosed(state(simulation));
  std::printf("time,size_x,size_y,size_z,x,y,z,lowest,volume\n");
  print_row(simulation, whole);
  for (int f = 0; f < 90; ++f) {
    simulation.advance_frame();
    print_row(simulation, whole);
  }
}

/// A plate comes down to 70 % of the height, waits, and goes up again.
void plate(Scene scene) {
  Tool plate;
  plate.name = "plate";
  plate.type = ToolType::kPlate;
  plate.size = Vec3(0.4, 0.4, 0.01);
  scene.tools = {plate};
  Simulation simulation(scene);
  print_counts(simulation);
  for (int f = 0; f < 300; ++f) simulation.advance_frame();  // it settles
  const double whole = enclosed(state(simulation));
  const double top = extent(state(simulation)).max.z();
  std::printf("time,size_x,size_y,size_z,x,y,z,lowest,volume\n");
  const Quat down(Eigen::AngleAxisd(std::acos(-1), Vec3::UnitX()));
  for (int f = 0; f < 300; ++f) {
    const double pressed = f < 60 ? f / 60.0 : f < 90 ? 1 : f < 150 ? (150 - f) / 60.0 : -5;
    simulation.set_tool(0, {Vec3(0, 0, top * (1.001 - 0.3 * pressed)), down});
    simulation.advance_frame();
    print_row(simulation, whole);
  }
}

/// Solver time of a frame of ten steps, single thread, lying on the ground.
void rate(Scene scene) {
  scene.threads = 1;
  scene.pbd.steps = 10;
  Simulation simulation(scene);
  print_counts(simulation);
  pbd::State& s = state(simulation);
  for (int f = 0; f < 10; ++f) simulation.advance_frame();
  s.colliders.clear();
  std::vector<ColliderLoad> none;
  double best = 1e9;
  for (int round = 0; round < 30; ++round) {
    const auto begin = std::chrono::steady_clock::now();
    for (int i = 0; i < 10; ++i) pbd::step(s, 1.0f / 600, none);
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
    best = std::min(best, took.count());
  }
  std::printf("ms_a_frame\n%.4f\n", 1e3 * best);
}

int run(int argc, char** argv) {
  if (argc < 5) {
    std::fprintf(stderr,
                 "tissue_sim_pbd_paper internal|bare|strain|material fall|plate|rate "
                 "SURFACE TETRAHEDRA [NAME=NUMBER ...]\n");
    return 2;
  }
  const std::string model = argv[1], experiment = argv[2];
  const Scene scene = scene_of(model, model == "internal" || model == "bare" ? argv[3] : argv[4],
                               {argv + 5, argv + argc});
  if (experiment == "fall") fall(scene);
  if (experiment == "plate") plate(scene);
  if (experiment == "rate") rate(scene);
  return 0;
}

}  // namespace
}  // namespace tissue_sim

int main(int argc, char** argv) {
  try {
    return tissue_sim::run(argc, argv);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
}
