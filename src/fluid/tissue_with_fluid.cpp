#include "fluid/tissue_with_fluid.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "compute/archive.h"
#include "fluid/fill.h"
#include "frame/checksum.h"
#include "frame/out_of_control.h"
#include "geometry/ray_tree.h"
#include "tools/frame_colliders.h"
#include "tools/tool_motion.h"

namespace tissue_sim {
namespace {

/// Substeps of the fluid in an interval, with room to grow faster within a frame. What presses on a
/// wall is as old as that: with more, light walls ring.
constexpr double kStepsOfInterval = 0.96;

Pose between(const Pose& a, const Pose& b, double share) {
  ToolMotion motion;
  motion.begin = a;
  motion.end = b;
  return pose_at(motion, share);
}

/// An input from one share of its frame to another.
struct PartOfInput {
  std::vector<ToolMotion> tools;
  std::vector<AnchorMotion> anchors;
  FrameInput input;

  PartOfInput(const FrameInput& whole, double from, double to) : input(whole) {
    for (const ToolMotion& m : whole.tools) {
      ToolMotion part = m;
      part.begin = pose_at(m, from);
      part.end = pose_at(m, to);
      const auto jaw = [&m](double share) {
        return static_cast<float>(m.jaw_begin + share * (m.jaw_end - m.jaw_begin));
      };
      part.jaw_begin = jaw(from);
      part.jaw_end = jaw(to);
      tools.push_back(part);
    }
    for (const AnchorMotion& m : whole.anchors) {
      anchors.push_back({between(m.begin, m.end, from), between(m.begin, m.end, to)});
    }
    input.tools = tools;
    input.anchors = anchors;
    if (from > 0) input.cuts = {};
  }
};

void add(const CutReport& part, CutReport& sum) {
  sum.bonds_broken += part.bonds_broken;
  sum.points_separated += part.points_separated;
  sum.new_fragments.insert(sum.new_fragments.end(), part.new_fragments.begin(),
                           part.new_fragments.end());
  sum.pieces_left_whole = std::max(sum.pieces_left_whole, part.pieces_left_whole);
  if (!part.why_left_whole.empty()) sum.why_left_whole = part.why_left_whole;
}

/// Adds what an interval, a `weight` of the frame, brought.
void add(const FrameResult& part, double weight, FrameResult& sum) {
  sum.loads.resize(part.loads.size());
  for (std::size_t i = 0; i < part.loads.size(); ++i) {
    const ToolLoad& of = part.loads[i];
    ToolLoad& to = sum.loads[i];
    to.mean.force += weight * of.mean.force;
    to.mean.torque += weight * of.mean.torque;
    to.peak_force = std::max(to.peak_force, of.peak_force);
    to.grip += weight * of.grip;
    to.grip_area += weight * of.grip_area;
    to.jaw_moment += weight * of.jaw_moment;
    to.points_inside = of.points_inside;
    to.inside_depth = of.inside_depth;
  }
  sum.anchor_loads.resize(part.anchor_loads.size());
  for (std::size_t i = 0; i < part.anchor_loads.size(); ++i) {
    sum.anchor_loads[i].force += weight * part.anchor_loads[i].force;
    sum.anchor_loads[i].torque += weight * part.anchor_loads[i].torque;
  }
  sum.cutting_work += part.cutting_work;
  sum.cut_reports.insert(sum.cut_reports.end(), part.cut_reports.begin(), part.cut_reports.end());
  add(part.blade_report, sum.blade_report);
  add(part.tear_report, sum.tear_report);
  sum.substeps += part.substeps;
  sum.substep = std::max(sum.substep, part.substep);
  sum.fragment_candidates += part.fragment_candidates;
  sum.fragment_points += part.fragment_points;
  sum.kinetic_energy = part.kinetic_energy;
  sum.elastic_energy = part.elastic_energy;
  sum.max_speed = part.max_speed;
  sum.blew_up = sum.blew_up || part.blew_up;
}

std::uint32_t rgb_of(const Vec3& color) {
  std::uint32_t rgb = 0;
  for (int a = 0; a < 3; ++a) {
    rgb = rgb << 8 | static_cast<std::uint32_t>(std::lround(255 * color[a]));
  }
  return rgb;
}

/// The tissue's own scene. Position-based dynamics takes a step for each interval, or what is asked
/// for: with two its wall rang at 0.15 m/s for 0.02.
Scene tissue_scene(Scene scene, double interval) {
  const int intervals = static_cast<int>(std::ceil(1 / (scene.frame_rate * interval) - 1e-9));
  scene.pbd.steps = std::max(scene.pbd.steps, intervals);
  return scene;
}

}  // namespace

TissueWithFluid::TissueWithFluid(const Scene& scene, std::vector<std::string> notes, Make make,
                                 std::unique_ptr<FluidDevice> device)
    : scene_(scene),
      cpu_(scene.threads),
      kinds_(fluid_kinds(scene)),
      device_(std::move(device)),
      sources_(scene) {
  fluid_.cpu = &cpu_;
  fluid_.laws = fluid_laws(scene);
  fluid_.spacing =
      static_cast<float>(scene.fluid_spacing > 0 ? scene.fluid_spacing : scene.cell_size);
  fluid_.kernel.reach = kFluidReach * fluid_.spacing;
  const double interval = kStepsOfInterval * stable_fluid_step(fluid_, 0);
  tissue_ = make(tissue_scene(scene, interval), std::move(notes));
  read_walls_on_host();
  fill_scene(scene, walls_.end, fluid_);
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const Fill& fill = scene.bodies[b].filled;
    if (fill.fluid.empty()) continue;
    fills_.push_back({static_cast<std::int32_t>(b), fill.pressure > 0 ? 1 : 0, 0, fill.pressure});
  }
  floor_ = scene.ground.enabled ? scene.ground.z : 1e30;
  for (std::size_t i = 2; i < walls_.end.size(); i += 3)
    floor_ = std::min<double>(floor_, walls_.end[i]);
  for (const float z : fluid_.particles.x[2]) floor_ = std::min<double>(floor_, z);
  floor_ -= 1;
}

