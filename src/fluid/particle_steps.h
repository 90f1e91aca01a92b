// What a particle of fluid does in a substep, on a CPU and on a GPU: it presses, is pushed, moves,
// and stops at walls. Each reads what others were and writes what is its own.
#pragma once

#include <cmath>
#include <cstdint>

#include "fluid/fluid_laws.h"
#include "tools/collider.h"

namespace tissue_sim {

/// A Fluid as a substep reads it.
struct FluidLaw {
  float density, viscosity, bulk_modulus;
  TISSUE_SIM_INLINE float sound() const { return sqrtf(bulk_modulus / density); }  ///< [m/s]
};

/// Where a particle was, and how far nothing comes that it may touch, but for what walls move by
/// from where they were listed [m].
struct FluidClear {
  float x[3], room;
};

struct FluidTouch {
  std::int32_t triangle;  ///< -1 for none
  float impulse[3];       ///< of the particle on it [N s]
};

/// The arrays of a substep where they are: FluidState has them, or a GPU.
struct FluidView {
  int size;
  FluidKernel kernel;
  float spacing;
  const FluidLaw* laws;
  const std::uint8_t* kind;
  const float* volume;
  float *x[3], *v[3], *v_next[3], *pressure, *dense;
  const std::int32_t *wall_begin, *wall_soon, *wall_near, *wall;
  const float* listed[3];
  const WallTriangle *before, *now;
  float walls_moved;  ///< at most, at either end of the interval [m]
  float *motion, *strength, *tool_strength, *wall_push;
  std::uint64_t* near;
  FluidClear* clear;
};

struct FluidSubstep {
  float dt;      // [s]
  float weight;  // of the interval
  float gravity[3];
  float keep;  // of speed, after damping
  const Collider* colliders;
  int collider_count;
};

namespace fluid {

/// Of sound over a smoothing length (half of the kernel's reach). A cork in water keeps a hundred
/// times the energy with 0.8, no more with 0.6 than with 0.4.
inline constexpr float kCourant = 0.6f;
/// Viscosity that keeps the particles' own jitter down, as Monaghan's alpha.
inline constexpr float kAlpha = 0.02f;
/// Viscosity against changes of volume alone, over that of sound in a smoothing length: it takes
/// the ringing out and leaves what flows.
inline constexpr float kRinging = 0.25f;
/// What the kernel sums up to where particles have settled, and how much of a small change of
/// density that sum shows (a particle itself does not come nearer): measured in a periodic box for
/// FluidKernel::reach = kFluidReach spacings.
inline constexpr float kPacking = 1.0076f, kResponse = 0.983f;
/// Of the modulus, the most that a drop presses with: in a slit narrower than it is it would take
/// off, at 38 m/s out of a cut that bled. What a wave of the fastest speed brings is below it.
inline constexpr float kMostStrain = 0.2f;
/// Of its kernel what walls leave it in a slit of 0.4 spacings: where less is left, between sides
/// of a cut that close or overlap, it presses with less and less. It would drive them apart with
/// all that it may press with, however far they went.
inline constexpr float kSlit = 0.25f;
/// Of a spacing: nearer to a wall no particle comes.
inline constexpr float kRoom = 0.02f;
/// Spacings within which a wall is soon to be touched.
inline constexpr float kSoon = 0.5f;
/// Of the kernel's reach: how far beyond it lists look, and how much of that may be used up. Two
/// that come towards each other stay below it.
inline constexpr float kSkin = 0.15f, kMayMove = 0.48f * kSkin;

/// A collider's bit of FluidView::near; those behind the 63rd share one.
TISSUE_SIM_INLINE std::uint64_t bit_of(int collider) {
  return std::uint64_t{1} << (collider < 63 ? collider : 63);
}

/// Of a law, with what keeps jitter down [Pa s].
TISSUE_SIM_INLINE float artificial_viscosity(const FluidKernel& kernel, const FluidLaw& law) {
  return law.viscosity + 0.1f * kAlpha * law.density * law.sound() * 0.5f * kernel.reach;
}

TISSUE_SIM_INLINE float between(float low, float x, float high) {
  return x < low ? low : (high < x ? high : x);
}

/// Density, pressure and what it weighs: of what its neighbours' volumes sum up to by the kernel,
/// and the share of it that tissue takes.
TISSUE_SIM_INLINE void press(const FluidView& s, const FluidSubstep& step, int i, float sum,
                             float tissue) {
  const FluidKernel& w = s.kernel;
  const float x[3] = {s.x[0][i], s.x[1][i], s.x[2][i]};
  // Tools at right angles each take their share of what the others leave; what is tissue is none
  // of theirs.
  float clear = 1;
  std::uint64_t near = 0;
  for (int c = 0; c < step.collider_count; ++c) {
    const float distance = gap(step.colliders[c], x).distance;
    if (!(distance < w.reach)) continue;
    near |= bit_of(c);
    clear *= 1 - plane_share(w, distance).share;
  }
  s.near[i] = near;
  const float of_tools = clear;
  const float in_slit = between(0.0f, (clear - tissue) / kSlit, 1.0f);
  clear = larger(clear - tissue, 0.05f);
  const float dense = 1 + (sum / (kPacking * clear) - 1) / kResponse;
  const FluidLaw& law = s.laws[s.kind[i]];
  const float damping = kRinging * law.density * law.sound() * 0.5f * w.reach;
  const float rate = s.dense[i] > 0 ? (dense - s.dense[i]) / step.dt : 0;
  s.dense[i] = dense;
  const float pressure = law.bulk_modulus * (dense - 1) + damping * rate;
  const float most = kMostStrain * in_slit * in_slit * law.bulk_modulus;
  s.pressure[i] = dense > 1 ? between(0.0f, pressure, most) : 0;
  // Of the energy that the pressure does work against, the slopes by the sum and by the walls.
  const float slope = s.pressure[i] / (dense * dense * kPacking * kResponse * clear);
  s.motion[4 * static_cast<std::size_t>(i) + 3] = slope;
  s.strength[i] = s.volume[i] * slope * sum / clear;
  s.tool_strength[i] = s.strength[i] * of_tools;
}

/// The speed after forces, of which `force` has what neighbours do [N]; add(c, force, torque) takes
/// what acts on a collider.
template <class Add>
TISSUE_SIM_INLINE void push(const FluidView& s, const FluidSubstep& step, int i,
                            const float (&of_pairs)[3], const Add& add) {
  const FluidKernel& w = s.kernel;
  const float x[3] = {s.x[0][i], s.x[1][i], s.x[2][i]};
  const FluidLaw& law = s.laws[s.kind[i]];
  float force[3];
  for (int a = 0; a < 3; ++a) {
    force[a] = of_pairs[a] + s.strength[i] * s.wall_push[4 * static_cast<std::size_t>(i) + a];
  }
  for (int c = 0; c < step.collider_count; ++c) {
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
    add(c, on, turn);
  }
  const float by_mass = step.dt / (s.volume[i] * law.density);
  for (int a = 0; a < 3; ++a) {
    s.v_next[a][i] = step.keep * (s.v[a][i] + step.dt * step.gravity[a] + by_mass * force[a]);
  }
}

/// Whether a place that moves from x to y meets a triangle that moves meanwhile, or ends too near
/// to it; then by how much y is to be raised along its normal.
TISSUE_SIM_INLINE bool meets(const WallTriangle& begin, const WallTriangle& end, const float* x,
                             const float* y, float margin, float& raise) {
  const float before = begin.height(x), after = end.height(y);
  if (after >= margin || before < -0.5f * margin) return false;
  // Where it passes the plane, or ends above it.
  const float share = after < 0 ? larger(before, 0.0f) / (larger(before, 0.0f) - after) : 1.0f;
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

/// Who looks at the walls of a particle: one, or a team of threads (fluid_kernels.cu).
struct OneLane {
  static constexpr int kLanes = 1;
  int lane = 0;
  float least(float x) const { return x; }
  /// Of the deepest, and among such the first.
  void deepest(float& /*raise*/, std::int32_t& /*entry*/) const {}
  /// All have read what the first is about to write.
  void meet() const {}
};

/// How far the farther end of a way is from a place [m].
TISSUE_SIM_INLINE float farther(const float* x, const float* y, const float* from) {
  float before2 = 0, after2 = 0;
  for (int a = 0; a < 3; ++a) {
    before2 += (x[a] - from[a]) * (x[a] - from[a]);
    after2 += (y[a] - from[a]) * (y[a] - from[a]);
  }
  return sqrtf(larger(before2, after2));
}

/// Whether no wall can be in a particle's way from x to y: both ends are nearer to where its walls
/// were last looked at than these were, less what they moved by.
TISSUE_SIM_INLINE bool is_clear(const FluidView& s, int i, const float* x, const float* y) {
  if (s.wall_begin[i] == s.wall_near[i]) return true;
  const FluidClear clear = s.clear[i];
  return farther(x, y, clear.x) < clear.room - s.walls_moved;
}

/// Raises y, where a particle comes to from x, before the triangles that move from `begin` to `end`
/// within `time`; what they take of its speed is an impulse.
template <class Lanes>
TISSUE_SIM_INLINE FluidTouch stop_at_walls(const FluidView& s, const WallTriangle* begin,
                                           const WallTriangle* end, float time, int i,
                                           const float* x, float* y, float* v, const Lanes& lanes) {
  FluidTouch touch{-1, {}};
  if (is_clear(s, i, x, y)) return touch;
  const float margin = kRoom * s.spacing;
  const float mass = s.volume[i] * s.laws[s.kind[i]].density;
  const float listed[3] = {s.listed[0][i], s.listed[1][i], s.listed[2][i]};
  // Nearer than that is none but these.
  const float soon = kSoon * s.spacing - farther(x, y, listed) - s.walls_moved;
  const std::int32_t first = s.wall_begin[i] + lanes.lane;
  const std::int32_t until = soon > margin ? s.wall_soon[i] : s.wall_near[i];
  float nearest = soon > margin ? soon : s.kernel.reach;
  for (std::int32_t e = first; e < until; e += Lanes::kLanes) {
    const WallTriangle& t = end[s.wall[e]];
    const float height = fabsf(t.height(x));
    if (height < nearest) nearest = lesser(nearest, larger(height, t.beside(x)));
  }
  const FluidClear clear{{x[0], x[1], x[2]}, lanes.least(nearest) - s.walls_moved - margin};
  if (lanes.lane == 0) s.clear[i] = clear;
  if (farther(x, y, clear.x) < clear.room - s.walls_moved) return touch;
  for (int pass = 0; pass < 3; ++pass) {
    float deepest = 0;
    std::int32_t hit = -1;
    for (std::int32_t e = first; e < until; e += Lanes::kLanes) {
      const std::int32_t t = s.wall[e];
      float raise = 0;
      if (end[t].height(y) >= margin) continue;
      if (meets(begin[t], end[t], x, y, margin, raise) && raise > deepest) {
        deepest = raise;
        hit = e;
      }
    }
    lanes.deepest(deepest, hit);
    if (hit < 0) break;
    touch.triangle = s.wall[hit];
    const WallTriangle &from = begin[touch.triangle], &to = end[touch.triangle];
    float u[3];
    for (int a = 0; a < 3; ++a) {
      u[a] = v[a] - (to.middle[a] - from.middle[a]) / time;
      y[a] += deepest * to.normal[a];
    }
    const float into = lesser(0.0f, dot3(u, to.normal));
    for (int a = 0; a < 3; ++a) {
      v[a] -= into * to.normal[a];
      touch.impulse[a] += mass * into * to.normal[a];
    }
  }
  return touch;
}

/// What a triangle takes of a touch of a particle at x, by its distance and which way it faces; not
/// over what all take together. A triangle alone may be of a shred that is lighter than the
/// particle: it would be thrown back faster than it came, time and again.
TISSUE_SIM_INLINE float touch_weight(const FluidView& s, const float* x, const WallTriangle& t,
                                     const float* normal) {
  float away2 = 0;
  for (int a = 0; a < 3; ++a) {
    const float d = t.middle[a] - x[a];
    away2 += d * d;
  }
  const float left = 1 - away2 / (s.kernel.reach * s.kernel.reach), facing = dot3(t.normal, normal);
  return left > 0 && facing > 0 ? left * facing * t.area : 0.0f;
}

/// The walls move from `before` to `now` in `time`; a particle that they come to goes with them.
template <class Lanes>
TISSUE_SIM_INLINE FluidTouch yield_to_walls(const FluidView& s, float time, int i,
                                            const Lanes& lanes) {
  const float x[3] = {s.x[0][i], s.x[1][i], s.x[2][i]};
  float y[3] = {x[0], x[1], x[2]}, v[3] = {s.v[0][i], s.v[1][i], s.v[2][i]};
  const FluidTouch touch = stop_at_walls(s, s.before, s.now, time, i, x, y, v, lanes);
  lanes.meet();
  if (lanes.lane != 0) return touch;
  for (int a = 0; a < 3; ++a) {
    s.x[a][i] = y[a];
    s.v[a][i] = v[a];
  }
  return touch;
}

/// Where a substep takes a particle if nothing is in its way.
struct FluidWay {
  float x[3], y[3], v[3];  ///< from, to [m]; its speed [m/s]

  TISSUE_SIM_INLINE FluidWay(const FluidView& s, const FluidSubstep& step, int i) {
    for (int a = 0; a < 3; ++a) {
      x[a] = s.x[a][i];
      v[a] = s.v_next[a][i];
      y[a] = x[a] + step.dt * v[a];
    }
  }
};

/// A particle comes to where its way ends, or before the colliders there; adds to loads.
template <class Add>
TISSUE_SIM_INLINE void arrive(const FluidView& s, const FluidSubstep& step, int i, FluidWay way,
                              const Add& add) {
  const float margin = kRoom * s.spacing;
  const float mass = s.volume[i] * s.laws[s.kind[i]].density;
  float(&y)[3] = way.y, (&v)[3] = way.v;
  for (int c = 0; c < step.collider_count; ++c) {
    if ((s.near[i] & bit_of(c)) == 0) continue;
    const Collider& of = step.colliders[c];
    const Gap g = gap(of, y);
    if (g.distance >= margin) continue;
    float u[3], on[3], arm[3], turn[3];
    velocity_at(of, y, u);
    for (int a = 0; a < 3; ++a) u[a] = v[a] - u[a];
    const float into = lesser(0.0f, dot3(u, g.normal));
    for (int a = 0; a < 3; ++a) {
      y[a] += (margin - g.distance) * g.normal[a];
      v[a] -= into * g.normal[a];
      on[a] = mass * into * g.normal[a] / step.dt;
      arm[a] = y[a] - of.position[a];
    }
    cross3(arm, on, turn);
    add(c, on, turn);
  }
  for (int a = 0; a < 3; ++a) {
    s.x[a][i] = y[a];
    s.v[a][i] = v[a];
  }
}

/// Moves a particle to where no wall is in its way; the first lane adds to loads.
template <class Lanes, class Add>
TISSUE_SIM_INLINE FluidTouch move(const FluidView& s, const FluidSubstep& step, int i,
                                  const Lanes& lanes, const Add& add) {
  FluidWay way(s, step, i);
  const FluidTouch touch = stop_at_walls(s, s.now, s.now, step.dt, i, way.x, way.y, way.v, lanes);
  lanes.meet();
  if (lanes.lane == 0) arrive(s, step, i, way, add);
  return touch;
}

/// A particle that lies shallowly behind a triangle goes before it.
TISSUE_SIM_INLINE void leave_wall(const FluidView& s, int i) {
  const float depth = 0.5f * s.spacing, margin = kRoom * s.spacing;
  const float x[3] = {s.x[0][i], s.x[1][i], s.x[2][i]};
  float nearest = depth;
  std::int32_t behind = -1;
  for (std::int32_t e = s.wall_begin[i]; e < s.wall_near[i]; ++e) {
    const WallTriangle& t = s.now[s.wall[e]];
    const float height = t.height(x);
    float above[3], below[3], raise;
    for (int a = 0; a < 3; ++a) {
      above[a] = x[a] + (depth - height) * t.normal[a];
      below[a] = x[a] - (depth + height) * t.normal[a];
    }
    if (fabsf(height) >= nearest || !meets(t, t, above, below, margin, raise)) continue;
    nearest = fabsf(height);
    behind = height < margin ? s.wall[e] : -1;
  }
  if (behind < 0) return;
  const WallTriangle& t = s.now[behind];
  const float raise = margin - t.height(x);
  for (int a = 0; a < 3; ++a) s.x[a][i] += raise * t.normal[a];
}

}  // namespace fluid
}  // namespace tissue_sim
