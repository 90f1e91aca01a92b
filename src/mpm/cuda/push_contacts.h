// Contacts of tissue with tissue within a substep, and the looks at them, a few lanes for each. For
// .cu files.
//
// A look takes two substeps, so that thread blocks need not wait for one another within one: in the
// first, facets are brought to where they will be in the next; in the next, each contact is looked
// at before it pushes. How fast the fastest pair is, and with it when the next look is due, is
// known in the substep after.
#pragma once

#include "mpm/cuda/added_mass.h"
#include "mpm/cuda/contact_lanes.h"
#include "mpm/cuda/grid_barrier.h"

namespace tissue_sim {

/// What a substep does with contacts.
struct ContactRound {
  float dt;           ///< [s]
  float since;        ///< the last look was so long ago [s]
  bool look;          ///< they are looked at
  bool fresh;         ///< for the first time since the search: their nodes are not known yet
  bool soften;        ///< springs were made soft for a shorter substep
  bool move;          ///< facets are brought to where the next substep will look at them
  unsigned* fastest;  ///< pair of this look [m/s]
};

/// Adds the force of a contact to its nodes, of which each lane has some.
template <class Places>
__device__ __forceinline__ void add_pushes(const FaceSpring& c, const Places& places,
                                           long long* force) {
#pragma unroll
  for (int j = 0; j < Places::Group::kNodes; ++j) {
    if (places.lanes.node(j) >= 27) break;
    add_push(force, places.own_place.node[j], places.own_place.weight[j], c.force);
    add_push(force, places.other_place.node[j], -places.other_place.weight[j], c.force);
  }
}

/// The same, for a warp whose groups go in step, if the contact is `on`. Four lanes have a node,
/// three of them a component each: an instruction goes to a quarter of the places in memory, which
/// is what counts where all warps add at once.
template <int kLanes>
__device__ __forceinline__ void add_pushes_together(const FaceSpring& c, bool on,
                                                    const LanePlaces<kLanes, false>& places,
                                                    long long* force) {
  const auto& lanes = places.lanes;
  const int component = lanes.lane % 4;
  const float push = component == 0 ? c.force[0] : component == 1 ? c.force[1] : c.force[2];
#pragma unroll
  for (int first = 0; first < 27; first += kLanes / 4) {
    const int k = first + lanes.lane / 4, j = first / kLanes;
    const auto of_node = [&](auto value) {
      return __shfl_sync(lanes.mask, value, k % kLanes, kLanes);
    };
    const auto add = [&](const auto& place, float sign) {
      const std::int32_t node = of_node(place.node[j]);
      const float weight = of_node(place.weight[j]);
      if (on && component < 3 && k < 27) add_push(force, node, component, sign * weight * push);
    };
    add(places.own_place, 1.0f);
    add(places.other_place, -1.0f);
  }
}

/// Works out contacts, once `nodes_are_there()`, and adds their forces to `force`, of the nodes.
/// The groups of a warp go in step. `kMany`: all warps may have contacts.
template <bool kMany, int kLanes, class Wait>
__device__ __forceinline__ void push_contacts(const CudaFaces& f, const WarpTurns& turns,
                                              const CudaNodes& state, const ContactRound& round,
                                              const Wait& nodes_are_there, long long* force) {
  // Copies: through a reference they would be read again after every store.
  const std::int32_t* facets = f.looks.contacts;
  const CudaContactNodes* nodes = f.looks.nodes;
  FaceSpring* springs = f.looks.springs;
  const int count = f.contacts;
  bool waited = false;
  for (int first = turns.first(), next; first < count; first = turns.known(next)) {
    const int i = first + static_cast<int>(threadIdx.x) % 32 / kLanes;
    const int at = min(i, count - 1);
    FaceSpring& spring = springs[facets[at]];
    LanePlaces<kLanes, false> places(state, f.looks);
    places.take(nodes[at]);
    FaceSpring c = spring;
    if (!waited) nodes_are_there();
    waited = true;
    places.bring();  // on their way before it is known whether they are wanted
    const bool is_one = i < count && c.other >= 0, active = is_one && is_active(c);
    if (!__any_sync(0xffffffffu, active || (round.soften && is_one))) {
      next = turns.after(first);
      continue;
    }
    places.hold(c.hold);
    if (round.soften) {
      const float mobility = places.held_mobility();
      if (is_one) c.soften(mobility, round.dt);
    }
    if (__any_sync(0xffffffffu, active)) push_face(c, round.dt, places, active);
    next = turns.after(first);  // no sooner: others may be free before
    if (places.lanes.lane == 0) {
      if (active) {
        spring = c;
      } else if (round.soften && is_one) {  // what else it came along for depends on its warp
        spring.stiffness = c.stiffness;
        spring.damping = c.damping;
      }
    }
    const bool pushes = active && c.touching;
    if constexpr (kMany) {
      if (places.any(pushes)) add_pushes_together(c, pushes, places, force);
    } else if (pushes) {
      add_pushes(c, places, force);
    }
  }
}

/// The same, and looks at all of them before; each group by itself.
__device__ __forceinline__ void look_at_contacts(const CudaFaces& f, const WarpTurns& turns,
                                                 const CudaNodes& state, const ContactRound& round,
                                                 long long* force) {
  const CudaLooks s = f.looks;
  const int count = f.contacts;
  float fastest = 0;
  for (int first = turns.first(); first < count; first = turns.known(turns.after(first))) {
    const int i = first + static_cast<int>(threadIdx.x) % 32 / kContactLanes;
    if (i >= count) continue;
    FaceSpring c = s.springs[s.contacts[i]];
    LaneFaces faces(s, state);
    faces.index = c.facet;
    if (round.fresh) {
      faces.take(c);
    } else {
      faces.LanePlaces::take(s.nodes[i]);
      faces.hold(c.hold);
    }
    faces.bring();
    fastest = fmaxf(fastest, look(faces, c, round.dt, round.since));
    CudaContactNodes& nodes = s.nodes[i];
    if (round.fresh) {
      faces.own_place.store_nodes(faces.lanes, nodes.own);
      faces.own_place.store_weights(faces.lanes, nodes.weight);
    }
    faces.other_place.store_nodes(faces.lanes, nodes.other);
    if (round.soften && c.other >= 0) c.soften(faces.held_mobility(), round.dt);
    const bool active = is_active(c);
    if (active) push_face(c, round.dt, faces);
    __syncwarp(faces.lanes.mask);
    if (faces.lanes.lane == 0) s.springs[c.facet] = c;
    if (active && c.touching) add_pushes(c, faces, force);
  }
  __syncwarp();
#pragma unroll
  for (int step = kContactLanes; step < 32; step *= 2) {
    fastest = fmaxf(fastest, __shfl_xor_sync(0xffffffffu, fastest, step));
  }
  if (threadIdx.x % 32 == 0 && fastest > 0) atomicMax(round.fastest, __float_as_uint(fastest));
}

/// Brings facets, a thread for each, to where the next substep will look at them.
__device__ __forceinline__ void move_facets(const CudaFaces& f, const WarpTurns& turns,
                                            const CudaNodes& state, float dt) {
  const int count = f.involved;
  for (int first = turns.first(); first < count; first = turns.known(turns.after(first))) {
    const int i = first + static_cast<int>(threadIdx.x) % 32;
    if (i >= count) continue;
    const int facet = f.looks.involved[i];
    FacetMotion motion = motion_of(f.looks, state, f.looks.facets[facet]);
    for (int a = 0; a < 3; ++a) motion.x[a] += dt * motion.v[a];
    f.looks.motion[facet] = motion;
  }
}

/// When a thread block looks at contacts; in shared memory, and changed by one thread while the
/// others wait for it at the barrier of the grid.
struct alignas(16) FaceRounds {
  int next;     ///< round of the next look
  int last;     ///< of the last
  float since;  ///< seconds from the last look to round `last`: not 0 if it was before this launch
  int slot;     ///< of CudaFaceFigures::fastest_pair that the next look takes
  int rank;     ///< CudaBundle::rank; thread blocks without a bundle come after those that have one
  int ranks;    ///< that there are
  CudaFaces faces;  ///< of the launch