bool TissueWithFluid::read_walls_on_host() {
  const std::uint64_t made = surface_.made;
  walls_.begin.swap(walls_.end);
  tissue_->read_surface(surface_);
  walls_.end = surface_.corners;
  const bool were_left = walls_on_gpu_;
  walls_on_gpu_ = false;
  if (made == 0 || surface_.made != made) {
    find_bits();
    if (rest_ != surface_.rest) {  // a cut or a tear made it anew
      rest_ = surface_.rest;
      walls_.begin = walls_.end;
      if (sources_.bleeds()) sources_.find_wounds(surface_, tissue_->fragments());
      return true;
    }
  }
  if (were_left) walls_.begin = walls_.end;
  return false;
}

void TissueWithFluid::begin_on_gpu() {
  device_->send(fluid_);
  const GpuSurface walls = tissue_->surface_on_gpu(surface_);
  if (walls.corners != nullptr) {
    device_->set_walls(walls.corners, walls.triangles, true);
  } else {
    if (walls_on_gpu_) read_walls_on_host();
    device_->set_walls(walls_.end.data(), walls_.size(), true);
  }
}

void TissueWithFluid::read_walls() {
  pushes_on_gpu_ = false;
  const auto set_on_gpu = [this](bool are_new) {
    const GpuSurface walls = tissue_->surface_on_gpu(surface_);
    pushes_on_gpu_ = walls.corners != nullptr;
    if (pushes_on_gpu_) device_->set_walls(walls.corners, walls.triangles, are_new);
  };
  if (device_ != nullptr && !acts_) set_on_gpu(false);
  walls_on_gpu_ = walls_on_gpu_ || pushes_on_gpu_;
  if (pushes_on_gpu_) return;
  const bool are_new = read_walls_on_host();
  if (device_ != nullptr) {
    set_on_gpu(are_new);  // the same bits whether the host knows the walls or not
    if (!pushes_on_gpu_) device_->set_walls(walls_.end.data(), walls_.size(), are_new);
  }
  if (!are_new || fluid_.particles.size() == 0) return;
  if (device_ != nullptr) {
    device_->push_out_of_walls(fluid_);
  } else {
    push_out_of_walls(fluid_, walls_.end);
  }
}

