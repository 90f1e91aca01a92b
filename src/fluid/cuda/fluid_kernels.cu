#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>

#include "compute/fixed_sum.h"
#include "compute/for_each_cuda.h"
#include "fluid/cuda/fluid_kernels.h"
#include "fluid/wall_integrals.h"

namespace tissue_sim {
namespace {

/// Threads of one warp that work for a particle or a triangle.
template <int kThreads>
struct TeamOf {
  static constexpr int kLanes = kThreads;
  int lane;
  unsigned mask;
  __device__ TeamOf() {
    lane = static_cast<int>(threadIdx.x % kLanes);
    mask = (0xffffffffu >> (32 - kLanes)) << first();
  }
  /// Of its threads in the warp.
  __device__ static int first() { return static_cast<int>(threadIdx.x % 32 / kLanes * kLanes); }
  __device__ int of_lane(int x, int of) const { return __shfl_sync(mask, x, of, kLanes); }
  /// Those lanes for which it holds.
  __device__ unsigned which(bool holds) const {
    return (__ballot_sync(mask, holds) & mask) >> first();
  }
  __device__ float sum(float x) const {
    for (int step = kLanes / 2; step > 0; step /= 2) x += __shfl_xor_sync(mask, x, step);
    return x;
  }
  __device__ float least(float x) const {
    for (int step = kLanes / 2; step > 0; step /= 2) x = fminf(x, __shfl_xor_sync(mask, x, step));
    return x;
  }
  __device__ void deepest(float& raise, std::int32_t& entry) const {
    for (int step = kLanes / 2; step > 0; step /= 2) {
      const float other = __shfl_xor_sync(mask, raise, step);
      const std::int32_t of = __shfl_xor_sync(mask, entry, step);
      if (of >= 0 && (entry < 0 || other > raise || (other == raise && of < entry))) {
        raise = other;
        entry = of;
      }
    }
  }
  __device__ void meet() const { __syncwarp(mask); }
  /// How many with a lower number it holds for; then for how many.
  __device__ int before(bool holds, int& all) const {
    const unsigned those = which(holds);
    all = __popc(those);
    return __popc(those & ((1u << lane) - 1));
  }
};
/// Who sums over neighbours, and who looks at walls.
using Team = TeamOf<8>;
using Warp = TeamOf<32>;
constexpr int kTeam = Team::kLanes;

__device__ __forceinline__ void most_of_warp(unsigned* most, float x) {
  unsigned bits = __float_as_uint(x);
  const unsigned active = __activemask();
  if (active == 0xffffffffu) {
    for (int step = 16; step > 0; step /= 2) {
      bits = max(bits, __shfl_xor_sync(0xffffffffu, bits, step));
    }
    if (threadIdx.x % 32 != 0) return;
  }
  if (bits > *most) atomicMax(most, bits);
}

__global__ void fluid_bounds(FluidView s, float* box) {
  __shared__ float low[32][3], high[32][3];
  float a[3] = {3e38f, 3e38f, 3e38f}, b[3] = {-3e38f, -3e38f, -3e38f};
  for (int i = static_cast<int>(threadIdx.x); i < s.size; i += static_cast<int>(blockDim.x)) {
    for (int k = 0; k < 3; ++k) {
      a[k] = fminf(a[k], s.x[k][i]);
      b[k] = fmaxf(b[k], s.x[k][i]);
    }
  }
  for (int k = 0; k < 3; ++k) {
    for (int step = 16; step > 0; step /= 2) {
      a[k] = fminf(a[k], __shfl_xor_sync(0xffffffffu, a[k], step));
      b[k] = fmaxf(b[k], __shfl_xor_sync(0xffffffffu, b[k], step));
    }
    if (threadIdx.x % 32 == 0) low[threadIdx.x / 32][k] = a[k], high[threadIdx.x / 32][k] = b[k];
  }
  __syncthreads();
  if (threadIdx.x >= 3) return;
  const int k = static_cast<int>(threadIdx.x);
  for (unsigned w = 1; w < blockDim.x / 32; ++w) {
    low[0][k] = fminf(low[0][k], low[w][k]);
    high[0][k] = fmaxf(high[0][k], high[w][k]);
  }
  box[k] = low[0][k];
  box[3 + k] = high[0][k];
}

__device__ __forceinline__ int cell_at(const FluidGrid& g, float x, int a) {
  const float c = (x - g.low[a]) / g.edge;
  return c > 0 ? min(g.size[a] - 1, static_cast<int>(fminf(c, 1e9f))) : 0;
}
__device__ __forceinline__ int cell_of(const FluidGrid& g, int x, int y, int z) {
  return (z * g.size[1] + y) * g.size[0] + x;
}

struct FindCells {
  FluidView s;
  FluidGrid g;
  std::uint32_t* cell;
  std::int32_t* number;
  __device__ void operator()(int i) const {
    cell[i] =
        cell_of(g, cell_at(g, s.x[0][i], 0), cell_at(g, s.x[1][i], 1), cell_at(g, s.x[2][i], 2));
    number[i] = i;
  }
};

struct BeginCells {
  FluidView s;
  FluidGrid g;
  const std::uint32_t* cell;
  __device__ void operator()(int k) const {
    const int from = k == 0 ? 0 : static_cast<int>(cell[k - 1]) + 1;
    const int to = k == s.size ? g.cells() : static_cast<int>(cell[k]);
    for (int c = from; c <= to; ++c) g.begin[c] = k;
    if (k == s.size) return;
    const std::int32_t i = g.sorted[k];
    g.place[k] = {s.x[0][i], s.x[1][i], s.x[2][i], 0};
  }
};

/// Calls visit(k, there) for each place in rows of cells around `x`, a team's at a time; `there`:
/// it is one, and nearer than `reach`. Lanes look up a row each: most around a triangle are empty.
template <class Lanes, class Visit>
__device__ __forceinline__ void visit_near(const FluidGrid& g, const float* x, float reach,
                                           const Lanes& lanes, const Visit& visit) {
  int from[3], to[3];
  for (int a = 0; a < 3; ++a) {
    if (x[a] + reach < g.low[a] || x[a] - reach > g.low[a] + g.size[a] * g.edge) return;
    from[a] = cell_at(g, x[a] - reach, a);
    to[a] = cell_at(g, x[a] + reach, a);
  }
  const int across = to[1] - from[1] + 1, rows = across * (to[2] - from[2] + 1);
  for (int first = 0; first < rows; first += Lanes::kLanes) {
    const int own = first + lanes.lane;
    std::int32_t own_begin = 0, own_end = 0;
    if (own < rows) {
      const int y = from[1] + own % across, z = from[2] + own / across;
      own_begin = g.begin[cell_of(g, from[0], y, z)];
      own_end = g.begin[cell_of(g, to[0], y, z) + 1];
    }
    for (unsigned full = lanes.which(own_begin < own_end); full != 0; full &= full - 1) {
      const int of = __ffs(static_cast<int>(full)) - 1;
      const std::int32_t begin = lanes.of_lane(own_begin, of), end = lanes.of_lane(own_end, of);
      for (std::int32_t row = begin; row < end; row += Lanes::kLanes) {
        const std::int32_t k = row + lanes.lane;
        bool there = k < end;
        if (there) {
          const float4 p = g.place[k];
          const float d[3] = {p.x - x[0], p.y - x[1], p.z - x[2]};
          there = dot3(d, d) < reach * reach;
        }
        visit(k, there);
      }
    }
  }
}

struct FindNeighbours {
  FluidView s;
  FluidGrid g;
  float reach;
  std::int32_t* counts;
  const std::int32_t* begin;
  std::int32_t* other;
  __device__ void operator()(int t) const {
    const int i = t / kTeam;
    const Team team;
    const float x[3] = {s.x[0][i], s.x[1][i], s.x[2][i]};
    int found = 0;
    std::int32_t* const to = other == nullptr ? nullptr : other + begin[i];
    visit_near(g, x, reach, team, [&](std::int32_t k, bool there) {
      int all;
      const int before = team.before(there, all);
      if (to != nullptr && there) to[found + before] = g.sorted[k];
      found += all;
    });
    if (to == nullptr && team.lane == 0) counts[i] = found;
  }
};

struct PlaceTriangles {
  const float* corners;
  const std::int32_t* pair_begin;
  WallTriangle* to;
  __device__ void operator()(int t) const {
    if (pair_begin != nullptr && pair_begin[t] == pair_begin[t + 1]) return;
    to[t].place(corners + std::size_t{9} * t);
  }
};

/// A warp a triangle.
struct FindPairs {
  FluidView s;
  FluidGrid g;
  FluidWallReach of;
  std::int32_t* counts;
  const std::int32_t* begin;
  std::uint32_t* key;
  std::int32_t *number, *triangle, *particle;
  __device__ void operator()(int thread) const {
    const int t = thread / 32;
    const Warp warp;
    const WallTriangle& wall = s.now[t];
    int found = 0;
    const std::int32_t first = key == nullptr ? 0 : begin[t];
    const bool is_wall = of.is_bit == nullptr || of.is_bit[t] == 0;
    if (is_wall) {
      visit_near(g, wall.middle, of.reach + wall.radius, warp, [&](std::int32_t k, bool there) {
        int all;
        const int before = warp.before(there, all);
        if (key != nullptr && there) {
          const std::int32_t at = first + found + before;
          const float4 p = g.place[k];
          const float x[3] = {p.x, p.y, p.z};
          const float distance = wall.beside(x);
          const std::int32_t i = g.sorted[k];
          key[at] = 4u * static_cast<unsigned>(i) +
                    (distance < of.near ? (distance < of.soon ? 0u : 1u) : 2u);
          number[at] = at;
          triangle[at] = t;
          particle[at] = i;
        }
        found += all;
      });
    }
    if (key == nullptr && warp.lane == 0) counts[t] = found;
  }
};

struct PutEntries {
  int particles, pairs;
  const std::uint32_t* key;
  const std::int32_t *pair, *triangle;
  std::int32_t *wall_begin, *wall_soon, *wall_near, *wall, *wall_of, *pair_entry;

