#include "fluid/fill.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "geometry/chord.h"
#include "geometry/ray_tree.h"
#include "scene/scene_text.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace {

/// Of what a bulk modulus is over the largest pressure that is asked for: 2 % and less of volume.
constexpr double kStiffness = 60, kSoftest = 1e4;  // [1], [Pa]

Box box_of(const std::vector<Vec3>& places) {
  Box box;
  for (const Vec3& x : places) {
    box.min = box.min.cwiseMin(x);
    box.max = box.max.cwiseMax(x);
  }
  return box;
}

Box box_of(const Region& region) {
  if (region.kind == Region::Kind::kBox) return {region.min, region.max};
  const Vec3 r = Vec3::Constant(region.radius);
  return {region.center - r, region.center + r};
}

/// Whether a place and those a little off it along the axes all are within what `inside` tells.
template <class Inside>
bool is_clear(const Vec3& x, double room, const Inside& inside) {
  if (!inside(x)) return false;
  for (int k = 0; k < 6; ++k) {
    Vec3 y = x;
    y[k / 2] += k % 2 == 0 ? room : -room;
    if (!inside(y)) return false;
  }
  return true;
}

/// Places of a grid within a box whose edges it divides evenly; `cell` is what each stands for [m].
template <class F>
void for_each_place(const Box& box, double spacing, Vec3& cell, const F& f) {
  int n[3];
  double all = 1;
  for (int a = 0; a < 3; ++a) {
    const double size = box.max[a] - box.min[a];
    n[a] = std::max(1, static_cast<int>(std::min(1e6, std::round(size / spacing))));
    cell[a] = size / n[a];
    all *= n[a];
  }
  if (all > static_cast<double>(work_limits().max_points)) {
    throw TooLarge("it takes more than " + std::to_string(work_limits().max_points) +
                   " particles of fluid: raise fluid_spacing, or cell_size");
  }
  for (int k = 0; k < n[2]; ++k) {
    for (int j = 0; j < n[1]; ++j) {
      for (int i = 0; i < n[0]; ++i)
        f(box.min + cell.cwiseProduct(Vec3(i + 0.5, j + 0.5, k + 0.5)));
    }
  }
}

const Vec3& ray() {  // meets edges by chance only
  static const Vec3 direction = Vec3(0.8711, 0.3917, 0.2963).normalized();
  return direction;
}

/// Lets the particles settle within walls that stand still, each with as much volume as makes their
/// mean density that of the pressure.
void settle(FluidState& s, const std::vector<float>& corners, double density) {
  constexpr int kRounds = 60, kSteps = 10;
  FluidWalls walls;
  walls.begin = walls.end = corners;
  FluidDrive drive;
  const double step = stable_fluid_step(s, 0);
  drive.duration = kSteps * step;
  drive.damping = 0.1 / step;
  drive.colliders = [](double) { return std::vector<Collider>(); };
  std::vector<ColliderLoad> none;
  FluidParticles& p = s.particles;
  for (int round = 0; round < kRounds; ++round) {
    stop_if_asked();
    for (Array<float>& v : p.v) std::fill(v.begin(), v.end(), 0.0f);
    advance_fluid(s, drive, walls, none);
    const double mean = std::accumulate(p.dense.begin(), p.dense.end(), 0.0) / p.size();
    for (float& volume : p.volume) volume *= static_cast<float>(density / mean);
  }
  for (Array<float>& v : p.v) std::fill(v.begin(), v.end(), 0.0f);
}

void check_some(int before, const FluidState& s, const std::string& what) {
  if (s.particles.size() > work_limits().max_points) {
    throw TooLarge(what + ": it takes more than " + std::to_string(work_limits().max_points) +
                   " particles of fluid: raise fluid_spacing, or cell_size");
  }
  if (s.particles.size() > before) return;
  throw std::invalid_argument(what + " holds no particle of fluid, which are " + text(s.spacing) +
                              " m apart: lower fluid_spacing, or make it larger");
}

void fill_hollow(const Scene& scene, int b, const std::vector<float>& corners, int kind,
                 FluidState& s) {
  const Body& body = scene.bodies[b];
  const TriangleMesh hollow = hollow_of(body);
  const RayTree tree(hollow);
  FluidState own;
  own.laws = s.laws;
  own.kernel = s.kernel;
  own.spacing = s.spacing;
  own.cpu = s.cpu;
  Vec3 cell;
  for_each_place(box_of(hollow.vertices), s.spacing, cell, [&](const Vec3& x) {
    const bool fits =
        is_clear(x, 0.35 * s.spacing, [&](const Vec3& y) { return tree.winding(y, ray()) > 0; });
    if (fits) add_particle(own, x, Vec3::Zero(), 1, kind, b);
  });
  const std::string what = "bodies[" + std::to_string(b) + "].hollow";
  check_some(0, own, what);
  FluidParticles& p = own.particles;
  std::fill(p.volume.begin(), p.volume.end(), static_cast<float>(signed_volume(hollow) / p.size()));
  settle(own, corners, 1 + body.filled.pressure / s.laws[kind].bulk_modulus);
  const int before = s.particles.size();
  for (int i = 0; i < p.size(); ++i) {
    const int added = add_particle(s, p.position(i), Vec3::Zero(), 1, kind, b);
    s.particles.volume[added] = p.volume[i];
  }
  check_some(before, s, what);
}