void TissueWithFluid::find_bits() {
  const double drop = std::pow(fluid_.spacing, 3);
  std::vector<std::uint8_t> is_bit;
  for (const Fragment& f : tissue_->fragments()) {
    is_bit.resize(std::max<std::size_t>(is_bit.size(), f.id + 1), 0);
    is_bit[f.id] = f.volume < drop ? 1 : 0;
  }
  fluid_.is_bit.resize(surface_.fragment.size());
  for (std::size_t t = 0; t < surface_.fragment.size(); ++t) {
    fluid_.is_bit[t] = is_bit[surface_.fragment[t]];
  }
}

void TissueWithFluid::advance(double duration, const FrameInput& input) {
  result_ = {};
  follow(input, scene_);
  sort_particles(fluid_);
  follow_orders(input.fluid);
  sources_.begin_frame(duration);
  if (device_ != nullptr) begin_on_gpu();
  // Without any fluid that acts on the tissue it goes by itself; pbd's steps are an interval's.
  const bool is_dry = fluid_.particles.size() == 0 && scene_.method != Method::kPbd;
  // What flows fast takes shorter substeps.
  const double interval =
      kStepsOfInterval * stable_fluid_step(fluid_, fastest_of(fluid_.particles));
  const int count =
      is_dry ? 1 : std::max(1, static_cast<int>(std::ceil(duration / interval - 1e-9)));
  for (int i = 0; i < count && !result_.blew_up; ++i) {
    const PartOfInput part(input, static_cast<double>(i) / count, (i + 1.0) / count);
    tissue_->advance(duration / count, part.input);
    add(tissue_->finish(), 1.0 / count, result_);
    if (result_.blew_up) break;
    advance_interval(duration / count, part.input);
    for (std::size_t t = 0; t < result_.loads.size(); ++t) {
      result_.loads[t].mean.force += fluid_loads_[t].mean.force / count;
      result_.loads[t].mean.torque += fluid_loads_[t].mean.torque / count;
    }
  }
  if (device_ != nullptr) device_->bring(fluid_);
  drop_lost();
  const FluidParticles& p = fluid_.particles;
  for (int i = 0; i < p.size(); ++i) {
    const double speed2 = Vec3(p.v[0][i], p.v[1][i], p.v[2][i]).squaredNorm();
    result_.kinetic_energy += 0.5 * p.volume[i] * fluid_.laws[p.kind[i]].density * speed2;
    if (is_out_of_control(std::sqrt(speed2)) || !p.position(i).allFinite()) result_.blew_up = true;
  }
}

