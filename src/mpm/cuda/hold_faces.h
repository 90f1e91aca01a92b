// Holds anchors' faces in the substeps' kernels. For .cu files.
#pragma once

#include "mpm/cuda/hold_rows.h"

namespace tissue_sim {

/// Loads a struct of the tables that nobody changes.
template <class T>
__device__ __forceinline__ T load_entry(const T* from) {
  static_assert(sizeof(T) % sizeof(int4) == 0 && alignof(T) == 16, "by 16 bytes");
  T to;
#pragma unroll
  for (int k = 0; k < static_cast<int>(sizeof(T) / sizeof(int4)); ++k) {
    reinterpret_cast<int4*>(&to)[k] = __ldg(reinterpret_cast<const int4*>(from) + k);
  }
  return to;
}

__device__ __forceinline__ double moved(const CudaAnchorPlace& p, const float (&X)[3], int c) {
  const double* R = p.rotation + 3 * c;
  return R[0] * X[0] + R[1] * X[1] + R[2] * X[2] + p.translation[c] - X[c];
}

/// How far a face's velocity is from what it should be, at the row `r`: as in hold_group().
__device__ __forceinline__ float left_of(const CudaHeldFaces& h, const FacesAtWork& w,
                                         const CudaFaceRow& r, const float* nodes, int c) {
  const float inv_dt = 1 / w.step.dt;
  float lacks = 0;
  if (h.pull != nullptr) {
    const float* const m = reinterpret_cast<const float*>(
        h.pull + 4 * (static_cast<std::size_t>(w.substep) * h.anchors + r.anchor));
    lacks =
        inv_dt * (r.place[0] * m[c] + r.place[1] * m[4 + c] + r.place[2] * m[8 + c] + m[12 + c]);
  }
  float v = 0, u = 0;
#pragma unroll
  for (int k = 0; k < kFaceRowNodes; ++k) {
    const float* node = nodes + kFaceEntryRoom * r.entry[k];
    u += r.weight[k] * node[c];
    v += r.weight[k] * node[4 + c];
  }
  return lacks - ((1 - h.drift) * v + h.drift * inv_dt * u);
}

/// Holds the groups of a chunk. The first row of each thread is on its way from the beginning.
template <bool kPushes>
__device__ __forceinline__ void hold_chunk(const CudaHeldFaces& h, const FacesAtWork& w, int bundle,
                                           float4* exchange, const CudaFaceChunk& chunk) {
  const int thread = static_cast<int>(threadIdx.x), threads = static_cast<int>(blockDim.x);
  const int numbers = 3 * chunk.rows;
  const CudaFaceEntry* const entries = h.entries + chunk.first_entry;
  const CudaFaceRow* const rows = h.rows + chunk.first_row;
  float4* const nodes =
      chunk.is_large != 0 ? reinterpret_cast<float4*>(h.room + h.room_each * bundle) : exchange;
  float* const left = reinterpret_cast<float*>(nodes + 2 * chunk.entries);
  float* const impulse = left + numbers;
  const CudaFaceRow first = load_entry(rows + min(thread, numbers - 1) / 3);
  const auto row = [&](int k) { return k == thread ? first : load_entry(rows + k / 3); };
  constexpr int kHand = 2;
  for (int e = thread; e < chunk.entries; e += kHand * threads) {
    CudaFaceEntry n[kHand];
    FreeNode<kPushes> free[kHand];
#pragma unroll
    for (int k = 0; k < kHand; ++k) {
      n[k] = load_entry(entries + min(e + k * threads, chunk.entries - 1));
    }
#pragma unroll
    for (int k = 0; k < kHand; ++k) free[k].send_for(w, n[k]);
#pragma unroll
    for (int k = 0; k < kHand; ++k) {
      if (e + k * threads >= chunk.entries) break;
      free[k].move(w, n[k]);
      for (int r = 0; r < n[k].swings; ++r) {
        calm_swing(h.swing_loss, w.step.dt, free[k].u, free[k].v);
      }
      nodes[2 * (e + k * threads)] = free[k].u;
      nodes[2 * (e + k * threads) + 1] = free[k].v;
    }
  }
  __syncthreads();
  for (int k = thread; k < numbers; k += threads) {
    left[k] = left_of(h, w, row(k), reinterpret_cast<const float*>(nodes), k % 3);
  }
  __syncthreads();
  for (int k = thread; k < numbers; k += threads) {
    const CudaFaceRow r = row(k);
    const float* const of_group = left + 3 * r.group + k % 3;
    float sum = 0;
#pragma unroll 8
    for (int j = 0; j < r.rows; ++j) sum += __ldg(h.inverse + r.inverse + j) * of_group[3 * j];
    impulse[k] = sum;
    if (r.impulse < 0 || h.impulse == nullptr) continue;
    atomicAdd(h.impulse + 3 * r.impulse + k % 3, static_cast<double>(sum));
  }
  __syncthreads();
  for (int e = thread; e < chunk.entries; e += threads) {
    const CudaFaceEntry entry = load_entry(entries + e);
    if (entry.local < 0) continue;
    float4 u = nodes[2 * e], v = nodes[2 * e + 1];
    CudaFaceShare s = entry.share;
    for (int k = 0;;) {
      const float dx = s.share * impulse[3 * s.row], dy = s.share * impulse[3 * s.row + 1],
                  dz = s.share * impulse[3 * s.row + 2];
      v.x += dx, v.y += dy, v.z += dz;
      u.x += w.step.dt * dx, u.y += w.step.dt * dy, u.z += w.step.dt * dz;
      if (++k >= entry.shares) break;
      s = h.shares[entry.next_share + k - 1];
    }
    put_node(w, entry.node, entry.local & (kOwnedHere - 1), (entry.local & kOwnedHere) != 0, u, v);
  }
  if (chunk.is_large == 0) {
    __syncthreads();
    const int used = kFaceEntryRoom * chunk.entries + kFaceRowRoom * chunk.rows;
    for (int k = thread; k < used; k += threads) reinterpret_cast<float*>(nodes)[k] = 0;
  }
  if (chunk.next >= 0) __syncthreads();
}

/// After bring_nodes() moved them as if they were free: nodes of the bundle that faces hold, and
/// those inside anchors that move. All threads of the block; they must meet before they go on.
template <bool kPushes>
__device__ __forceinline__ void hold_faces(const HeldFrame& frame, int round,
                                           const BundleNodes& nodes, int bundle, float4* exchange) {
  const CudaHeldFaces h = frame.faces;
  const FacesAtWork w(frame, round, nodes);
  for (int i = bundle; i >= 0;) {
    const CudaFaceChunk chunk = load_entry(h.chunks + i);
    if (chunk.rows > 0) hold_chunk<kPushes>(h, w, bundle, exchange, chunk);
    i = chunk.next;
  }
  if (h.places == nullptr || !(w.last || h.carries_always)) return;
  __syncthreads();  // bring_nodes() wrote them
  const CudaAnchorPlace* const before = h.places + w.substep * h.anchors;
  const int end = __ldg(h.first_carried + bundle + 1);
  for (int i = __ldg(h.first_carried + bundle) + static_cast<int>(threadIdx.x); i < end;
       i += static_cast<int>(blockDim.x)) {
    const CudaCarriedNode n = h.carried[i];
    float to[3], rate[3];
    for (int c = 0; c < 3; ++c) {
      const double was = moved(before[n.anchor], n.place, c);
      const double is = moved(before[h.anchors + n.anchor], n.place, c);
      to[c] = static_cast<float>(is);
      rate[c] = static_cast<float>((is - was) / w.step.dt);
    }
    put_node(w, n.node, n.local, __ldg(frame.slot_node + n.slot) >= 0,
             {to[0], to[1], to[2], __ldcg(&w.from.u[n.node].w)},
             {rate[0], rate[1], rate[2], __ldcg(&w.from.v[n.node].w)});
  }
}

}  // namespace tissue_sim