  __device__ int first_of(std::uint32_t k) const {
    int low = 0, high = pairs;
    while (low < high) {
      const int middle = (low + high) / 2;
      if (key[middle] < k) {
        low = middle + 1;
      } else {
        high = middle;
      }
    }
    return low;
  }
  __device__ void operator()(int i) const {
    if (i < pairs) {
      wall[i] = triangle[pair[i]];
      wall_of[i] = static_cast<std::int32_t>(key[i] / 4);
      pair_entry[pair[i]] = i;
    }
    if (i > particles) return;
    const std::uint32_t k = 4u * static_cast<unsigned>(i);
    int e = first_of(k);
    wall_begin[i] = e;
    if (i == particles) return;
    while (e < pairs && key[e] < k + 1) ++e;
    wall_soon[i] = e;
    while (e < pairs && key[e] < k + 2) ++e;
    wall_near[i] = e;
  }
};

struct FindWallsMoved {
  const float *corners, *listed;
  const std::uint8_t* is_bit;
  unsigned* most;
  __device__ void operator()(int c) const {
    if (is_bit != nullptr && is_bit[c / 3] != 0) return;
    const float *x = corners + std::size_t{3} * c, *y = listed + std::size_t{3} * c;
    const float d[3] = {x[0] - y[0], x[1] - y[1], x[2] - y[2]};
    most_of_warp(most, dot3(d, d));
  }
};

/// What a particle sees of a wall: a thread each, as near triangles are rare and dear.
struct See {
  FluidOnGpu s;