void fill_pool(const Scene& scene, std::size_t i, const std::vector<float>& corners, int kind,
               FluidState& s) {
  const Pool& pool = scene.pools[i];
  TriangleMesh surface;
  for (std::size_t c = 0; c < corners.size(); c += 3) {
    surface.vertices.emplace_back(corners[c], corners[c + 1], corners[c + 2]);
    if (c % 9 == 6) {
      const auto last = static_cast<int>(surface.vertices.size());
      surface.triangles.push_back({last - 3, last - 2, last - 1});
    }
  }
  const RayTree tissue(surface);
  const int before = s.particles.size();
  Vec3 cell;
  for_each_place(box_of(pool.region), s.spacing, cell, [&](const Vec3& x) {
    if (!pool.region.contains(x)) return;
    const bool fits = is_clear(x, 0.35 * s.spacing, [&](const Vec3& y) {
      return tissue.winding(y, ray()) <= 0 && !(scene.ground.enabled && y.z() < scene.ground.z);
    });
    if (fits) add_particle(s, x, Vec3::Zero(), cell.prod(), kind, -1);
  });
  check_some(before, s, "pools[" + std::to_string(i) + "].region");
}

}  // namespace

int fluid_kind(const std::vector<Fluid>& kinds, const std::string& name) {
  const auto of =
      std::find_if(kinds.begin(), kinds.end(), [&](const Fluid& f) { return f.name == name; });
  return static_cast<int>(of - kinds.begin());
}

std::vector<Fluid> fluid_kinds(const Scene& scene) {
  std::vector<Fluid> kinds = scene.fluids;
  const auto use = [&](const std::string& name) {
    if (!name.empty() && fluid_kind(kinds, name) == static_cast<int>(kinds.size())) {
      kinds.push_back(find_fluid(scene, name));
    }
  };
  for (const Body& body : scene.bodies) use(body.filled.fluid);
  for (const Pool& pool : scene.pools) use(pool.fluid);
  for (const Body& body : scene.bodies) {
    const auto bleeds = [&](const std::string& material) {
      const Bleeding& of = find_material(scene, material).bleeding;
      if (of.flux > 0) use(of.fluid);
    };
    bleeds(body.material);
    for (const Inclusion& part : body.inclusions) bleeds(part.material);
  }
  for (const Tool& tool : scene.tools) {
    if (tool.type == ToolType::kIrrigation) use(tool.fluid);
  }
  return kinds;
}

std::vector<FluidLaw> fluid_laws(const Scene& scene) {
  const std::vector<Fluid> kinds = fluid_kinds(scene);
  double densest = 0;
  for (const Fluid& f : kinds) densest = std::max(densest, f.density);
  const double weight = densest * scene.gravity.norm();
  double pressure = 0;
  for (const Body& body : scene.bodies) {
    if (body.filled.fluid.empty()) continue;
    const Box box = box_of(hollow_of(body).vertices);
    pressure = std::max(pressure, body.filled.pressure + weight * (box.max.z() - box.min.z()));
  }
  for (const Pool& pool : scene.pools) {
    const Box box = box_of(pool.region);
    const double low = scene.ground.enabled ? std::min(box.min.z(), scene.ground.z) : box.min.z();
    pressure = std::max(pressure, weight * (box.max.z() - low));
  }
  // What tubes and wounds give runs down from there.
  constexpr double kHeight = 0.05;  // [m]
  bool is_any = !scene.pools.empty();
  for (const Body& body : scene.bodies) is_any = is_any || !body.filled.fluid.empty();
  if (!is_any) pressure = weight * kHeight;
  for (const Tool& tool : scene.tools) {
    if (tool.type != ToolType::kIrrigation) continue;
    const double speed = tool.flow / (M_PI * tool.radius * tool.radius);
    pressure = std::max(pressure, 0.5 * densest * speed * speed);
  }
  std::vector<FluidLaw> laws;
  for (const Fluid& f : kinds) {
    const double modulus =
        f.bulk_modulus > 0 ? f.bulk_modulus : std::max(kSoftest, kStiffness * pressure);
    laws.push_back({static_cast<float>(f.density), static_cast<float>(f.viscosity),
                    static_cast<float>(modulus)});
  }
  return laws;
}

void fill_scene(const Scene& scene, const std::vector<float>& corners, FluidState& s) {
  const std::vector<Fluid> kinds = fluid_kinds(scene);
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const std::string& fluid = scene.bodies[b].filled.fluid;
    if (fluid.empty()) continue;
    fill_hollow(scene, static_cast<int>(b), corners, fluid_kind(kinds, fluid), s);
  }
  for (std::size_t i = 0; i < scene.pools.size(); ++i) {
    fill_pool(scene, i, corners, fluid_kind(kinds, scene.pools[i].fluid), s);
  }
}

}  // namespace tissue_sim