void TissueWithFluid::advance_interval(double duration, const FrameInput& input) {
  acts_ = sources_.acts(input);
  read_walls();
  const FrameColliders tools(scene_, input, duration);
  const std::vector<Box>& reach = tools.reach();
  std::vector<int> there;
  for (int c = scene_.ground.enabled ? 0 : 1; c < tools.count(); ++c) {
    if (reach[c].min.x() <= reach[c].max.x()) there.push_back(c);
  }
  FluidDrive drive;
  drive.duration = duration;
  drive.gravity = scene_.gravity;
  drive.damping = scene_.damping;
  drive.colliders = [&](double share) {
    std::vector<Collider> all;
    tools.at(share, all);
    std::vector<Collider> colliders;
    for (const int c : there) colliders.push_back(all[c]);
    return colliders;
  };
  std::vector<ColliderLoad> loads(there.size()), of_all(tools.count());
  if (device_ != nullptr) {
    device_->advance(fluid_, drive, loads);
  } else {
    std::fill(walls_.impulse.begin(), walls_.impulse.end(), 0.0f);
    advance_fluid(fluid_, drive, walls_, loads);
  }
  for (std::size_t c = 0; c < there.size(); ++c) of_all[there[c]] = loads[c];
  fluid_loads_.assign(scene_.tools.size(), {});
  tools.add_loads(1, tools.at_end().data(), of_all.data(), 1, fluid_loads_);
  if (pushes_on_gpu_) {
    tissue_->push_surface_on_gpu(device_->impulses());
  } else {
    if (device_ != nullptr) device_->bring_impulses(walls_);
    tissue_->push_surface(walls_.impulse);
  }
  // What changes particles does so on the host.
  const bool fills = std::any_of(fills_.begin(), fills_.end(),
                                 [](const FillProgress& fill) { return fill.filling != 0; });
  const bool acts = acts_ || sources_.acts(input);  // wounds were found since
  if (device_ != nullptr && (fills || acts)) device_->bring(fluid_);
  fill_up(duration);
  if (device_ != nullptr && fills) device_->send_volumes(fluid_);
  if (!acts) return;
  fluid_.lists.made = fluid_.lists.made || device_ != nullptr;
  sources_.act(input, duration, walls_, fluid_);
  if (device_ != nullptr && !fluid_.lists.made) device_->send(fluid_);
}

void TissueWithFluid::fill_up(double duration) {
  constexpr double kSmoothing = 0.01, kRate = 1, kSlowest = 0.1;  // [s], [1/s], [1]
  for (FillProgress& fill : fills_) {
    if (fill.filling == 0) continue;
    FluidParticles& p = fluid_.particles;
    double pressure = 0, volume = 0;
    for (int i = 0; i < p.size(); ++i) {
      if (p.fill[i] != fill.body) continue;
      pressure += p.volume[i] * p.pressure[i];
      volume += p.volume[i];
    }
    const double share = std::min(1.0, duration / kSmoothing);
    if (!(volume > 0)) {
      fill.filling = 0;
      continue;
    }
    fill.pressure += share * (pressure / volume - fill.pressure);
    const double missing = 1 - fill.pressure / fill.asked;
    if (!(missing > 0.002)) fill.filling = 0;
    const auto growth = static_cast<float>(1 + duration * kRate * std::max(kSlowest, missing));
    for (int i = 0; i < p.size() && fill.filling != 0; ++i) {
      if (p.fill[i] == fill.body) p.volume[i] *= growth;
    }
  }
}

void TissueWithFluid::follow_orders(Span<const FluidOrder> orders) {
  const FluidParticles& p = fluid_.particles;
  for (const FluidOrder& order : orders) {
    if (order.pressure > 0) {
      for (FillProgress& fill : fills_) {
        if (fill.body != order.body) continue;
        fill.asked = order.pressure;
        fill.filling = 1;
      }
    }
    if (!(order.drain > 0)) continue;
    for (FillProgress& fill : fills_) {
      if (fill.body == order.body) fill.filling = 0;
    }
    const std::vector<int> enclosed = find_enclosed();
    std::vector<std::pair<std::uint32_t, int>> there;  // in an order without any in space
    for (int i = 0; i < p.size(); ++i) {
      if (enclosed[i] == order.body) there.emplace_back(p.id[i] * 2654435761u, i);
    }
    std::sort(there.begin(), there.end());
    std::vector<std::uint32_t> ids;
    double volume = 0;
    for (const auto& [mixed, i] : there) {
      if (volume + 0.5 * p.volume[i] > order.drain) break;
      volume += p.volume[i];
      ids.push_back(p.id[i]);
    }
    sources_.drain(ids);
  }
}