  __device__ __forceinline__ void begin(const CudaTables& t, const CudaFaces& f, float dt) {
    faces = f;
    const int mine = static_cast<int>(blockIdx.x), beside = mine - t.bundle_count;
    rank = beside >= 0 ? f.ranks + beside : t.bundles[mine].rank;
    ranks = f.ranks + max(static_cast<int>(gridDim.x) - t.bundle_count, 0);
    const CudaFaceFigures& figures = *f.looks.figures;
    // Where a look is due at once, facets were moved for it by the last substep.
    next = f.look_first != 0 || figures.until_look <= 0 ? 0 : rounds_in(figures.until_look, dt);
    last = 0;
    since = figures.since_look;
    slot = figures.next_pair;
  }
  /// At the beginning of a round: what the last one's look tells.
  __device__ __forceinline__ void learn(int round, float dt) {
    if (next != round - 1) return;
    CudaFaceFigures& figures = *faces.looks.figures;
    const float fastest = __uint_as_float(__ldcg(figures.fastest_pair + slot));
    last = next;
    since = 0;
    next = last + max(2, rounds_in(look_horizon(fastest, faces.looks.cell_size, dt), dt));
    slot ^= 1;
    if (blockIdx.x == 0) figures.fastest_pair[slot] = 0;
  }
  /// Where each warp has its own turns they are left to the thread blocks that have the least to
  /// do; whether this is one.
  __device__ __forceinline__ bool has_turns() const { return ranks == 0 || rank >= 0; }
  __device__ __forceinline__ WarpTurns turns(const Pushers& team, int each) const {
    return ranks == 0 ? WarpTurns::own(each, static_cast<int>(blockIdx.x),
                                       static_cast<int>(gridDim.x), team)
                      : WarpTurns::own(each, rank, ranks, team);
  }
  __device__ __forceinline__ ContactRound at(int round, float dt) const {
    ContactRound r;
    r.dt = dt;
    r.since = since_look(round, dt);
    r.look = round == next;
    r.fresh = round == 0 && faces.look_first != 0;
    r.soften = round == 0 && dt > faces.looks.figures->dt;
    r.move = round + 1 == next;
    r.fastest = faces.looks.figures->fastest_pair + slot;
    return r;
  }
  __device__ __forceinline__ void end(int round, float dt) const {
    CudaFaceFigures& figures = *faces.looks.figures;
    figures.until_look = (next - round) * static_cast<double>(dt);
    figures.since_look = since_look(round, dt);
    figures.next_pair = slot;
    figures.dt = dt;
  }

