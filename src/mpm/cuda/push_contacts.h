// Contacts of tissue with tissue within a substep and the looks at them, a warp for each. For .cu
// files.
#pragma once

#include "mpm/cuda/add_push.h"
#include "mpm/cuda/grid_barrier.h"
#include "mpm/cuda/warp_faces.h"

namespace tissue_sim {

/// What pushes need of CudaLooks.
struct CudaPushes {
  const std::int32_t* active;
  const CudaContactNodes* nodes;
  FaceSpring* springs;
  const int* count;
};

/// The first contact of a warp, and how many it goes on by: warps of different thread blocks first,
/// so that all multiprocessors have their share.
__device__ __forceinline__ int first_of_warp() {
  return static_cast<int>(threadIdx.x / 32 * gridDim.x + blockIdx.x);
}
__device__ __forceinline__ int warps_of_grid() {
  return static_cast<int>(gridDim.x * blockDim.x) / 32;
}

/// Works out all active contacts and adds their forces to `force`, of the nodes; out of line, for
/// the blocks to keep their registers.
inline __device__ __noinline__ void push_contacts(const CudaPushes c, const CudaNodes state,
                                                  float dt, long long* force) {
  const int lane = static_cast<int>(threadIdx.x) % 32, k = min(lane, 26);
  const int count = __ldcg(c.count);
  for (int i = first_of_warp(); i < count; i += warps_of_grid()) {
    const CudaContactNodes& nodes = c.nodes[i];
    FaceSpring& at = c.springs[c.active[i]];
    WarpPlaces places;
    places.k = lane;
    places.v = state.v;
    places.own_node = nodes.own[k];
    places.other_node = nodes.other[k];
    places.own_weight = lane < 27 ? nodes.weight[k] : 0.0f;
    places.own_u = __ldcg(state.u + places.own_node);
    places.other_u = __ldcg(state.u + places.other_node);
    FaceSpring spring = at;
    places.hold(spring.hold);
    push_face(spring, dt, places);
    __syncwarp();
    if (lane == 0) at = spring;
    if (!spring.touching || lane >= 27) continue;
    add_push(force + 3 * static_cast<std::size_t>(places.own_node), places.own_weight,
             spring.force);
    add_push(force + 3 * static_cast<std::size_t>(places.other_node), -places.weight, spring.force);
  }
}

/// Looks at all contacts, whose last look was `since` seconds ago. Springs made soft for a shorter
/// substep are made softer. Thread blocks meet twice at `arrived`, where they have met `met` times.
inline __device__ __noinline__ void look_at_contacts(const CudaLooks s, const CudaNodes state,
                                                     float dt, float since, unsigned* arrived,
                                                     unsigned met) {
  CudaFaceFigures& figures = *s.figures;
  const int involved = figures.involved, contacts = figures.contacts;
  const bool longer = dt > figures.dt;
  if (blockIdx.x == 0 && threadIdx.x == 0) {
    figures.active = 0;
    figures.fastest_pair = 0;
  }
  const auto threads = static_cast<int>(gridDim.x * blockDim.x);
  for (int i = static_cast<int>(threadIdx.x * gridDim.x + blockIdx.x); i < involved; i += threads) {
    move_facet(s, state, s.involved[i]);
  }
  grid_barrier(arrived, met + 1);
  float fastest = 0;
  const int lane = static_cast<int>(threadIdx.x) % 32;
  for (int i = first_of_warp(); i < contacts; i += warps_of_grid()) {
    FaceSpring& at = s.springs[s.contacts[i]];
    FaceSpring spring = at;
    WarpFaces faces(s, state, spring);
    fastest = fmaxf(fastest, look(faces, spring, dt, since));
    if (longer && spring.other >= 0) spring.soften(faces.held_mobility(), dt);
    __syncwarp();
    if (lane == 0) at = spring;
    if (!is_active(spring)) continue;
    int place = 0;
    if (lane == 0) {
      place = atomicAdd(&figures.active, 1);
      s.active[place] = spring.facet;
    }
    place = __shfl_sync(0xffffffffu, place, 0);
    if (lane >= 27) continue;
    CudaContactNodes& nodes = s.nodes[place];
    nodes.own[lane] = faces.own_node;
    nodes.other[lane] = faces.other_node;
    nodes.weight[lane] = faces.own_weight;
  }
  if (lane == 0 && fastest > 0) atomicMax(&figures.fastest_pair, __float_as_uint(fastest));
  grid_barrier(arrived, met + 2);
}

/// When a thread block looks at contacts; in shared memory.
struct FaceRounds {
  int next;  ///< round of the next look
  int last;  ///< of the last
  float
      since;  ///< seconds from the last look to round `last`: not 0 if that was before this launch
  int unused;

  __device__ __forceinline__ void begin(const CudaFaces& f, float dt) {
    const CudaFaceFigures& figures = *f.looks.figures;
    const bool now = f.look_first || figures.until_look <= 0 || dt > figures.dt;
    next = now ? 0 : rounds_in(figures.until_look, dt);
    last = 0;
    since = figures.since_look;
  }
  __device__ __forceinline__ float since_look(int round, float dt) const {
    return since + static_cast<float>(round - last) * dt;
  }
  __device__ __forceinline__ void looked(const CudaFaces& f, int round, float dt) {
    const float fastest = __uint_as_float(__ldcg(&f.looks.figures->fastest_pair));
    next = round + rounds_in(look_horizon(fastest, f.looks.cell_size, dt), dt);
    last = round;
    since = 0;
  }
  __device__ __forceinline__ void end(const CudaFaces& f, int round, float dt) const {
    f.looks.figures->until_look = (next - round) * static_cast<double>(dt);
    f.looks.figures->since_look = since_look(round, dt);
    f.looks.figures->dt = dt;
  }

 private:
  static __device__ __forceinline__ int rounds_in(double time, float dt) {
    return max(1, static_cast<int>(ceil(time / dt)));
  }
};

}  // namespace tissue_sim
