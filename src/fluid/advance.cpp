// A substep: densities and pressures, forces, motion. Each particle sums over its neighbours by
// number and writes what is its own, so threads change no bit.
#include <algorithm>
#include <cmath>

#include "fluid/fluid_state.h"
#include "fluid/pair_sums.h"

namespace tissue_sim {
namespace {

/// Of sound over a smoothing length (half of the kernel's reach). A cork in water keeps a hundred
/// times the energy with 0.8, no more with 0.6 than with 0.4.
constexpr float kCourant = 0.6f;
/// Viscosity that keeps the particles' own jitter down, as Monaghan's alpha.
constexpr float kAlpha = 0.02f;
/// Viscosity against changes of volume alone, over that of sound in a smoothing length: it takes
/// the ringing out and leaves what flows.
constexpr float kRinging = 0.25f;
/// What the kernel sums up to where particles have settled, and how much of a small change of
/// density that sum shows (a particle itself does not come nearer): measured in a periodic box for
/// FluidKernel::reach = kFluidReach spacings.
constexpr float kPacking = 1.0076f, kResponse = 0.983f;
/// Of the modulus, the most that a drop presses with: in a slit narrower than it is it would take
/// off, at 38 m/s out of a cut that bled. What a wave of the fastest speed brings is below it.
constexpr float kMostStrain = 0.2f;
/// Of its kernel what walls leave it in a slit of 0.4 spacings: where less is left, between sides
/// of a cut that close or overlap, it presses with less and less. It would drive them apart with
/// all that it may press with, however far they went.
constexpr float kSlit = 0.25f;
/// Of a spacing: nearer to a wall no particle comes.
constexpr float kRoom = 0.02f;
/// Of the lists' skin: two that come towards each other stay below it.
constexpr float kMayMove = 0.48f;
constexpr int kParticlesEach = 128;

struct Substep {
  float dt;      // [s]
  float weight;  // of the interval
  float gravity[3];
  float keep;  // of speed, after damping
  const std::vector<Collider>& colliders;
};

/// A collider's bit of FluidState::near; those behind the 63rd share one.
std::uint64_t bit_of(std::size_t collider) {
  return std::uint64_t{1} << std::min<std::size_t>(collider, 63);
}

float artificial_viscosity(const FluidState& s, const FluidLaw& law) {
  return law.viscosity + 0.1f * kAlpha * law.density * law.sound() * 0.5f * s.kernel.reach;
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

/// Density, pressure and what it weighs.
void press(FluidState& s, const Substep& step, int i) {
  FluidParticles& p = s.particles;
  const FluidKernel& w = s.kernel;
  const float x[3] = {p.x[0][i], p.x[1][i], p.x[2][i]};
  const float sum = neighbour_volume(s, i);
  const bool sees_walls = s.lists.wall_begin[i] < s.lists.wall_begin[i + 1];
  const float tissue = sees_walls ? wall_share(s, i) : 0;
  // Tools at right angles each take their share of what the others leave; what is tissue is none
  // of theirs.
  float clear = 1;
  std::uint64_t near = 0;
  for (std::size_t c = 0; c < step.colliders.size(); ++c) {
    const float distance = gap(step.colliders[c], x).distance;
    if (!(distance < w.reach)) continue;
    near |= bit_of(c);
    clear *= 1 - plane_share(w, distance).share;
  }
  s.near[i] = near;
  const float of_tools = clear;
  const float in_slit = std::clamp((clear - tissue) / kSlit, 0.0f, 1.0f);
  clear = std::max(clear - tissue, 0.05f);
  const float dense = 1 + (sum / (kPacking * clear) - 1) / kResponse;
  const FluidLaw& law = s.laws[p.kind[i]];
  const float damping = kRinging * law.density * law.sound() * 0.5f * w.reach;
  const float rate = p.dense[i] > 0 ? (dense - p.dense[i]) / step.dt : 0;
  p.dense[i] = dense;
  const float pressure = law.bulk_modulus * (dense - 1) + damping * rate;
  const float most = kMostStrain * in_slit * in_slit * law.bulk_modulus;
  p.pressure[i] = dense > 1 ? std::clamp(pressure, 0.0f, most) : 0;
  // Of the energy that the pressure does work against, the slopes by the sum and by the walls.
  const float slope = p.pressure[i] / (dense * dense * kPacking * kResponse * clear);
  s.motion[4 * static_cast<std::size_t>(i) + 3] = slope;
  s.strength[i] = p.volume[i] * slope * sum / clear;
  s.tool_strength[i] = s.strength[i] * of_tools;
}

/// Forces; the speed after them.
void push(FluidState& s, const Substep& step, ColliderLoad* loads, int i) {
  FluidParticles& p = s.particles;
  const FluidKernel& w = s.kernel;
  const float x[3] = {p.x[0][i], p.x[1][i], p.x[2][i]}, v[3] = {p.v[0][i], p.v[1][i], p.v[2][i]};
  const FluidLaw& law = s.laws[p.kind[i]];
  float force[3] = {};
  add_pair_forces(s, i, force);
  for (int a = 0; a < 3; ++a) {
    force[a] += s.strength[i] * s.wall_push[4 * static_cast<std::size_t>(i) + a];
  }
  for (std::size_t c = 0; c < step.colliders.size(); ++c) {
    if ((s.near[i] & bit_of(c)) == 0) continue;
    const Gap g = gap(step.colliders[c], x);
    const WallShare of = plane_share(w, g.distance);
    if (!(of.face > 0)) continue;
    const float push = s.tool_strength[i] * of.face / (1 - of.share);
    float on[3], arm[3], turn[3];
    for (int a = 0; a < 3; ++a) {
      force[a] += push * g.normal[a];
      on[a] = -push * g.normal[a];
      arm[a] = x[a] - g.distance * g.normal[a] - step.colliders[c].position[a];
    }
    cross3(arm, on, turn);
    for (int a = 0; a < 3; ++a) {
      loads[c].force[a] += on[a];
      loads[c].torque[a] += turn[a];
    }
  }
  const float by_mass = step.dt / (p.volume[i] * law.density);
  for (int a = 0; a < 3; ++a) {
    s.v_next[a][i] = step.keep * (v[a] + step.dt * step.gravity[a] + by_mass * force[a]);
  }
}

/// Whether a place that moves from x to y meets a triangle that moves meanwhile, or ends too near
/// to it; then by how much y is to be raised along its normal.
bool meets(const WallTriangle& begin, const WallTriangle& end, const float* x, const float* y,
           float margin, float& raise) {
  const float before = begin.height(x), after = end.height(y);
  if (after >= margin || before < -0.5f * margin) return false;
  // Where it passes the plane, or ends above it.
  const float share = after < 0 ? std::max(before, 0.0f) / (std::max(before, 0.0f) - after) : 1.0f;
  float corner[3][3], place[3];
  for (int a = 0; a < 3; ++a) {
    place[a] = x[a] + share * (y[a] - x[a]);
    for (int k = 0; k < 3; ++k) {
      corner[k][a] = begin.corner[k][a] + share * (end.corner[k][a] - begin.corner[k][a]);
    }
  }
  for (int k = 0; k < 3; ++k) {
    const float *from = corner[k], *to = corner[(k + 1) % 3];
    const float e[3] = {to[0] - from[0], to[1] - from[1], to[2] - from[2]};
    const float d[3] = {place[0] - from[0], place[1] - from[1], place[2] - from[2]};
    float c[3];
    cross3(e, d, c);
    if (dot3(c, end.normal) < -1e-3f * end.edge2) return false;
  }
  raise = margin - after;
  return true;
}

/// Raises y, where a particle comes to from x, before the triangles that move from `begin` to `end`
/// within `time`; what they take of its speed is an impulse.
void stop_at_walls(FluidState& s, const std::vector<WallTriangle>& begin,
                   const std::vector<WallTriangle>& end, float time, int i, const float* x,
                   float* y, float* v) {
  if (s.lists.wall_begin[i] == s.lists.wall_near[i]) return;
  const float margin = kRoom * s.spacing;
  const float mass = s.particles.volume[i] * s.laws[s.particles.kind[i]].density;
  FluidState::Touch& touch = s.touches[i];
  // Both ends of its way are nearer to where its walls were last looked at than these were, less
  // what they moved by.
  FluidState::Clear& clear = s.clear[i];
  const float moved = std::max(s.walls_moved[0], s.walls_moved[1]);
  const auto way = [&](const float* from) {
    float before2 = 0, after2 = 0;
    for (int a = 0; a < 3; ++a) {
      before2 += (x[a] - from[a]) * (x[a] - from[a]);
      after2 += (y[a] - from[a]) * (y[a] - from[a]);
    }
    return std::sqrt(std::max(before2, after2));
  };
  if (way(clear.x) < clear.room - moved) return;
  const FluidLists& l = s.lists;
  const float listed[3] = {l.x[0][i], l.x[1][i], l.x[2][i]};
  const float soon = kSoon * s.spacing - way(listed) - moved;  // nearer than that is none but these
  const std::int32_t until = soon > margin ? l.wall_soon[i] : l.wall_near[i];
  float nearest = soon > margin ? soon : s.kernel.reach;
  for (std::int32_t e = l.wall_begin[i]; e < until; ++e) {
    const WallTriangle& t = end[l.wall[e]];
    const float height = std::fabs(t.height(x));
    if (height < nearest) nearest = std::min(nearest, std::max(height, t.beside(x)));
  }
  clear = {{x[0], x[1], x[2]}, nearest - moved - margin};
  if (way(clear.x) < clear.room - moved) return;
  for (int pass = 0; pass < 3; ++pass) {
    float deepest = 0;
    std::int32_t hit = -1;
    for (std::int32_t e = l.wall_begin[i]; e < until; ++e) {
      const std::int32_t t = l.wall[e];
      float raise = 0;
      if (end[t].height(y) >= margin) continue;
      if (meets(begin[t], end[t], x, y, margin, raise) && raise > deepest) {
        deepest = raise;
        hit = t;
      }
    }
    if (hit < 0) break;
    const WallTriangle &from = begin[hit], &to = end[hit];
    float u[3];
    for (int a = 0; a < 3; ++a) {
      u[a] = v[a] - (to.middle[a] - from.middle[a]) / time;
      y[a] += deepest * to.normal[a];
    }
    const float into = std::min(0.0f, dot3(u, to.normal));
    touch.triangle = hit;
    for (int a = 0; a < 3; ++a) {
      v[a] -= into * to.normal[a];
      touch.impulse[a] += mass * into * to.normal[a];
    }
  }
}

/// Moves a particle to where no wall is in its way.
void move(FluidState& s, const Substep& step, ColliderLoad* loads, int i) {
  FluidParticles& p = s.particles;
  const float margin = kRoom * s.spacing;
  const float mass = p.volume[i] * s.laws[p.kind[i]].density;
  float x[3], y[3], v[3];
  for (int a = 0; a < 3; ++a) {
    x[a] = p.x[a][i];
    v[a] = s.v_next[a][i];
    y[a] = x[a] + step.dt * v[a];
  }
  stop_at_walls(s, s.now, s.now, step.dt, i, x, y, v);
  for (std::size_t c = 0; c < step.colliders.size(); ++c) {
    if ((s.near[i] & bit_of(c)) == 0) continue;
    const Collider& of = step.colliders[c];
    const Gap g = gap(of, y);
    if (g.distance >= margin) continue;
    float u[3], on[3], arm[3], turn[3];
    velocity_at(of, y, u);
    for (int a = 0; a < 3; ++a) u[a] = v[a] - u[a];
    const float into = std::min(0.0f, dot3(u, g.normal));
    for (int a = 0; a < 3; ++a) {
      y[a] += (margin - g.distance) * g.normal[a];
      v[a] -= into * g.normal[a];
      on[a] = mass * into * g.normal[a] / step.dt;
      arm[a] = y[a] - of.position[a];
    }
    cross3(arm, on, turn);
    for (int a = 0; a < 3; ++a) {
      loads[c].force[a] += on[a];
      loads[c].torque[a] += turn[a];
    }
  }
  for (int a = 0; a < 3; ++a) {
    p.x[a][i] = y[a];
    p.v[a][i] = v[a];
  }
}

/// Calls f(i, loads) for each particle; loads are summed by chunks, in order.
template <class F>
void with_loads(FluidState& s, std::vector<ColliderLoad>& loads, const F& f) {
  const int n = s.particles.size(), chunks = (n + kParticlesEach - 1) / kParticlesEach;
  const std::size_t colliders = loads.size();
  std::vector<ColliderLoad> of(chunks * colliders);
  s.cpu->for_each(chunks, [&](int chunk) {
    for (int i = chunk * kParticlesEach; i < std::min(n, (chunk + 1) * kParticlesEach); ++i) {
      f(i, of.data() + chunk * colliders);
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
/// reaches, and in each triangle to the corners in equal parts. A triangle alone may be of a shred
/// that is lighter than the particle: it would be thrown back faster than it came, time and again.
void collect_touches(const FluidState& s, FluidWalls& walls) {
  std::vector<float> weight;
  for (std::size_t i = 0; i < s.touches.size(); ++i) {
    const FluidState::Touch& touch = s.touches[i];
    if (touch.triangle < 0) continue;
    const auto give = [&](std::int32_t triangle, float share) {
      for (int k = 0; k < 9; ++k) {
        walls.impulse[std::size_t{9} * triangle + k] += share / 3 * touch.impulse[k % 3];
      }
    };
    const float* normal = s.now[touch.triangle].normal;
    const std::int32_t begin = s.lists.wall_begin[i], end = s.lists.wall_begin[i + 1];
    weight.assign(end - begin, 0.0f);
    float sum = 0;
    for (std::int32_t e = begin; e < end; ++e) {
      const WallTriangle& t = s.now[s.lists.wall[e]];
      float away2 = 0;
      for (int a = 0; a < 3; ++a) {
        const float d = t.middle[a] - s.particles.x[a][i];
        away2 += d * d;
      }
      const float left = 1 - away2 / (s.kernel.reach * s.kernel.reach),
                  facing = dot3(t.normal, normal);
      if (!(left > 0 && facing > 0)) continue;
      sum += weight[e - begin] = left * facing * t.area;
    }
    if (!(sum > 0)) give(touch.triangle, 1);
    for (std::int32_t e = begin; e < end && sum > 0; ++e) {
      if (weight[e - begin] > 0) give(s.lists.wall[e], weight[e - begin] / sum);
    }
  }
}

/// What pressure gives triangles in `time` goes to their corners likewise.
void collect(FluidState& s, float time, FluidWalls& walls) {
  constexpr int kChunks = 8,
                kTriangles = 2048;  // whatever the number of threads, for the same bits
  const FluidLists& l = s.lists;
  const int triangles = walls.size();
  s.wall_impulse.resize(std::size_t{kChunks} * triangles);
  const auto first = [&l](int chunk) {  // of particles that have as many entries in each
    const auto entry =
        static_cast<std::int32_t>(std::int64_t{l.wall_begin.back()} * chunk / kChunks);
    return std::lower_bound(l.wall_begin.begin(), l.wall_begin.end() - 1, entry) -
           l.wall_begin.begin();
  };
  s.cpu->for_each(kChunks, [&](int chunk) {
    float* sum = &s.wall_impulse[std::size_t{1} * chunk * triangles];
    std::fill_n(sum, triangles, 0.0f);
    const auto end = chunk + 1 < kChunks ? first(chunk + 1) : s.particles.size();
    for (auto i = first(chunk); i < end; ++i) {
      const float strength = time * s.strength[i];
      if (strength == 0) continue;
      const std::int32_t* triangle = &s.seen[l.wall_begin[i]];
      const float* over = &s.share[l.wall_begin[i]];
      for (int e = 0; e < s.seen_count[i]; ++e) sum[triangle[e]] += strength * over[e];
    }
  });
  s.cpu->for_each((triangles + kTriangles - 1) / kTriangles, [&](int chunk) {
    const int begin = chunk * kTriangles, count = std::min(triangles - begin, kTriangles);
    float* __restrict__ sum = s.wall_impulse.data() + begin;
    for (int k = 1; k < kChunks; ++k) {
      const float* part = s.wall_impulse.data() + std::size_t{1} * k * triangles + begin;
      for (int t = 0; t < count; ++t) sum[t] += part[t];
    }
  });
  s.cpu->for_each(
      static_cast<int>(l.met.size()),
      [&](int m) {
        const std::int32_t t = l.met[m];
        const float sum = s.wall_impulse[t];
        if (sum == 0) return;
        for (int i = 0; i < 9; ++i) {
          walls.impulse[std::size_t{9} * t + i] -= sum * s.now[t].normal[i % 3] / 3;
        }
      },
      256);
  collect_touches(s, walls);
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
  FluidParticles& p = s.particles;
  s.touches.assign(p.size(), {-1, {}});
  s.cpu->for_each(
      p.size(),
      [&](int i) {
        const float x[3] = {p.x[0][i], p.x[1][i], p.x[2][i]};
        float y[3] = {x[0], x[1], x[2]}, v[3] = {p.v[0][i], p.v[1][i], p.v[2][i]};
        stop_at_walls(s, s.before, s.now, duration, i, x, y, v);
        for (int a = 0; a < 3; ++a) {
          p.x[a][i] = y[a];
          p.v[a][i] = v[a];
        }
      },
      kParticlesEach);
  collect_touches(s, walls);
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

void substep(FluidState& s, const Substep& step, FluidWalls& walls,
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
  s.touches.assign(n, {-1, {}});
  std::vector<ColliderLoad> forces(step.colliders.size());
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
      n, [&](int i) { press(s, step, i); }, kParticlesEach);
  with_loads(s, forces, [&](int i, ColliderLoad* of) { push(s, step, of, i); });
  with_loads(s, forces, [&](int i, ColliderLoad* of) { move(s, step, of, i); });
  collect(s, step.dt, walls);
  for (std::size_t c = 0; c < forces.size(); ++c) {
    for (int a = 0; a < 3; ++a) {
      loads[c].force[a] += step.weight * forces[c].force[a];
      loads[c].torque[a] += step.weight * forces[c].torque[a];
    }
  }
}

}  // namespace

double stable_fluid_step(const FluidState& s) {
  float fastest = 0, least = 1e30f;
  const FluidParticles& p = s.particles;
  for (int i = 0; i < p.size(); ++i) {
    const float v[3] = {p.v[0][i], p.v[1][i], p.v[2][i]};
    fastest = std::max(fastest, dot3(v, v));
  }
  fastest = std::sqrt(fastest);
  const float length = 0.5f * s.kernel.reach;
  for (const FluidLaw& law : s.laws) {
    const float nu = artificial_viscosity(s, law) / law.density;
    least =
        std::min({least, kCourant * length / (law.sound() + fastest), 0.1f * length * length / nu});
  }
  return least;
}

int advance_fluid(FluidState& s, const FluidDrive& drive, FluidWalls& walls,
                  std::vector<ColliderLoad>& loads) {
  walls.impulse.resize(walls.end.size());
  if (s.particles.size() == 0) return 0;
  const int count = std::max(1, static_cast<int>(std::ceil(drive.duration / stable_fluid_step(s))));
  const auto dt = static_cast<float>(drive.duration / count);
  s.viscosity.clear();
  for (const FluidLaw& law : s.laws) s.viscosity.push_back(artificial_viscosity(s, law));
  const float skin = 0.15f * s.kernel.reach;
  if (s.lists.corners.size() != walls.end.size()) s.lists.made = false;
  s.walls_moved[0] = s.walls_moved[1];
  s.walls_moved[1] = s.lists.made ? walls_moved(s, walls.end) : 0;
  if (s.walls_moved[1] > kMayMove * skin) s.lists.made = false;
  for (int i = 0; i < count; ++i) {
    const bool make = !s.lists.made || particles_moved(s) > kMayMove * skin;
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
    const Vec3& g = drive.gravity;
    const Substep step{
        dt,
        static_cast<float>(1.0 / count),
        {static_cast<float>(g[0]), static_cast<float>(g[1]), static_cast<float>(g[2])},
        static_cast<float>(std::exp(-drive.damping * dt)),
        colliders};
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
  FluidParticles& p = s.particles;
  const float depth = 0.5f * s.spacing, margin = kRoom * s.spacing;
  list_neighbours(s, corners, 0);
  s.cpu->for_each(
      p.size(),
      [&](int i) {
        const float x[3] = {p.x[0][i], p.x[1][i], p.x[2][i]};
        float nearest = depth;
        std::int32_t behind = -1;
        for (std::int32_t e = s.lists.wall_begin[i]; e < s.lists.wall_near[i]; ++e) {
          const WallTriangle& t = s.now[s.lists.wall[e]];
          const float above[3] = {x[0] + (depth - t.height(x)) * t.normal[0],
                                  x[1] + (depth - t.height(x)) * t.normal[1],
                                  x[2] + (depth - t.height(x)) * t.normal[2]};
          const float below[3] = {x[0] - (depth + t.height(x)) * t.normal[0],
                                  x[1] - (depth + t.height(x)) * t.normal[1],
                                  x[2] - (depth + t.height(x)) * t.normal[2]};
          float raise;
          if (std::fabs(t.height(x)) >= nearest || !meets(t, t, above, below, margin, raise))
            continue;
          nearest = std::fabs(t.height(x));
          behind = t.height(x) < margin ? s.lists.wall[e] : -1;
        }
        if (behind < 0) return;
        const WallTriangle& t = s.now[behind];
        const float raise = margin - t.height(x);
        for (int a = 0; a < 3; ++a) p.x[a][i] += raise * t.normal[a];
      },
      64);
  s.lists.made = false;
}

}  // namespace tissue_sim