  /// What the kernel at x has of a triangle, and its integral over it [1/m].
  __device__ float see(const float* x, const WallTriangle& t, float& over) const {
    const float m[3] = {t.middle[0] - x[0], t.middle[1] - x[1], t.middle[2] - x[2]};
    const float d2 = dot3(m, m), far = s.kernel.reach + t.radius;
    over = 0;
    if (!(d2 < far * far)) return 0;
    if (d2 > fluid::kFar * fluid::kFar * (t.radius * t.radius)) {
      const fluid::FarTriangle<float> of(m, t.normal, t.area, s.kernel);
      over = of.over;
      return of.share;
    }
    fluid::CloseTriangle<float> of;
    for (int k = 0; k < 9; ++k) of.c[k / 3][k % 3] = t.corner[k / 3][k % 3] - x[k % 3];
    of.begin(t.normal, t.area, s.kernel.reach);
    int places = 0;
    for (fluid::TrianglePlaces at(fluid::parts_of(t.edge2, s.kernel.reach)); !at.done();
         at.next()) {
      of.add_place(at.a(), at.b());
      ++places;
    }
    over = of.over(places, s.kernel);
    return of.angle_share() - of.kernel_share(places, s.kernel.reach);
  }

  __device__ void operator()(int e) const {
    const float4 p = s.place[s.wall_of[e]];
    const float x[3] = {p.x, p.y, p.z};
    const WallTriangle& t = s.now[s.wall[e]];
    float over;
    const float share = see(x, t, over);
    s.share[e] = over;
    s.seen[e] = {over * t.normal[0], over * t.normal[1], over * t.normal[2], share};
  }
};

struct Press {
  FluidOnGpu s;
  FluidSubstep step;
  __device__ void operator()(int thread) const {
    const int i = thread / kTeam;
    const Team team;
    const float4 p = s.place[i];
    const float x[3] = {p.x, p.y, p.z}, by_reach = 1 / s.kernel.reach;
    float sum = 0;
    for (std::int32_t e = s.begin[i] + team.lane; e < s.begin[i + 1]; e += kTeam) {
      const float4 q = s.place[s.other[e]];
      const float d[3] = {x[0] - q.x, x[1] - q.y, x[2] - q.z};
      const float t = fminf(sqrtf(dot3(d, d)) * by_reach, 1.0f), u2 = (1 - t) * (1 - t);
      sum += q.w * (u2 * u2 * (4 * t + 1));
    }
    float tissue = 0, normal[3] = {};
    for (std::int32_t e = s.wall_begin[i] + team.lane; e < s.wall_begin[i + 1]; e += kTeam) {
      const float4 seen = s.seen[e];
      tissue += seen.w;
      normal[0] += seen.x, normal[1] += seen.y, normal[2] += seen.z;
    }
    sum = team.sum(sum);
    tissue = team.sum(tissue);
    for (float& n : normal) n = team.sum(n);
    if (team.lane != 0) return;
    for (int a = 0; a < 3; ++a) s.wall_push[4 * static_cast<std::size_t>(i) + a] = normal[a];
    fluid::press(s, step, i, s.kernel.value(0) * sum, tissue);
  }
};

/// Sums what particles do to colliders: in shared memory for the first of them.
class Loads {
 public:
  static constexpr int kShared = 16;
  __device__ Loads(unsigned long long* shared, unsigned long long* all)
      : shared_(shared), all_(all) {}
  __device__ void operator()(int c, const float* force, const float* torque) const {
    unsigned long long* const to =
        c < kShared ? shared_ + kFluidLoadSums * c : all_ + kFluidLoadSums * c;
    for (int a = 0; a < 3; ++a) {
      add_fixed(to + a, force[a], kFluidLoadUnit);
      add_fixed(to + 3 + a, torque[a], kFluidLoadUnit);
    }
  }

