#include "fluid/sources.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "fluid/fill.h"
#include "tools/tool_motion.h"

namespace tissue_sim {
namespace {

/// Of a spacing: where a particle comes out of what is solid, and how near to another none does.
constexpr double kDropOut = 0.5, kDropApart = 0.6;
/// Likewise how near to tissue none comes out: in a slit that is narrower it would burst it open.
constexpr double kRoomy = 0.45;
/// Drops that could not come out, as a wound was closed or full: more than that is not owed.
constexpr double kMostOwed = 4;     // particles
constexpr double kDrainTime = 0.5;  // [s]

Vec3 wall_corner(const std::vector<float>& corners, std::size_t t, int k) {
  const float* c = &corners[9 * t + 3 * k];
  return {c[0], c[1], c[2]};
}

/// The place of a triangle that is nearest to x.
Vec3 nearest_on(const Vec3& x, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a, ac = c - a, n = ab.cross(ac);
  const double n2 = n.squaredNorm();
  if (n2 > 0) {
    const Vec3 d = x - a;
    const double v = d.cross(ac).dot(n) / n2, w = ab.cross(d).dot(n) / n2;
    if (v >= 0 && w >= 0 && v + w <= 1) return a + v * ab + w * ac;
  }
  Vec3 best = a;
  double least = 1e300;
  const Vec3* const corners[4] = {&a, &b, &c, &a};
  for (int k = 0; k < 3; ++k) {
    const Vec3 &from = *corners[k], along = *corners[k + 1] - from;
    const double length2 = along.squaredNorm();
    const double share = length2 > 0 ? std::clamp((x - from).dot(along) / length2, 0.0, 1.0) : 0;
    const Vec3 place = from + share * along;
    if ((x - place).squaredNorm() < least) least = (x - place).squaredNorm(), best = place;
  }
  return best;
}

/// Whether a place is in tissue, or nearer to it than `room`: the triangle that is nearest to it,
/// at most `reach` away, has it at its back. Of two that are as near the one that it lies more
/// squarely over counts.
bool in_tissue(const Vec3& x, const FluidWalls& walls, double room, double reach) {
  double least = reach * reach, squarest = 0;
  bool inside = false;
  for (int t = 0; t < walls.size(); ++t) {
    const Vec3 a = wall_corner(walls.end, t, 0);
    const Vec3 b = wall_corner(walls.end, t, 1), c = wall_corner(walls.end, t, 2);
    const Vec3 low = a.cwiseMin(b).cwiseMin(c), high = a.cwiseMax(b).cwiseMax(c);
    if (((low - x).cwiseMax(x - high)).cwiseMax(0).squaredNorm() > least) continue;
    const Vec3 off = x - nearest_on(x, a, b, c);
    const double d2 = off.squaredNorm();
    if (d2 > least * (1 + 1e-9)) continue;
    const Vec3 n = (b - a).cross(c - a);
    const double square = n.dot(off) / (n.norm() * std::sqrt(d2) + 1e-300);
    if (d2 >= least * (1 - 1e-9) && std::fabs(square) <= squarest) continue;
    least = std::min(least, d2);
    squarest = std::fabs(square);
    inside = square < 0;
  }
  return inside || least < room * room;
}

/// Whether a wall stands between two places.
bool is_behind_wall(const Vec3& from, const Vec3& to, const FluidWalls& walls) {
  const Vec3 low = from.cwiseMin(to), high = from.cwiseMax(to), way = to - from;
  for (int t = 0; t < walls.size(); ++t) {
    const Vec3 a = wall_corner(walls.end, t, 0);
    const Vec3 b = wall_corner(walls.end, t, 1), c = wall_corner(walls.end, t, 2);
    if ((a.cwiseMax(b).cwiseMax(c).array() < low.array()).any() ||
        (a.cwiseMin(b).cwiseMin(c).array() > high.array()).any()) {
      continue;
    }
    const Vec3 n = (b - a).cross(c - a);
    const double before = n.dot(from - a), after = n.dot(to - a);
    if ((before < 0) == (after < 0)) continue;
    const Vec3 x = from + before / (before - after) * way;
    if ((b - a).cross(x - a).dot(n) >= 0 && (c - b).cross(x - b).dot(n) >= 0 &&
        (a - c).cross(x - c).dot(n) >= 0) {
      return true;
    }
  }
  return false;
}

/// Whether there is room for a particle.
bool is_free(const Vec3& x, const Scene& scene, const FluidWalls& walls, const FluidState& s) {
  if (scene.ground.enabled && x.z() < scene.ground.z) return false;
  const double apart2 = kDropApart * kDropApart * s.spacing * s.spacing;
  for (int i = 0; i < s.particles.size(); ++i) {
    if ((s.particles.position(i) - x).squaredNorm() < apart2) return false;
  }
  return !in_tissue(x, walls, kRoomy * s.spacing, 3.0 * s.spacing);
}

double particle_volume(const FluidState& s) { return std::pow(static_cast<double>(s.spacing), 3); }

}  // namespace

FluidSources::FluidSources(const Scene& scene) : scene_(scene) {
  const std::vector<Fluid> kinds = fluid_kinds(scene);
  sums_.resize(kinds.size());
  bled_in_frame_.assign(kinds.size(), 0.0);
  owed_.assign(scene.tools.size(), 0.0);
  turn_.assign(scene.tools.size(), 0);
  for (const Tool& tool : scene.tools) {
    tube_kind_.push_back(tool.type == ToolType::kIrrigation ? fluid_kind(kinds, tool.fluid) : -1);
  }
  const auto add = [&](const std::string& material) {
    const Bleeding& of = find_material(scene, material).bleeding;
    if (!(of.flux > 0)) return -1;
    bleeds_ = true;
    materials_.push_back({of, fluid_kind(kinds, of.fluid)});
    return static_cast<int>(materials_.size()) - 1;
  };
  for (const Body& body : scene.bodies) {
    std::vector<int> of = {add(body.material)};
    for (const Inclusion& part : body.inclusions) of.push_back(add(part.material));
    body_materials_.push_back(of);
  }
}

void FluidSources::find_wounds(const SurfaceTriangles& surface, Span<const Fragment> pieces) {
  using Corners = std::array<float, 9>;
  std::map<Corners, std::size_t> known;
  for (std::size_t w = 0; w < wound_triangle_.size(); ++w) {
    Corners key;
    std::copy_n(&wound_rest_[9 * w], 9, key.begin());
    known.emplace(key, w);
  }
  std::map<std::int32_t, std::int32_t> body_of;
  for (const Fragment& f : pieces) body_of[f.id] = f.body;
  using Place = std::array<float, 3>;
  const auto place_of = [&surface](std::size_t t, int k) {
    const float* c = &surface.rest[9 * t + 3 * k];
    return Place{c[0], c[1], c[2]};
  };
  std::map<Place, std::int32_t> skin;
  for (std::size_t t = 0; t < surface.fragment.size(); ++t) {
    for (int k = 0; k < 3 && surface.cut[t] == 0; ++k) {
      skin.emplace(place_of(t, k), static_cast<std::int32_t>(3 * t + k));
    }
  }
  std::vector<std::int32_t> triangles, materials, rims;
  std::vector<double> ages, owed;
  std::vector<float> rest;
  for (std::size_t t = 0; t < surface.fragment.size(); ++t) {
    if (surface.cut[t] == 0) continue;
    const auto body = body_of.find(surface.fragment[t]);
    if (body == body_of.end() || body->second < 0) continue;
    const Body& of = scene_.bodies[body->second];
    const Vec3 middle = (wall_corner(surface.rest, t, 0) + wall_corner(surface.rest, t, 1) +
                         wall_corner(surface.rest, t, 2)) /
                        3;
    int material = body_materials_[body->second][0];
    for (std::size_t k = 0; k < of.inclusions.size(); ++k) {
      if (of.inclusions[k].region.contains(middle)) material = body_materials_[body->second][k + 1];
    }
    if (material < 0) continue;
    Corners key;
    std::copy_n(&surface.rest[9 * t], 9, key.begin());
    const auto before = known.find(key);
    const bool is_new = before == known.end();
    triangles.push_back(static_cast<std::int32_t>(t));
    materials.push_back(material);
    rims.push_back(-1);
    for (int k = 0; k < 3; ++k) {
      const auto rim = skin.find(place_of(t, k));
      if (rim != skin.end()) rims.back() = rim->second;
    }
    ages.push_back(is_new ? 0 : wound_age_[before->second]);
    owed.push_back(is_new ? 0 : wound_owed_[before->second]);
    rest.insert(rest.end(), key.begin(), key.end());
  }
  wound_triangle_.swap(triangles);
  wound_material_.swap(materials);
  wound_rim_.swap(rims);
  wound_age_.swap(ages);
  wound_owed_.swap(owed);
  wound_rest_.swap(rest);
  wound_flow_.assign(wound_triangle_.size(), -1.0);
}

void FluidSources::begin_frame(double duration) {
  frame_ = duration;
  std::fill(bled_in_frame_.begin(), bled_in_frame_.end(), 0.0);
  wound_flow_.assign(wound_triangle_.size(), -1.0);
}

bool FluidSources::acts(const FrameInput& input) const {
  for (std::size_t i = 0; i < input.tools.size(); ++i) {
    const ToolType type = scene_.tools[i].type;
    const bool is_tube = type == ToolType::kSuction || type == ToolType::kIrrigation;
    if (is_tube && input.tools[i].present) return true;
  }
  return !wound_triangle_.empty() || !drained_.empty();
}

void FluidSources::act(const FrameInput& input, double duration, const FluidWalls& walls,
                       FluidState& fluid) {
  for (std::size_t i = 0; i < input.tools.size(); ++i) {
    const Tool& tool = scene_.tools[i];
    const int index = static_cast<int>(i);
    if (!input.tools[i].present) continue;
    if (tool.type == ToolType::kSuction) {
      owed_[i] += tool.flow * duration;
      suck(tool, index, input.tools[i].end, walls, fluid);
    } else if (tool.type == ToolType::kIrrigation) {
      owed_[i] += tool.flow * duration;
      irrigate(tool, index, input.tools[i], duration, walls, fluid);
    }
  }
  if (!wound_triangle_.empty()) bleed(duration, walls, fluid);
  if (!drained_.empty()) drain(duration, fluid);
}

void FluidSources::suck(const Tool& tool, int i, const Pose& pose, const FluidWalls& walls,
                        FluidState& fluid) {
  FluidParticles& p = fluid.particles;
  const double reach = tool.radius + kDropOut * fluid.spacing;
  std::vector<std::pair<double, int>> near;  // by distance, then by number
  for (int k = 0; k < p.size(); ++k) {
    const double d2 = (p.position(k) - pose.position).squaredNorm();
    if (d2 < reach * reach) near.emplace_back(d2, k);
  }
  std::sort(near.begin(), near.end());
  std::vector<std::uint8_t> gone;
  for (const auto& [d2, k] : near) {
    if (owed_[i] < p.volume[k]) break;
    if (is_behind_wall(pose.position, p.position(k), walls)) continue;
    gone.resize(p.size(), 0);
    gone[k] = 1;
    owed_[i] -= p.volume[k];
    sums_[p.kind[k]].sucked += p.volume[k];
  }
  if (!gone.empty()) remove_particles(fluid, gone);
  owed_[i] = std::min(owed_[i], 2 * particle_volume(fluid));  // it does not save up what it missed
}

void FluidSources::irrigate(const Tool& tool, int i, const ToolMotion& motion, double duration,
                            const FluidWalls& walls, FluidState& fluid) {
  const double each = particle_volume(fluid), spacing = fluid.spacing;
  // Places of the mouth: a square grid within it, in turn.
  std::vector<Vec3> places;
  const int most = static_cast<int>(tool.radius / spacing + 1e-3);
  for (int y = -most; y <= most; ++y) {
    for (int x = -most; x <= most; ++x) {
      if (x * x + y * y > most * most) continue;
      places.push_back(spacing * Vec3(x, y, 0) + kDropOut * spacing * Vec3::UnitZ());
    }
  }
  const Vec3 along = motion.end.orientation * Vec3::UnitZ();
  const double mouth = std::min(M_PI * tool.radius * tool.radius,
                                static_cast<double>(places.size()) * spacing * spacing);
  const Vec3 speed =
      (motion.end.position - motion.begin.position) / duration + tool.flow / mouth * along;
  for (std::size_t tries = 0; tries < places.size() && owed_[i] >= each; ++tries) {
    const Vec3 x = motion.end * places[turn_[i]++ % places.size()];
    turn_[i] %= static_cast<std::int32_t>(places.size());
    if (!is_free(x, scene_, walls, fluid)) continue;
    add_particle(fluid, x, speed, each, tube_kind_[i], -1);
    owed_[i] -= each;
    sums_[tube_kind_[i]].irrigated += each;
  }
  owed_[i] = std::min(owed_[i], static_cast<double>(places.size()) * each);
}

void FluidSources::bleed(double duration, const FluidWalls& walls, FluidState& fluid) {
  const double each = particle_volume(fluid);
  const std::size_t wounds = wound_triangle_.size();
  const FluidParticles& p = fluid.particles;
  std::vector<double> due(materials_.size(), 0.0);
  for (std::size_t w = 0; w < wounds; ++w) {
    const Bleeds& of = materials_[wound_material_[w]];
    wound_age_[w] += duration;
    const auto t = static_cast<std::size_t>(wound_triangle_[w]);
    const Vec3 a = wall_corner(walls.end, t, 0), b = wall_corner(walls.end, t, 1),
               c = wall_corner(walls.end, t, 2);
    if (wound_flow_[w] < 0) {  // once a frame, and when it opens
      double pressure = 0;
      if (of.law.pressure > 0) {
        const Vec3 middle = (a + b + c) / 3;
        int near = 0;
        for (int i = 0; i < p.size(); ++i) {
          const double d2 = (p.position(i) - middle).squaredNorm();
          if (d2 > 2.25 * fluid.spacing * fluid.spacing) continue;
          pressure += p.pressure[i];
          ++near;
        }
        pressure /= std::max(1, near);
      }
      const double open = of.law.pressure > 0 ? std::max(0.0, 1 - pressure / of.law.pressure) : 1;
      const double clot =
          of.law.clots_after > 0 ? std::max(0.0, 1 - wound_age_[w] / of.law.clots_after) : 1;
      wound_flow_[w] = of.law.flux * open * clot;
    }
    wound_owed_[w] += wound_flow_[w] * 0.5 * (b - a).cross(c - a).norm() * duration;
    due[wound_material_[w]] += wound_owed_[w];
  }
  // What is owed in all comes out where most is, of what has room.
  std::vector<std::size_t> order(wounds);
  for (std::size_t w = 0; w < wounds; ++w) order[w] = w;
  if (*std::max_element(due.begin(), due.end()) < each) return;
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return wound_owed_[a] != wound_owed_[b] ? wound_owed_[a] > wound_owed_[b] : a < b;
  });
  for (const std::size_t w : order) {
    const int material = wound_material_[w];
    if (due[material] < each) continue;
    const auto t = static_cast<std::size_t>(wound_triangle_[w]);
    Vec3 x = Vec3::Zero(), speed = Vec3::Zero();
    // Out of an open wound; out of one whose sides touch at its rim.
    bool room = false;
    for (int way = 0; way < 2 && !room; ++way) {
      if (way == 1 && wound_rim_[w] < 0) break;
      const std::size_t of = way == 0 ? t : static_cast<std::size_t>(wound_rim_[w]) / 3;
      const Vec3 a = wall_corner(walls.end, of, 0);
      const Vec3 n = (wall_corner(walls.end, of, 1) - a).cross(wall_corner(walls.end, of, 2) - a);
      if (!(n.norm() > 0)) continue;
      Vec3 from = Vec3::Zero(), before = Vec3::Zero();
      for (int k = 0; k < 3; ++k) {
        const double weight = way == 0 ? 1.0 / 3 : k == wound_rim_[w] % 3 ? 1 : 0;
        from += weight * wall_corner(walls.end, of, k);
        before += weight * wall_corner(walls.begin, of, k);
      }
      x = from + kDropOut * fluid.spacing * n.normalized();
      speed = (from - before) / duration + materials_[material].law.flux * n.normalized();
      room = is_free(x, scene_, walls, fluid);
    }
    if (!room) continue;
    const Bleeds& of = materials_[material];
    add_particle(fluid, x, speed, each, of.kind, -1);
    due[material] -= each;
    wound_owed_[w] -= each;
    sums_[of.kind].bled += each;
    bled_in_frame_[of.kind] += each;
  }
  // A wound without room does not save it up.
  for (std::size_t m = 0; m < materials_.size(); ++m) {
    if (due[m] <= kMostOwed * each) continue;
    const double less = kMostOwed * each / due[m];
    for (std::size_t w = 0; w < wounds; ++w) {
      if (wound_material_[w] == static_cast<int>(m)) wound_owed_[w] *= less;
    }
  }
}

