// A bundle's nodes, plane by plane: moved on while its cells are worked on. For .cu files.
#pragma once

#include <cuda_pipeline_primitives.h>

#include "mpm/cuda/block_nodes.h"

namespace tissue_sim {

/// Planes whose nodes are in place, whose entries of the tables and whose raw nodes there is room
/// for.
inline constexpr int kPlanesInPlace = 4, kEntryPlanes = 4, kRawPlanes = 2;
inline constexpr int kPlaneParts = 4;             ///< of a node's force, in a raw plane
inline constexpr int kRawNode = 2 + kPlaneParts;  ///< float4s: u, v and these parts

/// Shared memory for each slot of a plane, in float4s: places of nodes, raw nodes, entries.
inline constexpr int kMovingPlaneRoom =
    kPlanesInPlace + kRawPlanes * kRawNode + kEntryPlanes + kEntryPlanes / 2;

/// What a march knows of its block when it is compiled: nothing; or that it is one of 16 x 16
/// columns of whole points for 256 threads, the shape that large tissue is given: then less has to
/// be worked out of where a slot lies, and points have no volumes of their own. `room`: slots of a
/// plane for which there is shared memory.
struct AnyBlock {
  static constexpr bool kKnown = false;
  int nx, ny, threads, room;
};
struct KnownBlock {
  static constexpr bool kKnown = true;
  static constexpr int nx = 16, ny = 16, threads = 256, room = (nx + 2) * (ny + 2);
  __device__ __forceinline__ static bool is(const CudaBlock& b, int room_of_plane) {
    return b.nx == nx && b.ny == ny && b.whole != 0 && room_of_plane == room &&
           static_cast<int>(blockDim.x) == threads;
  }
};

/// The nodes that a bundle's cells need next, in shared memory. What the tables say of a plane's
/// slots is on its way two planes ahead, nodes and the parts of their force one plane ahead, so
/// that nobody waits for them but at the lowest planes. Each thread sends for, moves and puts in
/// place the same slots of a plane.
template <class Known>
class MovingPlanes {
 public:
  /// `room` has kMovingPlaneRoom for each of `known.room` slots; nodes are put in place times
  /// `scale`.
  __device__ __forceinline__ MovingPlanes(const CudaTables& t, const CudaFrame& f,
                                          const CudaBlock& block, float scale, float4* room,
                                          const Known& known)
      : t_(t), f_(f), block_(block), known_(known), scale_(scale), u_(room) {
    raw_ = u_ + kPlanesInPlace * known_.room;
    parts_ = reinterpret_cast<uint4*>(raw_ + kRawPlanes * kRawNode * known_.room);
    node_ = reinterpret_cast<std::int32_t*>(parts_ + kEntryPlanes * known_.room);
    shared_ = reinterpret_cast<std::uint32_t*>(node_ + kEntryPlanes * known_.room);
  }

  /// Sends for the entries of the lowest planes: before begin(), as early as may be.
  __device__ __forceinline__ void expect() {
    int turn = 0;
    for (int z = 0; z < kEntryPlanes; ++z, turn = turned(turn)) fetch_entries(z, turn);
    __pipeline_commit();
  }
  /// Puts the lowest four planes in place, and sends for the next. In round 0 nothing moves.
  __device__ __forceinline__ void begin(int round) {
    moves_ = round > 0;
    odd_ = ((f_.current + max(round - 1, 0)) & 1) != 0;
    round_ = round;
    const int turn1 = turned(0), turn2 = turned(turn1), turn3 = turned(turn2);
    turn_ = turned(turn3);
    __pipeline_wait_prior(0);
    fetch(0, 0);
    fetch(1, turn1);
    __pipeline_commit();
    __pipeline_wait_prior(0);
    move(0, 0);
    move(1, turn1);
    __syncthreads();  // the next take the places of these
    fetch(2, turn2);
    fetch(3, turn3);
    fetch_entries(4, turn_);
    fetch_entries(5, turned(turn_));
    __pipeline_commit();
    __pipeline_wait_prior(0);
    move(2, turn2);
    move(3, turn3);
    __syncthreads();
    fetch(4, turn_);
    __pipeline_commit();
  }
  /// Puts plane z in place of the last but three, and sends for those after it.
  __device__ __forceinline__ void next(int z) {
    __pipeline_wait_prior(0);
    move(z, turn_);
    turn_ = turned(turn_);
    fetch(z + 1, turn_);
    fetch_entries(z + 2, turned(turn_));
    __pipeline_commit();
  }
  /// The column's nodes in plane z.
  __device__ __forceinline__ const float4* of(const CudaColumn& c, int z) const {
    return u_ + (z & (kPlanesInPlace - 1)) * known_.room + c.plane_slot;
  }

 private:
  __device__ __forceinline__ int planes() const { return block_.nz + 2; }
  __device__ __forceinline__ int plane_slots() const { return (known_.nx + 2) * (known_.ny + 2); }
  /// Planes begin with another thread each, for all warps to have as much to do.
  __device__ __forceinline__ int turned(int turn) const {
    turn += 96 % known_.threads;
    return turn < known_.threads ? turn : turn - known_.threads;
  }
  __device__ __forceinline__ int first_of(int turn) const {
    const int i = static_cast<int>(threadIdx.x) + turn;
    return i < known_.threads ? i : i - known_.threads;
  }