 private:
  unsigned long long *shared_, *all_;
};

/// Calls f(i, loads) for each below n.
template <class F>
__global__ void with_loads(int n, F f, unsigned long long* loads) {
  constexpr int kSums = Loads::kShared * kFluidLoadSums;
  __shared__ unsigned long long shared[kSums];
  for (int k = static_cast<int>(threadIdx.x); k < kSums; k += static_cast<int>(blockDim.x)) {
    shared[k] = 0;
  }
  __syncthreads();
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i < n) f(i, Loads(shared, loads));
  __syncthreads();
  for (int k = static_cast<int>(threadIdx.x); k < kSums; k += static_cast<int>(blockDim.x)) {
    if (shared[k] != 0) atomicAdd(loads + k, shared[k]);
  }
}

template <class F>
void launch_with_loads(int n, const F& f, unsigned long long* loads, cudaStream_t stream) {
  constexpr int kThreads = 128;
  if (n == 0) return;
  with_loads<<<(n + kThreads - 1) / kThreads, kThreads, 0, stream>>>(n, f, loads);
  check_cuda(cudaGetLastError(), "start a kernel");
}

struct Push {
  FluidOnGpu s;
  FluidSubstep step;
  __device__ void operator()(int thread, const Loads& loads) const {
    const int i = thread / kTeam;
    const Team team;
    const float4 p = s.place[i];
    const float4* const motions = reinterpret_cast<const float4*>(s.motion);
    const float4 m = motions[i];
    const float by_reach = 1 / s.kernel.reach;
    const float soft2 = 0.0025f * s.kernel.reach * s.kernel.reach;
    const float own = s.viscosity[s.kind[i]];
    float force[3] = {};
    for (std::int32_t e = s.begin[i] + team.lane; e < s.begin[i + 1]; e += kTeam) {
      const std::int32_t j = s.other[e];
      const float4 q = s.place[j], n = motions[j];
      const float d[3] = {p.x - q.x, p.y - q.y, p.z - q.z}, r2 = dot3(d, d);
      const float w = 1 - fminf(sqrtf(r2) * by_reach, 1.0f);
      const float nearing = (m.x - n.x) * d[0] + (m.y - n.y) * d[1] + (m.z - n.z) * d[2];
      const float eta = 5 * (own + s.viscosity[s.kind[j]]);
      const float scale = q.w * (eta * nearing / (r2 + soft2) - (m.w + n.w)) * (w * w * w);
      for (int a = 0; a < 3; ++a) force[a] += scale * d[a];
    }
    for (float& f : force) f = p.w * s.kernel.slope_by_r(0) * team.sum(f);
    if (team.lane == 0) fluid::push(s, step, i, force, loads);
  }
};

/// What walls met a particle with goes to those around, as fluid::touch_weight() says.
__device__ __forceinline__ void give_touch(const FluidOnGpu& s, int i, const FluidTouch& touch,
                                           const Warp& team) {
  if (touch.triangle < 0) return;
  team.meet();  // the first of the team put it there
  const float x[3] = {s.x[0][i], s.x[1][i], s.x[2][i]};
  const float* normal = s.now[touch.triangle].normal;
  const std::int32_t begin = s.wall_begin[i] + team.lane, end = s.wall_begin[i + 1];
  const auto weight = [&](std::int32_t e) {
    return fluid::touch_weight(s, x, s.now[s.wall[e]], normal);
  };
  const auto give = [&](std::int32_t t, float share) {
    for (int a = 0; a < 3; ++a) {
      add_fixed(s.touched + 3 * static_cast<std::size_t>(t) + a, share * touch.impulse[a],
                kImpulseUnit);
    }
  };
  float sum = 0;
  for (std::int32_t e = begin; e < end; e += Warp::kLanes) sum += weight(e);
  sum = team.sum(sum);
  if (!(sum > 0)) {
    if (team.lane == 0) give(touch.triangle, 1);
    return;
  }
  for (std::int32_t e = begin; e < end; e += Warp::kLanes) give(s.wall[e], weight(e) / sum);
}

/// For the substep that comes next.
__device__ __forceinline__ void pack(const FluidOnGpu& s, int i) {
  s.place[i] = {s.x[0][i], s.x[1][i], s.x[2][i], s.volume[i]};
  for (int a = 0; a < 3; ++a) s.motion[4 * static_cast<std::size_t>(i) + a] = s.v[a][i];
}

/// Lists a particle that walls may be in the way of.
__device__ __forceinline__ void list_met(const FluidOnGpu& s, int* count, int i) {
  const unsigned all = __activemask();
  const int lane = static_cast<int>(threadIdx.x % 32), leader = __ffs(static_cast<int>(all)) - 1;
  int first = 0;
  if (lane == leader) first = atomicAdd(count, __popc(all));
  first = __shfl_sync(all, first, leader);
  s.met[first + __popc(all & ((1u << lane) - 1))] = i;
}

/// Threads that work through those listed, whose number the host does not know: all that an
/// H200 has at once.
constexpr int kMetThreads = 1 << 18;

/// Calls f(i, warp) for those listed, a warp each, of `threads` in all.
template <class F>
__device__ __forceinline__ void each_met(const FluidOnGpu& s, int count, int thread, int threads,
                                         const F& f) {
  const Warp warp;
  for (int k = thread / 32; k < count; k += threads / 32) f(s.met[k], warp);
}

/// How fast and how far; x and v of a particle whose `i` is -1 count for nothing.
__device__ __forceinline__ void measure_most(const FluidOnGpu& s, int i) {
  float speed2 = 0, moved2 = 0;
  for (int a = 0; a < 3 && i >= 0; ++a) {
    const float d = s.x[a][i] - s.listed[a][i];
    speed2 += s.v[a][i] * s.v[a][i];
    moved2 += d * d;
  }
  most_of_warp(&s.most->speed2, speed2);
  most_of_warp(&s.most->moved2, moved2);
}

/// Those that are clear of walls; the others are listed.
struct Move {
  FluidOnGpu s;
  FluidSubstep step;
  __device__ void operator()(int i, const Loads& loads) const {
    const fluid::FluidWay way(s, step, i);
    const bool is_clear = fluid::is_clear(s, i, way.x, way.y);
    if (is_clear) {
      fluid::arrive(s, step, i, way, loads);
      pack(s, i);
    } else {
      list_met(s, &s.most->moved, i);
    }
    measure_most(s, is_clear ? i : -1);
  }
};

struct MoveAlongWalls {
  FluidOnGpu s;
  FluidSubstep step;
  int threads;
  __device__ void operator()(int thread, const Loads& loads) const {
    each_met(s, s.most->moved, thread, threads, [&](int i, const Warp& warp) {
      give_touch(s, i, fluid::move(s, step, i, warp, loads), warp);
      if (warp.lane == 0) pack(s, i);
      measure_most(s, warp.lane == 0 ? i : -1);
    });
  }
};

struct Yield {
  FluidOnGpu s;
  __device__ void operator()(int i) const {
    const float x[3] = {s.x[0][i], s.x[1][i], s.x[2][i]};
    if (fluid::is_clear(s, i, x, x)) {
      pack(s, i);
    } else {
      list_met(s, &s.most->yielded, i);
    }
  }
};

struct YieldToWalls {
  FluidOnGpu s;
  float time;
  int threads;
  __device__ void operator()(int thread) const {
    each_met(s, s.most->yielded, thread, threads, [&](int i, const Warp& warp) {
      give_touch(s, i, fluid::yield_to_walls(s, time, i, warp), warp);
      if (warp.lane == 0) pack(s, i);
    });
  }
};

/// What each corner of a triangle gets of pressure within a substep; in the last, of touches.
struct Collect {
  FluidOnGpu s;
  float time;
  bool is_last;
  __device__ void operator()(int thread) const {
    const int t = thread / kTeam;
    const Team team;
    const std::int32_t begin = s.pair_begin[t], end = s.pair_begin[t + 1];
    if (begin == end) return;
    float pressed = 0;
    for (std::int32_t e = begin + team.lane; e < end; e += kTeam) {
      pressed += s.strength[s.pair_particle[e]] * s.share[s.pair_entry[e]];
    }
    pressed = team.sum(pressed);
    if (const int a = team.lane; a < 3) {
      const std::size_t k = 3 * static_cast<std::size_t>(t) + a;
      const double touched = is_last ? from_fixed(s.touched[k], kImpulseUnit) : 0;
      s.impulse[k] += (static_cast<float>(touched) - time * pressed * s.now[t].normal[a]) / 3;
    }
  }
};

struct Leave {
  FluidOnGpu s;
  __device__ void operator()(int i) const { fluid::leave_wall(s, i); }
};

}  // namespace