bool FluidSources::is_sound(std::size_t triangles) const {
  const std::size_t wounds = wound_triangle_.size();
  const auto below = [](const std::vector<std::int32_t>& all, std::size_t end) {
    return std::all_of(all.begin(), all.end(), [end](std::int32_t i) {
      return i >= 0 && static_cast<std::size_t>(i) < end;
    });
  };
  return owed_.size() == scene_.tools.size() && turn_.size() == scene_.tools.size() &&
         bled_in_frame_.size() == sums_.size() && wound_material_.size() == wounds &&
         wound_rim_.size() == wounds &&
         std::all_of(wound_rim_.begin(), wound_rim_.end(),
                     [&](std::int32_t r) {
                       return r >= -1 && r < static_cast<std::int32_t>(3 * triangles);
                     }) &&
         wound_age_.size() == wounds && wound_owed_.size() == wounds &&
         wound_rest_.size() == 9 * wounds && below(wound_triangle_, triangles) &&
         below(wound_material_, materials_.size());
}

void FluidSources::drain(const std::vector<std::uint32_t>& ids) {
  drained_.insert(drained_.begin(), ids.begin(), ids.end());
  drain_rate_ = static_cast<double>(drained_.size()) / kDrainTime;
}

void FluidSources::drain(double duration, FluidState& fluid) {
  FluidParticles& p = fluid.particles;
  drain_owed_ += drain_rate_ * duration;
  std::vector<std::uint8_t> gone(p.size(), 0);
  bool any = false;
  while (drain_owed_ >= 1 && !drained_.empty()) {
    drain_owed_ -= 1;
    const std::uint32_t id = drained_.back();
    drained_.pop_back();
    const auto found = std::find(p.id.begin(), p.id.end(), id);
    if (found == p.id.end()) continue;  // left meanwhile
    const auto k = static_cast<std::size_t>(found - p.id.begin());
    gone[k] = 1;
    any = true;
    sums_[p.kind[k]].drained += p.volume[k];
  }
  if (drained_.empty()) drain_owed_ = 0;
  if (any) remove_particles(fluid, gone);
}

}  // namespace tissue_sim