  __device__ __forceinline__ void fetch_entries(int z, int turn) {
    if (z >= planes()) return;
    const int count = plane_slots(), first = block_.first_slot + z * count;
    const int to = (z & (kEntryPlanes - 1)) * known_.room;
#pragma unroll 1
    for (int i = first_of(turn); i < count; i += known_.threads) {
      __pipeline_memcpy_async(node_ + to + i, t_.slot_node + first + i, 4);
      __pipeline_memcpy_async(shared_ + to + i, t_.slot_parts + first + i, 4);
      __pipeline_memcpy_async(parts_ + to + i, t_.first_parts + first + i, 16);
    }
  }

  __device__ __forceinline__ void fetch(int z, int turn) {
    if (z >= planes()) return;
    const int count = plane_slots(), entry = (z & (kEntryPlanes - 1)) * known_.room;
    const CudaNodes& from = odd_ ? f_.state[1] : f_.state[0];
    const float4* force = forces();
    float4* to = raw_ + (z & (kRawPlanes - 1)) * kRawNode * known_.room;
#pragma unroll 1
    for (int i = first_of(turn); i < count; i += known_.threads) {
      const std::int32_t of_slot = node_[entry + i], node = of_slot < 0 ? ~of_slot : of_slot;
      __pipeline_memcpy_async(to + i, from.u + node, 16);
      if (!moves_) continue;
      __pipeline_memcpy_async(to + known_.room + i, from.v + node, 16);
      const std::uint32_t part_count = shared_[entry + i] & 63u;
      const uint4 part = parts_[entry + i];
      __pipeline_memcpy_async(to + 2 * known_.room + i, force + part.x, 16);
      if (part_count > 1) __pipeline_memcpy_async(to + 3 * known_.room + i, force + part.y, 16);
      if (part_count > 2) __pipeline_memcpy_async(to + 4 * known_.room + i, force + part.z, 16);
      if (part_count > 3) __pipeline_memcpy_async(to + 5 * known_.room + i, force + part.w, 16);
    }
  }

  __device__ __forceinline__ void move(int z, int turn) {
    if (z >= planes()) return;
    const int count = plane_slots(), entry = (z & (kEntryPlanes - 1)) * known_.room;
    const CudaNodes& to = odd_ ? f_.state[0] : f_.state[1];
    const float4* raw = raw_ + (z & (kRawPlanes - 1)) * kRawNode * known_.room;
    float4* out = u_ + (z & (kPlanesInPlace - 1)) * known_.room;
#pragma unroll 1
    for (int i = first_of(turn); i < count; i += known_.threads) {
      float4 u = raw[i];
      if (moves_) {
        const std::int32_t node = node_[entry + i];
        const std::uint32_t shared = shared_[entry + i];
        const int part_count = static_cast<int>(shared & 63u);
        float4 v = raw[known_.room + i], f = raw[2 * known_.room + i];
#pragma unroll
        for (int p = 1; p < kPlaneParts; ++p) {
          if (p < part_count) add(raw[(2 + p) * known_.room + i], f);
        }
        if (part_count > kPlaneParts) add_more_parts(shared, f);
        f_.step.move(0, f.x, u.w, v.w, u.x, v.x);
        f_.step.move(1, f.y, u.w, v.w, u.y, v.y);
        f_.step.move(2, f.z, u.w, v.w, u.z, v.z);
        if (node >= 0) {
          __stcg(to.u + node, u);
          __stcg(to.v + node, v);
        }
      }
      out[i] = {scale_ * u.x, scale_ * u.y, scale_ * u.z, 0};
    }
  }
  /// The parts from kPlaneParts on, which only nodes at edges of blocks have.
  __device__ __forceinline__ void add_more_parts(std::uint32_t shared, float4& f) const {
    const int part_count = static_cast<int>(shared & 63u);
    const uint4 part = more_parts(t_, shared);
    const float4* force = forces();
    float4 more[4] = {};
    more[0] = __ldcg(force + part.x);
    if (part_count > 5) more[1] = __ldcg(force + part.y);
    if (part_count > 6) more[2] = __ldcg(force + part.z);
    if (part_count > 7) more[3] = __ldcg(force + part.w);
    for (const float4& p : more) add(p, f);
#pragma unroll 1
    for (int p = 8; p < part_count; ++p) {
      add(__ldcg(force + __ldg(t_.parts + (shared >> 6) + p)), f);
    }
  }
  /// Those of the substep before.
  __device__ __forceinline__ const float4* forces() const {
    return (round_ & 1) != 0 ? f_.force[0] : f_.force[1];
  }

  const CudaTables& t_;
  const CudaFrame& f_;
  const CudaBlock& block_;
  Known known_;
  float scale_;
  int turn_ = 0, round_ = 0;
  bool moves_ = false, odd_ = false;
  float4 *u_, *raw_;  ///< [kPlanesInPlace][room], [kRawPlanes][kRawNode][room]
  uint4* parts_;      ///< [kEntryPlanes][room], as are these two
  std::int32_t* node_;
  std::uint32_t* shared_;
};

}  // namespace tissue_sim