void launch_fluid_bounds(const FluidView& view, float* box, cudaStream_t stream) {
  fluid_bounds<<<1, 1024, 0, stream>>>(view, box);
  check_cuda(cudaGetLastError(), "start a kernel");
}

void launch_fluid_cells(const FluidView& view, const FluidGrid& grid, std::uint32_t* cell,
                        std::int32_t* number, cudaStream_t stream) {
  Gpu(stream).for_each(view.size, FindCells{view, grid, cell, number});
}

void launch_fluid_sort(const std::uint32_t* key, std::uint32_t* sorted_key,
                       const std::int32_t* value, std::int32_t* sorted_value, int count, int bits,
                       void* memory, std::size_t& bytes, cudaStream_t stream) {
  check_cuda(cub::DeviceRadixSort::SortPairs(memory, bytes, key, sorted_key, value, sorted_value,
                                             count, 0, bits, stream),
             "sort");
}

void launch_fluid_scan(const std::int32_t* of, std::int32_t* before, int count, void* memory,
                       std::size_t& bytes, cudaStream_t stream) {
  check_cuda(cub::DeviceScan::ExclusiveSum(memory, bytes, of, before, count, stream), "sum up");
}

void launch_fluid_grid(const FluidView& view, const FluidGrid& grid,
                       const std::uint32_t* sorted_cell, cudaStream_t stream) {
  Gpu(stream).for_each(view.size + 1, BeginCells{view, grid, sorted_cell});
}