void TissueWithFluid::drop_lost() {
  FluidParticles& p = fluid_.particles;
  std::vector<std::uint8_t> gone(p.size(), 0);
  bool any = false;
  for (int i = 0; i < p.size(); ++i) {
    if (!(p.x[2][i] < floor_)) continue;
    gone[i] = 1;
    any = true;
    sources_.sums()[p.kind[i]].lost += p.volume[i];
  }
  if (any) remove_particles(fluid_, gone);
}

int TissueWithFluid::read_fluid(std::vector<std::uint8_t>& cloud) {
  const FluidParticles& p = fluid_.particles;
  cloud.resize(sizeof(FluidPoint) * p.size());
  for (int i = 0; i < p.size(); ++i) {
    const FluidPoint point{p.x[0][i], p.x[1][i], p.x[2][i], rgb_of(kinds_[p.kind[i]].color),
                           p.v[0][i], p.v[1][i], p.v[2][i], p.pressure[i],
                           p.kind[i], p.id[i]};
    std::memcpy(cloud.data() + sizeof point * i, &point, sizeof point);
  }
  return p.size();
}

std::vector<int> TissueWithFluid::find_enclosed() {
  // A place is inside of what it meets the far side of along five of the six axes or more.
  constexpr int kEnclosed = 5;
  const std::size_t bodies = scene_.bodies.size();
  std::vector<std::unique_ptr<RayTree>> hollows(bodies);
  tissue_->read_surface(surface_);
  std::vector<int> body_of_piece;
  for (const Fragment& f : tissue_->fragments()) {
    body_of_piece.resize(std::max<std::size_t>(body_of_piece.size(), f.id + 1), -1);
    body_of_piece[f.id] = f.body;
  }
  for (std::size_t b = 0; b < bodies; ++b) {
    if (!(scene_.bodies[b].wall > 0)) continue;
    TriangleMesh mesh;
    for (std::size_t t = 0; t < surface_.fragment.size(); ++t) {
      if (body_of_piece[surface_.fragment[t]] != static_cast<int>(b)) continue;
      const auto first = static_cast<int>(mesh.vertices.size());
      for (int k = 0; k < 3; ++k) {
        const float* c = &surface_.corners[9 * t + 3 * k];
        mesh.vertices.emplace_back(c[0], c[1], c[2]);
      }
      mesh.triangles.push_back({first, first + 1, first + 2});
    }
    if (!mesh.triangles.empty()) hollows[b] = std::make_unique<RayTree>(mesh);
  }
  const FluidParticles& p = fluid_.particles;
  std::vector<int> inside(p.size(), -1);
  cpu_.for_each(
      p.size(),
      [&](int i) {
        for (std::size_t b = 0; b < bodies && inside[i] < 0; ++b) {
          if (hollows[b] == nullptr) continue;
          int met = 0;
          for (int k = 0; k < 6; ++k) {
            const Vec3 along = (k % 2 == 0 ? 1 : -1) * Vec3::Unit(k / 2);
            met += hollows[b]->first_exit(p.position(i), along, -1, 0).triangle >= 0 ? 1 : 0;
          }
          if (met >= kEnclosed) inside[i] = static_cast<int>(b);
        }
      },
      64);
  return inside;
}

std::vector<FluidVolume> TissueWithFluid::fluid_volumes() {
  const FluidParticles& p = fluid_.particles;
  const std::vector<int> inside = find_enclosed();
  std::vector<FluidVolume> volumes(kinds_.size());
  for (std::size_t k = 0; k < volumes.size(); ++k) {
    volumes[k].inside.assign(scene_.bodies.size(), 0.0);
    const FluidSums& sums = sources_.sums()[k];
    volumes[k].lost = sums.lost;
    volumes[k].sucked = sums.sucked;
    volumes[k].drained = sums.drained;
    volumes[k].bled = sums.bled;
    volumes[k].irrigated = sums.irrigated;
    volumes[k].bleeding = sources_.bleeding(static_cast<int>(k));
  }
  for (int i = 0; i < p.size(); ++i) {
    FluidVolume& of = volumes[p.kind[i]];
    of.total += p.volume[i];
    (inside[i] < 0 ? of.spilt : of.inside[inside[i]]) += p.volume[i];
    of.pressure += p.volume[i] * p.pressure[i];
  }
  for (FluidVolume& of : volumes) of.pressure /= of.total > 0 ? of.total : 1;
  return volumes;
}

