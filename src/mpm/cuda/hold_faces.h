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

/// A node after the substep were it free, by the sums of bring_nodes().
template <bool kPushes>
__device__ __forceinline__ void move_free(const FacesAtWork& w, const CudaFaceEntry& e, float4& u,
                                          float4& v) {
  u = __ldcg(w.from.u + e.node);
  v = __ldcg(w.from.v + e.node);
  float4 f{0, 0, 0, 0};
  int inert = 0;
  if (e.slot >= 0) {
    const int count = static_cast<int>(e.shared & 63u);
    const bool marked = kPushes && (__ldg(w.slot_parts + e.slot) & kPushed) != 0;
    const float4 zero{0, 0, 0, 0};
    f = __ldcg(w.force + e.parts.x);
    const float4 y = count > 1 ? __ldcg(w.force + e.parts.y) : zero;
    const float4 z = count > 2 ? __ldcg(w.force + e.parts.z) : zero;
    const float4 last = count > 3 ? __ldcg(w.force + e.parts.w) : zero;
    add(y, f);
    add(z, f);
    add(last, f);
#pragma unroll 4
    for (int p = 4; p < count; ++p) {
      add(__ldcg(w.force + __ldg(w.parts + (e.shared >> 6) + p)), f);
    }
    if (marked) {
      const Pushed push(w.pushed, true, false, e.node);
      add({push.of(0), push.of(1), push.of(2), 0}, f);
      inert = push.inert;
    }
  }
  w.step.move(0, f.x, u.w, v.w, u.x, v.x);
  w.step.move(1, f.y, u.w, v.w, u.y, v.y);
  w.step.move(2, f.z, u.w, v.w, u.z, v.z);
  if (kPushes && inert != 0) resist(w.pushed, e.node, w.step, w.from, u, v);
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
    v += r.weight[k] * node[3 + c];
    u += r.weight[k] * node[c];
  }
  return lacks - ((1 - h.drift) * v + h.drift * inv_dt * u);
}

/// Holds the groups of a chunk. The first entry and row of each thread are on their way from the
/// beginning, and its entry's masses stay.
template <bool kPushes>
__device__ __forceinline__ void hold_chunk(const CudaHeldFaces& h, const FacesAtWork& w,
                                           const CudaFaceChunk& chunk) {
  const int thread = static_cast<int>(threadIdx.x), threads = static_cast<int>(blockDim.x);
  const int numbers = 3 * chunk.rows;
  const CudaFaceEntry* const entries = h.entries + chunk.first_entry;
  const CudaFaceRow* const rows = h.rows + chunk.first_row;
  float* const nodes =
      chunk.is_large != 0 ? h.room + h.room_each * w.bundle : reinterpret_cast<float*>(w.exchange);
  float* const left = nodes + kFaceEntryRoom * chunk.entries;
  float* const impulse = left + numbers;
  const CudaFaceRow first = load_entry(rows + min(thread, numbers - 1) / 3);
  const auto row = [&](int k) { return k == thread ? first : load_entry(rows + k / 3); };
  for (int e = thread; e < chunk.entries; e += threads) {
    float4 u, v;
    move_free<kPushes>(w, load_entry(entries + e), u, v);
    float* const node = nodes + kFaceEntryRoom * e;
    node[0] = u.x, node[1] = u.y, node[2] = u.z;
    node[3] = v.x, node[4] = v.y, node[5] = v.z;
  }
  const auto act = [&](const CudaFaceRow& r, int k, float sum) {
    impulse[k] = sum;
    if (r.impulse < 0 || h.impulse == nullptr) return;
    atomicAdd(h.impulse + 3 * r.impulse + k % 3, static_cast<double>(sum));
  };
  __syncthreads();
  for (int k = thread; k < numbers; k += threads) {
    const CudaFaceRow r = row(k);
    left[k] = left_of(h, w, r, nodes, k % 3);
    if (r.rows == 1) act(r, k, r.own * left[k]);
  }
  __syncthreads();
  if (chunk.has_groups != 0) {
    for (int k = thread; k < numbers; k += threads) {
      const CudaFaceRow r = row(k);
      if (r.rows == 1) continue;
      const float* const of_group = left + 3 * r.group + k % 3;
      float sum = 0;
      for (int j = 0; j < r.rows; ++j) sum += __ldg(h.inverse + r.inverse + j) * of_group[3 * j];
      act(r, k, sum);
    }
    __syncthreads();
  }
  for (int e = thread; e < chunk.entries; e += threads) {
    const CudaFaceEntry entry = load_entry(entries + e);
    if (entry.local < 0) continue;
    const float* const node = nodes + kFaceEntryRoom * e;
    float4 u{node[0], node[1], node[2], 0}, v{node[3], node[4], node[5], 0};
    if (entry.owned != 0) {
      u.w = __ldcg(&w.from.u[entry.node].w);
      v.w = __ldcg(&w.from.v[entry.node].w);
    }
    CudaFaceShare s = entry.share;
    for (int k = 0;;) {
      const float dx = s.share * impulse[3 * s.row], dy = s.share * impulse[3 * s.row + 1],
                  dz = s.share * impulse[3 * s.row + 2];
      v.x += dx, v.y += dy, v.z += dz;
      u.x += w.step.dt * dx, u.y += w.step.dt * dy, u.z += w.step.dt * dz;
      if (++k >= entry.shares) break;
      s = h.shares[entry.next_share + k - 1];
    }
    put_node(w, entry.node, entry.local, entry.owned != 0, u, v);
  }
  if (chunk.is_large == 0) {
    __syncthreads();
    const int used = kFaceEntryRoom * chunk.entries + kFaceRowRoom * chunk.rows;
    for (int k = thread; k < used; k += threads) nodes[k] = 0;
  }
  if (chunk.next >= 0) __syncthreads();
}

/// After bring_nodes() moved them as if they were free: nodes of the bundle that faces hold, and
/// those inside anchors that move. All threads of the block; they must meet before they go on. Out
/// of line, for scenes without anchors to keep their registers.
template <bool kPushes>
__device__ __noinline__ void hold_faces(const CudaHeldFaces h, const FacesAtWork w) {
  for (int i = w.bundle; i >= 0;) {
    const CudaFaceChunk chunk = load_entry(h.chunks + i);
    if (chunk.rows > 0) hold_chunk<kPushes>(h, w, chunk);
    i = chunk.next;
  }
  if (h.places == nullptr || !(w.last || h.carries_always)) return;
  __syncthreads();  // bring_nodes() wrote them
  const CudaAnchorPlace* const before = h.places + w.substep * h.anchors;
  const int end = __ldg(h.first_carried + w.bundle + 1);
  for (int i = __ldg(h.first_carried + w.bundle) + static_cast<int>(threadIdx.x); i < end;
       i += static_cast<int>(blockDim.x)) {
    const CudaCarriedNode n = h.carried[i];
    float to[3], rate[3];
    for (int c = 0; c < 3; ++c) {
      const double was = moved(before[n.anchor], n.place, c);
      const double is = moved(before[h.anchors + n.anchor], n.place, c);
      to[c] = static_cast<float>(is);
      rate[c] = static_cast<float>((is - was) / w.step.dt);
    }
    put_node(w, n.node, n.local, __ldg(w.slot_node + n.slot) >= 0,
             {to[0], to[1], to[2], __ldcg(&w.from.u[n.node].w)},
             {rate[0], rate[1], rate[2], __ldcg(&w.from.v[n.node].w)});
  }
}

}  // namespace tissue_sim