void launch_fluid_neighbours(const FluidView& view, const FluidGrid& grid, float reach,
                             std::int32_t* counts, const std::int32_t* begin, std::int32_t* other,
                             cudaStream_t stream) {
  Gpu(stream).for_each(kTeam * view.size, FindNeighbours{view, grid, reach, counts, begin, other});
}

void launch_fluid_triangles(const float* corners, int triangles, const std::int32_t* pair_begin,
                            WallTriangle* to, cudaStream_t stream) {
  Gpu(stream).for_each(triangles, PlaceTriangles{corners, pair_begin, to});
}

void launch_fluid_pairs(const FluidView& view, const FluidGrid& grid, const FluidWallReach& reach,
                        int triangles, std::int32_t* counts, const std::int32_t* begin,
                        std::uint32_t* key, std::int32_t* number, std::int32_t* triangle,
                        std::int32_t* particle, cudaStream_t stream) {
  Gpu(stream).for_each(
      32 * triangles, FindPairs{view, grid, reach, counts, begin, key, number, triangle, particle});
}

void launch_fluid_entries(int particles, int pairs, const std::uint32_t* sorted_key,
                          const std::int32_t* sorted_pair, const std::int32_t* triangle,
                          std::int32_t* wall_begin, std::int32_t* wall_soon,
                          std::int32_t* wall_near, std::int32_t* wall, std::int32_t* wall_of,
                          std::int32_t* pair_entry, cudaStream_t stream) {
  const int n = pairs > particles + 1 ? pairs : particles + 1;
  Gpu(stream).for_each(n, PutEntries{particles, pairs, sorted_key, sorted_pair, triangle,
                                     wall_begin, wall_soon, wall_near, wall, wall_of, pair_entry});
}