std::uint64_t TissueWithFluid::checksum() {
  const FluidParticles& p = fluid_.particles;
  Checksum sum;
  for (int a = 0; a < 3; ++a) {
    sum.add(p.x[a]);
    sum.add(p.v[a]);
  }
  sum.add(p.volume);
  sum.add(p.dense);
  sum.add(p.id);
  return tissue_->checksum() ^ sum.value();
}

Momentum TissueWithFluid::momentum() {
  const Momentum tissue = tissue_->momentum();
  const FluidParticles& p = fluid_.particles;
  const auto mass = [&](int i) {
    return static_cast<double>(p.volume[i]) * fluid_.laws[p.kind[i]].density;
  };
  const auto speed = [&](int i) { return Vec3(p.v[0][i], p.v[1][i], p.v[2][i]); };
  Momentum sum;
  sum.mass = tissue.mass;
  sum.centre = tissue.mass * tissue.centre;
  sum.linear = tissue.linear;
  for (int i = 0; i < p.size(); ++i) {
    sum.mass += mass(i);
    sum.centre += mass(i) * p.position(i);
    sum.linear += mass(i) * speed(i);
  }
  sum.centre /= sum.mass;
  sum.angular = tissue.angular + (tissue.centre - sum.centre).cross(tissue.linear);
  for (int i = 0; i < p.size(); ++i) {
    sum.angular += mass(i) * (p.position(i) - sum.centre).cross(speed(i));
  }
  return sum;
}

template <class Archive>
void TissueWithFluid::each_field(Archive& archive) {
  FluidParticles& p = fluid_.particles;
  archive.part("fluid", p.x[0], p.x[1], p.x[2], p.v[0], p.v[1], p.v[2], p.volume, p.pressure,
               p.dense, p.kind, p.id, p.fill, fluid_.next_id);
  sources_.each_field(archive);
  for (FillProgress& fill : fills_)
    archive.part("fill", fill.body, fill.filling, fill.pressure, fill.asked);
  archive.part("walls", walls_.end, rest_);
}

std::vector<std::uint8_t> TissueWithFluid::save() {
  if (walls_on_gpu_) read_walls_on_host();
  ArchiveWriter out;
  std::vector<std::uint8_t> tissue = tissue_->save();
  out.part("tissue", tissue);
  each_field(out);
  return out.take();
}

void TissueWithFluid::restore(Span<const std::uint8_t> saved) {
  ArchiveReader in(saved);
  std::vector<std::uint8_t> tissue;
  in.part("tissue", tissue);
  tissue_->restore({tissue.data(), tissue.size()});
  each_field(in);
  const FluidParticles& p = fluid_.particles;
  const std::size_t n = p.kind.size();
  for (const std::size_t size :
       {p.x[0].size(), p.x[1].size(), p.x[2].size(), p.v[0].size(), p.v[1].size(), p.v[2].size(),
        p.volume.size(), p.pressure.size(), p.dense.size(), p.id.size(), p.fill.size()}) {
    if (size != n) throw std::runtime_error("the state's fluid has fields of several lengths");
  }
  surface_.made = 0;
  walls_on_gpu_ = false;
  if (!sources_.is_sound(rest_.size() / 9) || walls_.end.size() != rest_.size() ||
      std::any_of(p.kind.begin(), p.kind.end(),
                  [&](std::uint8_t kind) { return kind >= kinds_.size(); })) {
    throw std::runtime_error("the state's fluid is not of this scene");
  }
  fluid_.lists.made = false;
  walls_.impulse.clear();
}

}  // namespace tissue_sim
