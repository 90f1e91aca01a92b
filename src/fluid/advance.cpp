// A substep: densities and pressures, forces, motion. Each particle sums over its neighbours by
// number and writes what is its own, so threads change no bit.
#include <algorithm>
#include <cmath>

#include "fluid/fluid_state.h"
#include "fluid/pair_sums.h"

namespace tissue_sim {
namespace {

constexpr int kParticlesEach = 128;

/// What a substep reads and writes.
FluidView view_of(FluidState& s) {
  FluidParticles& p = s.particles;
  const FluidLists& l = s.lists;
  FluidView v{};
  v.size = p.size();
  v.kernel = s.kernel;
  v.spacing = s.spacing;
  v.laws = s.laws.data();
  v.kind = p.kind.data();
  v.volume = p.volume.data();
  for (int a = 0; a < 3; ++a) {
    v.x[a] = p.x[a].data();
    v.v[a] = p.v[a].data();
    v.v_next[a] = s.v_next[a].data();
    v.listed[a] = l.x[a].data();
  }
  v.pressure = p.pressure.data();
  v.dense = p.dense.data();
  v.wall_begin = l.wall_begin.data();
  v.wall_soon = l.wall_soon.data();
  v.wall_near = l.wall_near.data();
  v.wall = l.wall.data();
  v.before = s.before.data();
  v.now = s.now.data();
  v.walls_moved = std::max(s.walls_moved[0], s.walls_moved[1]);
  v.motion = s.motion.data();
  v.strength = s.strength.data();
  v.tool_strength = s.tool_strength.data();
  v.wall_push = s.wall_push.data();
  v.near = s.near.data();
  v.clear = s.clear.data();
  s.touches.resize(p.size());
  return v;
}

/// Puts the triangles that fluid meets where `corners` have them.
void place_triangles(FluidState& s, const std::vector<float>& corners,
                     std::vector<WallTriangle>& out) {
  out.resize(corners.size() / 9);
  s.cpu->for_each(
      static_cast<int>(s.lists.met.size()),
      [&](int m) {
        const std::int32_t t = s.lists.met[m];
        out[t].place(&corners[std::size_t{9} * t]);
      },
      512);
}

/// Which way triangles face in s.now, and how far they have come along that since they were listed.
void face_walls(FluidState& s) {
  s.facing.resize(4 * s.now.size());
  s.cpu->for_each(
      static_cast<int>(s.lists.met.size()),
      [&](int m) {
        const std::int32_t t = s.lists.met[m];
        const WallTriangle& wall = s.now[t];
        const float* from = &s.lists.corners[std::size_t{9} * t];
        float* row = &s.facing[4 * static_cast<std::size_t>(t)];
        float moved = 0;
        for (int a = 0; a < 3; ++a) {
          row[a] = wall.normal[a];
          moved +=
              wall.normal[a] * ((wall.corner[0][a] - from[a]) + (wall.corner[1][a] - from[3 + a]) +
                                (wall.corner[2][a] - from[6 + a]));
        }
        row[3] = moved / 3;
      },
      512);
}

/// The largest f(i) of all below n.
template <class F>
float largest(Cpu& cpu, int n, const F& f) {
  constexpr int kEach = 1024;
  const int chunks = (n + kEach - 1) / kEach;
  std::vector<float> of(chunks, 0.0f);
  cpu.for_each(chunks, [&](int chunk) {
    float most = 0;
    for (int i = chunk * kEach; i < std::min(n, (chunk + 1) * kEach); ++i) {
      most = std::max(most, f(i));
    }
    of[chunk] = most;
  });
  return chunks > 0 ? *std::max_element(of.begin(), of.end()) : 0;
}

/// How far walls are from where they were listed [m].
float walls_moved(FluidState& s, const std::vector<float>& corners) {
  const FluidLists& lists = s.lists;
  return std::sqrt(largest(*s.cpu, static_cast<int>(corners.size() / 3), [&](int c) {
    if (!s.is_bit.empty() && s.is_bit[c / 3] != 0) return 0.0f;
    const float *x = &corners[std::size_t{3} * c], *y = &lists.corners[std::size_t{3} * c];
    const float d[3] = {x[0] - y[0], x[1] - y[1], x[2] - y[2]};
    return dot3(d, d);
  }));
}

/// How far particles moved since they were listed [m].
float particles_moved(FluidState& s) {
  const FluidParticles& p = s.particles;
  return std::sqrt(largest(*s.cpu, p.size(), [&](int i) {
    const float d[3] = {p.x[0][i] - s.lists.x[0][i], p.x[1][i] - s.lists.x[1][i],
                        p.x[2][i] - s.lists.x[2][i]};
    return dot3(d, d);
  }));
}

/// Calls f(i, add) for each particle; what is added to loads is summed by chunks, in order.
template <class F>
void with_loads(FluidState& s, std::vector<ColliderLoad>& loads, const F& f) {
  const int n = s.particles.size(), chunks = (n + kParticlesEach - 1) / kParticlesEach;
  const std::size_t colliders = loads.size();
  std::vector<ColliderLoad> of(chunks * colliders);
  s.cpu->for_each(chunks, [&](int chunk) {
    ColliderLoad* const to = of.data() + chunk * colliders;
    const auto add = [to](int c, const float* force, const float* torque) {
      for (int a = 0; a < 3; ++a) {
        to[c].force[a] += force[a];
        to[c].torque[a] += torque[a];
      }
    };
    for (int i = chunk * kParticlesEach; i < std::min(n, (chunk + 1) * kParticlesEach); ++i) {
      f(i, add);
    }
  });
  for (int chunk = 0; chunk < chunks; ++chunk) {
    for (std::size_t c = 0; c < colliders; ++c) {
      for (int a = 0; a < 3; ++a) {
        loads[c].force[a] += of[chunk * colliders + c].force[a];
        loads[c].torque[a] += of[chunk * colliders + c].torque[a];
      }
    }
  }
}

/// Of particles that walls met: what they gave them goes to the wall around, as far as a particle
/// reaches, and in each triangle to the corners in equal parts.
void collect_touches(const FluidState& s, const FluidView& view, FluidWalls& walls) {
  std::vector<float> weight;
  for (int i = 0; i < view.size; ++i) {
    const FluidTouch& touch = s.touches[i];
    if (touch.triangle < 0) continue;
    const auto give = [&](std::int32_t triangle, float share) {
      for (int a = 0; a < 3; ++a) {
        walls.impulse[std::size_t{3} * triangle + a] += share / 3 * touch.impulse[a];
      }
    };
    const float* normal = s.now[touch.triangle].normal;
    const float x[3] = {view.x[0][i], view.x[1][i], view.x[2][i]};
    const std::int32_t begin = s.lists.wall_begin[i], end = s.lists.wall_begin[i + 1];
    weight.assign(end - begin, 0.0f);
    float sum = 0;
    for (std::int32_t e = begin; e < end; ++e) {
      sum += weight[e - begin] = fluid::touch_weight(view, x, s.now[s.lists.wall[e]], normal);
    }
    if (!(sum > 0)) give(touch.triangle, 1);
    for (std::int32_t e = begin; e < end && sum > 0; ++e) {
      if (weight[e - begin] > 0) give(s.lists.wall[e], weight[e - begin] / sum);
    }
  }
}

/// What pressure gives triangles in `time` goes to their corners likewise.
void collect(FluidState& s, const FluidView& view, float time, FluidWalls& walls) {
  constexpr int kGrain = 1024;
  constexpr std::int64_t kMostChunks = 8, kEntries = 1 << 16;
  const FluidLists& l = s.lists;
  const int triangles = walls.size(), met = static_cast<int>(l.met.size());
  // Whatever the number of threads, for the same bits: with few entries few sums.
  const std::int64_t entries = l.wall_begin.back();
  const auto chunks = static_cast<int>(std::min(kMostChunks, entries / kEntries + 1));
  s.wall_impulse.resize(std::size_t{1} * chunks * triangles);
  const auto first = [&](int chunk) {  // of particles that have as many entries in each
    const auto entry = static_cast<std::int32_t>(entries * chunk / chunks);
    return std::lower_bound(l.wall_begin.begin(), l.wall_begin.end() - 1, entry) -
           l.wall_begin.begin();
  };
  s.cpu->for_each(chunks, [&](int chunk) {
    float* sum = &s.wall_impulse[std::size_t{1} * chunk * triangles];
    for (const std::int32_t t : l.met) sum[t] = 0;
    const auto end = chunk + 1 < chunks ? first(chunk + 1) : s.particles.size();
    for (auto i = first(chunk); i < end; ++i) {
      const float strength = time * s.strength[i];
      if (strength == 0) continue;
      const std::int32_t* triangle = &s.seen[l.wall_begin[i]];
      const float* over = &s.share[l.wall_begin[i]];
      for (int e = 0; e < s.seen_count[i]; ++e) sum[triangle[e]] += strength * over[e];
    }
  });
  s.cpu->for_each(
      met,
      [&](int m) {
        const std::int32_t t = l.met[m];
        float sum = 0;
        for (int k = 0; k < chunks; ++k) sum += s.wall_impulse[std::size_t{1} * k * triangles + t];
        for (int a = 0; a < 3; ++a) {
          walls.impulse[std::size_t{3} * t + a] -= sum * s.now[t].normal[a] / 3;
        }
      },
      kGrain);
  collect_touches(s, view, walls);
}

/// Takes the walls to where they end: the fluid then presses on them as they are, not as they were.
/// A pressure that lags behind what it presses on would drive it.
void move_walls(FluidState& s, FluidWalls& walls, float duration, bool were_listed) {
  if (were_listed) {
    place_triangles(s, walls.begin, s.before);
  } else {
    s.before.swap(s.now);
    place_triangles(s, walls.end, s.now);
  }
  const FluidView view = view_of(s);
  s.cpu->for_each(
      view.size,
      [&](int i) { s.touches[i] = fluid::yield_to_walls(view, duration, i, fluid::OneLane()); },
      kParticlesEach);
  collect_touches(s, view, walls);
}

/// After particles and walls were listed: what they see is to be summed.
void see_anew(FluidState& s) {
  const std::size_t n = s.particles.size();
  s.seen_at.assign(n, {{}, 0, 0, 1});
  s.seen_count.assign(n, 0);
  s.clear.assign(n, {{}, -1});
  s.seen.resize(s.lists.wall.size());
  s.share.resize(s.lists.wall.size());
  s.wall_push.assign(4 * n, 0.0f);
}

void substep(FluidState& s, const FluidSubstep& step, FluidWalls& walls,
             std::vector<ColliderLoad>& loads) {
  const int n = s.particles.size();
  for (auto* field : {&s.strength, &s.tool_strength, &s.v_next[0], &s.v_next[1], &s.v_next[2]}) {
    field->resize(n);
  }
  s.near.resize(n);
  for (auto* rows : {&s.place, &s.motion}) {
    rows->resize(4 * static_cast<std::size_t>(n + 1));
    std::fill(rows->end() - 4, rows->end(), 0.0f);
  }
  const FluidView view = view_of(s);
  std::vector<ColliderLoad> forces(step.collider_count);
  s.cpu->for_each(
      n,
      [&](int i) {
        float *place = &s.place[4 * static_cast<std::size_t>(i)],
              *motion = &s.motion[4 * static_cast<std::size_t>(i)];
        for (int a = 0; a < 3; ++a) place[a] = s.particles.x[a][i], motion[a] = s.particles.v[a][i];
        place[3] = s.particles.volume[i];
      },
      kParticlesEach);
  s.cpu->for_each(
      n,
      [&](int i) {
        const bool sees_walls = s.lists.wall_begin[i] < s.lists.wall_begin[i + 1];
        fluid::press(view, step, i, neighbour_volume(s, i), sees_walls ? wall_share(s, i) : 0);
      },
      kParticlesEach);
  with_loads(s, forces, [&](int i, const auto& add) {
    float of_pairs[3] = {};
    add_pair_forces(s, i, of_pairs);
    fluid::push(view, step, i, of_pairs, add);
  });
  with_loads(s, forces, [&](int i, const auto& add) {
    s.touches[i] = fluid::move(view, step, i, fluid::OneLane(), add);
  });
  collect(s, view, step.dt, walls);
  for (std::size_t c = 0; c < forces.size(); ++c) {
    for (int a = 0; a < 3; ++a) {
      loads[c].force[a] += step.weight * forces[c].force[a];
      loads[c].torque[a] += step.weight * forces[c].torque[a];
    }
  }
}

}  // namespace

float fastest_of(const FluidParticles& p) {
  float fastest = 0;
  for (int i = 0; i < p.size(); ++i) {
    const float v[3] = {p.v[0][i], p.v[1][i], p.v[2][i]};
    fastest = std::max(fastest, dot3(v, v));
  }
  return std::sqrt(fastest);
}

double stable_fluid_step(const FluidState& s, float fastest) {
  float least = 1e30f;
  const float length = 0.5f * s.kernel.reach;
  for (const FluidLaw& law : s.laws) {
    const float nu = fluid::artificial_viscosity(s.kernel, law) / law.density;
    least = std::min(
        {least, fluid::kCourant * length / (law.sound() + fastest), 0.1f * length * length / nu});
  }
  return least;
}

FluidSubstep fluid_substep(const FluidDrive& drive, int count,
                           const std::vector<Collider>& colliders) {
  FluidSubstep step{};
  step.dt = static_cast<float>(drive.duration / count);
  step.weight = static_cast<float>(1.0 / count);
  for (int a = 0; a < 3; ++a) step.gravity[a] = static_cast<float>(drive.gravity[a]);
  step.keep = static_cast<float>(std::exp(-drive.damping * step.dt));
  step.colliders = colliders.data();
  step.collider_count = static_cast<int>(colliders.size());
  return step;
}

int advance_fluid(FluidState& s, const FluidDrive& drive, FluidWalls& walls,
                  std::vector<ColliderLoad>& loads) {
  walls.impulse.resize(walls.end.size() / 3);
  if (s.particles.size() == 0) return 0;
  const int count = std::max(
      1,
      static_cast<int>(std::ceil(drive.duration / stable_fluid_step(s, fastest_of(s.particles)))));
  s.viscosity.clear();
  for (const FluidLaw& law : s.laws)
    s.viscosity.push_back(fluid::artificial_viscosity(s.kernel, law));
  const float skin = fluid::kSkin * s.kernel.reach, far = fluid::kMayMove * s.kernel.reach;
  if (s.lists.corners.size() != walls.end.size()) s.lists.made = false;
  s.walls_moved[0] = s.walls_moved[1];
  s.walls_moved[1] = s.lists.made ? walls_moved(s, walls.end) : 0;
  if (s.walls_moved[1] > far) s.lists.made = false;
  for (int i = 0; i < count; ++i) {
    const bool make = !s.lists.made || particles_moved(s) > far;
    if (make) {
      list_neighbours(s, walls.end, skin);
      see_anew(s);
      s.walls_moved[0] = i == 0 ? walls_moved(s, walls.begin) : 0;
      s.walls_moved[1] = 0;
    }
    if (i == 0) move_walls(s, walls, static_cast<float>(drive.duration), make);
    if (i == 0 || make) face_walls(s);
    const double share = (i + 1.0) / count;
    const std::vector<Collider> colliders = drive.colliders(share);
    const FluidSubstep step = fluid_substep(drive, count, colliders);
    substep(s, step, walls, loads);
  }
  return count;
}

int add_particle(FluidState& s, const Vec3& x, const Vec3& v, double volume, int kind, int fill) {
  FluidParticles& p = s.particles;
  for (int a = 0; a < 3; ++a) {
    p.x[a].push_back(static_cast<float>(x[a]));
    p.v[a].push_back(static_cast<float>(v[a]));
  }
  p.volume.push_back(static_cast<float>(volume));
  p.pressure.push_back(0);
  p.dense.push_back(0);
  p.kind.push_back(static_cast<std::uint8_t>(kind));
  p.id.push_back(s.next_id++);
  p.fill.push_back(static_cast<std::int16_t>(fill));
  s.lists.made = false;
  return p.size() - 1;
}

void remove_particles(FluidState& s, const std::vector<std::uint8_t>& gone) {
  FluidParticles& p = s.particles;
  const auto keep = [&gone](auto& field) {
    std::size_t n = 0;
    for (std::size_t i = 0; i < field.size(); ++i) {
      if (gone[i] == 0) field[n++] = field[i];
    }
    field.resize(n);
  };
  for (int a = 0; a < 3; ++a) {
    keep(p.x[a]);
    keep(p.v[a]);
  }
  keep(p.volume);
  keep(p.pressure);
  keep(p.dense);
  keep(p.kind);
  keep(p.id);
  keep(p.fill);
  s.lists.made = false;
}

void push_out_of_walls(FluidState& s, const std::vector<float>& corners) {
  list_neighbours(s, corners, 0);
  const FluidView view = view_of(s);
  s.cpu->for_each(
      view.size, [&](int i) { fluid::leave_wall(view, i); }, 64);
  s.lists.made = false;
}

}  // namespace tissue_sim