void launch_fluid_walls_moved(const float* corners, const float* listed, int triangles,
                              const std::uint8_t* is_bit, unsigned* most, cudaStream_t stream) {
  Gpu(stream).for_each(3 * triangles, FindWallsMoved{corners, listed, is_bit, most});
}

void launch_fluid_yield(const FluidOnGpu& fluid, float time, cudaStream_t stream) {
  const Gpu gpu(stream);
  gpu.for_each(fluid.size, Yield{fluid});
  gpu.for_each(kMetThreads, YieldToWalls{fluid, time, kMetThreads});
}

void launch_fluid_substep(const FluidOnGpu& fluid, const FluidSubstep& step, bool is_last,
                          unsigned long long* loads, cudaStream_t stream) {
  const Gpu gpu(stream);
  gpu.for_each(fluid.entries, See{fluid});
  gpu.for_each(kTeam * fluid.size, Press{fluid, step});
  launch_with_loads(kTeam * fluid.size, Push{fluid, step}, loads, stream);
  launch_with_loads(fluid.size, Move{fluid, step}, loads, stream);
  launch_with_loads(kMetThreads, MoveAlongWalls{fluid, step, kMetThreads}, loads, stream);
  gpu.for_each(kTeam * fluid.triangles, Collect{fluid, step.dt, is_last});
}

void launch_fluid_leave(const FluidOnGpu& fluid, cudaStream_t stream) {
  Gpu(stream).for_each(fluid.size, Leave{fluid});
}

}  // namespace tissue_sim