 private:
  __device__ __forceinline__ float since_look(int round, float dt) const {
    return since + static_cast<float>(round - last) * dt;
  }
  static __device__ __forceinline__ int rounds_in(double time, float dt) {
    return max(1, static_cast<int>(ceil(time / dt)));
  }
};

/// Contact of tissue with tissue in a round; adds the forces to `force`. With kMany, where all
/// warps come when their forces are done, they take contacts as they come. Out of line, for the
/// blocks to keep their registers.
template <bool kMany>
__device__ __noinline__ void touch_faces(const FaceRounds* rounds, int round, float dt,
                                         const CudaNodes state, const Pushers team,
                                         unsigned* arrived, long long* force) {
  const CudaFaces& f = rounds->faces;
  if (!kMany && !rounds->has_turns()) return;
  unsigned* counters = turn_counters(arrived, round);
  const auto turns = [&](int of, int each) {
    return kMany ? WarpTurns::next_of(counters + of, each) : rounds->turns(team, each);
  };
  // Much of a push all lanes do alike: where there are many contacts, fewer lanes do more a warp.
  constexpr int kPushLanes = kMany ? kContactLanes / 2 : kContactLanes;
  const ContactRound now = rounds->at(round, dt);
  const auto nodes_are_there = [&] { warp_wait(arrived + 1, round + 1); };
  if (now.look || now.move) nodes_are_there();
  // What takes a warp longest comes first, for the shortest to fill what is left until the barrier.
  if (now.move) move_facets(f, turns(1, 32), state, dt);
  const WarpTurns of_contacts = turns(0, 32 / (now.look ? kContactLanes : kPushLanes));
  if (now.look) {
    look_at_contacts(f, of_contacts, state, now, force);
  } else {
    push_contacts<kMany, kPushLanes>(f, of_contacts, state, now, nodes_are_there, force);
  }
}

}  // namespace tissue_sim
