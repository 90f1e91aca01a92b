// The passes over pairs on the GPU: mls/passes.h says what they compute. L lanes of a warp work on
// a node: few nodes keep the GPU busy only so. Lane l sums pairs l, l + L ... in their order, then
// the lanes' sums are added pairwise: the same bits run after run.
#include <cmath>
#include <type_traits>

#include "material/laws.h"
#include "mls/cuda/device_state.h"
#include "mls/stop_tool.h"
#include "mls/stretch.h"

namespace tissue_sim {
namespace {

struct Entries {
  int first, count;
};

__device__ __forceinline__ Entries entries_of(const CudaMlsField& f, int i) {
  const int slice = i / kMlsSlice, offset = __ldg(f.offset + slice);
  return {offset + i % kMlsSlice, (__ldg(f.offset + slice + 1) - offset) / kMlsSlice};
}

/// The node that this thread works on, and its lane of L; threads beyond the last node repeat it.
template <int L>
struct Worker {
  int node, lane;
  bool is_spare;

  __device__ __forceinline__ explicit Worker(int count) {
    const int thread = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
    is_spare = thread / L >= count;
    node = min(thread / L, count - 1);
    lane = thread % L;
  }
  /// The same sums in all lanes of a node.
  template <int N>
  __device__ __forceinline__ void add_lanes(float (&sum)[N]) const {
#pragma unroll
    for (int step = L / 2; step > 0; step /= 2) {
#pragma unroll
      for (int k = 0; k < N; ++k) sum[k] += __shfl_xor_sync(0xffffffffu, sum[k], step);
    }
  }
};

/// sum_j w_ij (a_j - a_i) (x) r_ij: A[3 * component of a + component of r].
template <int L>
__device__ __forceinline__ void moments_of(const CudaMlsField& f, const Worker<L>& worker,
                                           const float4* a, float (&A)[9]) {
  const int i = worker.node;
  const Entries e = entries_of(f, i);
  const float4 xi = __ldg(f.place + i), ai = __ldg(a + i);
#pragma unroll
  for (int k = 0; k < 9; ++k) A[k] = 0;
#pragma unroll 4  // loads of several pairs are under way at once
  for (int k = worker.lane; k < e.count; k += L) {
    const int at = e.first + k * kMlsSlice;
    const int j = __ldg(f.other + at);
    const float w = __ldg(f.weight + at);
    const float4 xj = __ldg(f.place + j), aj = __ldg(a + j);
    const float r[3] = {w * (xj.x - xi.x), w * (xj.y - xi.y), w * (xj.z - xi.z)};
    const float d[3] = {aj.x - ai.x, aj.y - ai.y, aj.z - ai.z};
#pragma unroll
    for (int p = 0; p < 3; ++p) {
#pragma unroll
      for (int q = 0; q < 3; ++q) A[3 * p + q] += d[p] * r[q];
    }
  }
  worker.add_lanes(A);
}

__device__ __forceinline__ void inverse_moment(const CudaMlsField& f, int i, float (&M)[6]) {
#pragma unroll
  for (int k = 0; k < 6; ++k) M[k] = __ldg(f.inverse_moment + k * f.count + i);
}

__device__ __forceinline__ void stress_of(const CudaMlsField& f, int i, const float (&F)[9],
                                          float (&P)[9]) {
  const float mu = __ldg(f.volume_mu + i), lambda = __ldg(f.volume_lambda + i);
  if (__ldg(f.neo_hookean + i) != 0) {
    stress<NeoHookean>(F, mu, lambda, P);
  } else {
    stress<FixedCorotated>(F, mu, lambda, P);
  }
}

template <int L>
__global__ void __launch_bounds__(kMlsThreads)
    mls_stresses(CudaMlsField f, CudaMlsMotion at, CudaMlsNodeContacts contacts) {
  const Worker<L> worker(f.count);
  const int i = worker.node;
  float A[9], M[6], H[9], F[9], P[9], Q[9];
  moments_of(f, worker, at.u, A);
  inverse_moment(f, i, M);
  times_symmetric(A, M, H);
#pragma unroll
  for (int k = 0; k < 9; ++k) F[k] = k % 4 == 0 ? H[k] + 1.0f : H[k];
  if (contacts.count > 0 && worker.lane == 0 && !worker.is_spare) {
    const int k = __ldg(contacts.at + i);
    for (int c = 0; c < 9 && k >= 0; ++c) contacts.face[k].deformation[c] = F[c];
  }
  stress_of(f, i, F, P);
  if (f.viscous) {
    float rate[9];
    moments_of(f, worker, at.v, A);
    times_symmetric(A, M, rate);
    add_viscous_stress(F, rate, __ldg(f.volume_eta + i), P);
  }
  times_symmetric(P, M, Q);
  const float kappa = __ldg(f.kappa + i);
#pragma unroll
  for (int k = 0; k < 9; ++k) Q[k] -= kappa * H[k];
  if (worker.lane != 0 || worker.is_spare) return;
  f.stress[3 * i] = {Q[0], Q[3], Q[6], kappa};
  f.stress[3 * i + 1] = {Q[1], Q[4], Q[7], 0};
  f.stress[3 * i + 2] = {Q[2], Q[5], Q[8], 0};
}

__device__ __forceinline__ void add(float (&sum)[3], float w, const float4& a) {
  sum[0] += w * a.x;
  sum[1] += w * a.y;
  sum[2] += w * a.z;
}

/// Force of its pairs on node i: this lane's part.
template <int L>
__device__ __forceinline__ void pair_forces(const CudaMlsField& f, const float4* u,
                                            const Worker<L>& worker, float (&sum)[3]) {
  const int i = worker.node;
  const Entries e = entries_of(f, i);
  const float4 xi = __ldg(f.place + i), ui = __ldg(u + i);
  const float4 q0 = f.stress[3 * i], q1 = f.stress[3 * i + 1], q2 = f.stress[3 * i + 2];
#pragma unroll 4
  for (int k = worker.lane; k < e.count; k += L) {
    const int at = e.first + k * kMlsSlice;
    const int j = __ldg(f.other + at);
    const float w = __ldg(f.weight + at);
    const float4 xj = __ldg(f.place + j), uj = __ldg(u + j);
    const float4 p0 = f.stress[3 * j], p1 = f.stress[3 * j + 1], p2 = f.stress[3 * j + 2];
    const float r[3] = {xj.x - xi.x, xj.y - xi.y, xj.z - xi.z};
    const float d[3] = {uj.x - ui.x, uj.y - ui.y, uj.z - ui.z};
    add(sum, w * r[0], {q0.x + p0.x, q0.y + p0.y, q0.z + p0.z, 0});
    add(sum, w * r[1], {q1.x + p1.x, q1.y + p1.y, q1.z + p1.z, 0});
    add(sum, w * r[2], {q2.x + p2.x, q2.y + p2.y, q2.z + p2.z, 0});
    add(sum, w * (q0.w + p0.w), {d[0], d[1], d[2], 0});
    const float s = f.spring == nullptr ? 0.0f : __ldg(f.spring + at);
    if (!(s > 0)) continue;
    const float x[3] = {r[0] + d[0], r[1] + d[1], r[2] + d[2]};
    const float length = sqrtf(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
    const float rest = f.spring_rest * sqrtf(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
    add(sum, s * (length - rest) / fmaxf(length, 1e-12f), {x[0], x[1], x[2], 0});
  }
}

__device__ __forceinline__ void add_load(unsigned long long* load, double value) {
  atomicAdd(load, static_cast<unsigned long long>(__double2ll_rn(value * (1 / kMlsLoadUnit))));
}

/// The collider pushes a node at x.
__device__ __forceinline__ void add_push(const CudaMlsColliders& c, int collider,
                                         const float (&x)[3], const float (&push)[3]) {
  unsigned long long* load = c.loads + kMlsLoadSums * collider;
  double arm[3];
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    arm[a] = static_cast<double>(x[a]) - c.all[collider].position[a];
  }
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3, d = (a + 2) % 3;
    add_load(load + a, -push[a]);
    add_load(load + 3 + a, -(arm[b] * push[d] - arm[d] * push[b]));
  }
}

__device__ __forceinline__ void collider_forces(const CudaMlsField& f, const CudaMlsColliders& c,
                                                const CudaMlsStep& step, int i, const float (&x)[3],
                                                const float (&v)[3], float (&sum)[3],
                                                MlsStop& stop) {
  const std::uint32_t touched = c.touching[i];
  std::uint32_t touches = 0;
  for (std::uint32_t left = c.near; left != 0; left &= left - 1) {
    const int k = __ffs(static_cast<int>(left)) - 1;
    const Collider& collider = c.all[k];
    const bool blade = collider.kind == Collider::kBlade;
    if (blade && f.outer[i] == 0) continue;
    Gap g = gap(collider, x);
    const float distance = g.distance;
    if (!blade) g.distance -= __ldg(f.place + i).w;  // as mls/contact.cpp
    if (!(g.distance < 0)) continue;
    float4* held = c.hold + static_cast<std::size_t>(k) * f.count + i;
    float place[3], push[3];
    if ((touched >> k & 1) != 0) {
      place[0] = held->x, place[1] = held->y, place[2] = held->z;
    } else {
      to_local(collider, x, place);
    }
    contact_force(collider, g, f.contact[i], x, v, place, push);
    bear_spring(f.contact[i].stiffness, __ldg(f.mass + i), k, step.dt, step.kick, stop);
    *held = {place[0], place[1], place[2], 0};
    touches |= 1u << k;
#pragma unroll
    for (int a = 0; a < 3; ++a) sum[a] += push[a];
    add_push(c, k, x, push);
    unsigned long long* load = c.loads + kMlsLoadSums * k;
    atomicAdd(load + 6, 1ull);
    if (distance < -collider.inside && collider.inside > 0) {
      atomicAdd(load + 7, 1ull);
      atomicMax(load + 8, static_cast<unsigned long long>(-distance * (1 / kInsideUnit)));
    }
  }
  if (touches != touched) c.touching[i] = touches;
}

__device__ __forceinline__ MlsStopNode stop_node(const CudaMlsField& f, const float4* u, int i) {
  const float4 X = __ldg(f.place + i), at = __ldg(u + i);
  return {{X.x + at.x, X.y + at.y, X.z + at.z}, __ldg(f.edge + i), f.contact[i].stiffness};
}

/// What stops tools at a node, as add_contact() (mls/contact.cpp): the same in all of its lanes,
/// which share the triangles.
template <int L>
__device__ __forceinline__ void stop_tools(const CudaMlsField& f, const CudaMlsMotion& at,
                                           const CudaMlsColliders& c, const CudaMlsStep& step,
                                           const Worker<L>& worker, MlsStop& stop) {
  const int i = worker.node;
  const MlsStopNode node = stop_node(f, at.u, i);
  const Entries entries = entries_of(f, i);
  const float4 w = at.v[i];
  const float v[3] = {w.x, w.y, w.z};
  const auto neighbour = [&](int entry) {  // at the surface; else -1
    const int e = entries.first + entry * kMlsSlice, j = __ldg(f.other + e);
    return f.whole[e] != 0 && f.outer[j] != 0 ? j : -1;
  };
  for (std::uint32_t left = f.outer[i] != 0 ? c.near : 0; left != 0; left &= left - 1) {
    const int k = __ffs(static_cast<int>(left)) - 1;
    const Collider& collider = c.all[k];
    if (!is_stopped(collider)) continue;
    const Gap g = gap(collider, node.x);
    if (g.distance >= kStopReach * node.edge) continue;
    if (worker.lane == 0) stop_at_node(collider, k, g, node, v, step.dt, step.kick, stop);
    for (int y = 0; y < entries.count; ++y) {
      const int to_y = neighbour(y);
      if (to_y < 0) continue;
      const MlsStopNode at_y = stop_node(f, at.u, to_y);
      if (!may_be_stopped(g, node, at_y)) continue;
      const float4 Y = __ldg(f.place + to_y);
      for (int z = worker.lane; z < entries.count; z += L) {
        const int to_z = neighbour(z);
        if (to_z < 0 || to_z == to_y) continue;
        const MlsStopNode at_z = stop_node(f, at.u, to_z);
        if (z < y && may_be_stopped(g, node, at_z)) continue;  // seen from there
        const float4 Z = __ldg(f.place + to_z);
        const float d[3] = {Z.x - Y.x, Z.y - Y.y, Z.z - Y.z};
        if (!makes_triangle(d, at_y.edge, at_z.edge)) continue;
        stop_beside_node(collider, k, g, node, v, at_y, at_z, step.dt, step.kick, stop);
      }
    }
  }
  if (__any_sync(0xffffffffu, stop.collider >= 0) == 0) return;
  worker.add_lanes(stop.force);
  worker.add_lanes(stop.added);
#pragma unroll
  for (int lane = L / 2; lane > 0; lane /= 2) {
    stop.collider = max(stop.collider, __shfl_xor_sync(0xffffffffu, stop.collider, lane));
  }
}

/// What nodes of other pieces push it with, with MlsContact::kNodes (mls/node_contact.h): this
/// lane's part.
template <int L>
__device__ __forceinline__ void node_forces(const CudaMlsField& f, const CudaMlsMotion& at,
                                            const CudaMlsNodeContacts& contacts,
                                            const Worker<L>& worker, float (&sum)[3]) {
  const int i = worker.node;
  const int first = __ldg(contacts.begin + i), end = __ldg(contacts.begin + i + 1);
  if (first == end) return;
  const float4 xi = __ldg(f.place + i), ui = __ldg(at.u + i);
#pragma unroll 2
  for (int c = first + worker.lane; c < end; c += L) {
    const int j = __ldg(contacts.other + c);
    const float4 xj = __ldg(f.place + j), uj = __ldg(at.u + j);
    const float d[3] = {(xj.x - xi.x) + (uj.x - ui.x), (xj.y - xi.y) + (uj.y - ui.y),
                        (xj.z - xi.z) + (uj.z - ui.z)};
    const float d2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2], rest = __ldg(contacts.rest + c);
    if (d2 >= rest * rest) continue;
    const float distance = fmaxf(sqrtf(d2), 1e-12f);
    const float4 vi = at.v[i], vj = at.v[j];
    const float approach =
        ((vj.x - vi.x) * d[0] + (vj.y - vi.y) * d[1] + (vj.z - vi.z) * d[2]) / -distance;
    const ContactSpring own = f.contact[i], other = f.contact[j];
    const float k = own.stiffness * other.stiffness / (own.stiffness + other.stiffness);
    const float damping = own.damping * other.damping / (own.damping + other.damping);
    const float push = fmaxf(0.0f, k * (rest - distance) + damping * approach);
#pragma unroll
    for (int a = 0; a < 3; ++a) sum[a] -= push * d[a] / distance;
  }
}

__device__ __forceinline__ void way(const CudaMlsField& f, const float4* u, int i, int j,
                                    float (&d)[3]) {
  const float4 xi = __ldg(f.place + i), ui = __ldg(u + i);
  const float4 xj = __ldg(f.place + j), uj = __ldg(u + j);
  d[0] = (xj.x - xi.x) + (uj.x - ui.x);
  d[1] = (xj.y - xi.y) + (uj.y - ui.y);
  d[2] = (xj.z - xi.z) + (uj.z - ui.z);
}

/// As find_contact_face() (mls/node_contact.cpp); mls_stresses() left the deformation there.
__global__ void __launch_bounds__(kMlsThreads)
    mls_faces(CudaMlsField f, CudaMlsMotion at, CudaMlsNodeContacts contacts) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k >= contacts.count) return;
  const int i = contacts.node[k];
  const CudaMlsFace& own = contacts.of_node[i];
  float F[9];
  for (int c = 0; c < 9; ++c) F[c] = contacts.face[k].deformation[c];
  MlsContactFace face;
  set_mls_contact_face(F, own.face, contacts.knows[k], face);
  float sum = 0;
  for (int c = contacts.begin[i]; c < contacts.begin[i + 1]; ++c) {
    const int j = contacts.other[c];
    const CudaMlsFace& other = contacts.of_node[j];
    float d[3];
    way(f, at.u, i, j, d);
    sum += mls_contact_weight(d, own.face[3] + other.face[3], 0.5f * (own.edge + other.edge));
  }
  face.weights = fmaxf(1.0f, sum);
  contacts.face[k] = face;
}

__device__ __forceinline__ MlsContactSide side_of(const CudaMlsField& f, const CudaMlsMotion& at,
                                                  const CudaMlsNodeContacts& contacts, int i) {
  const CudaMlsFace& face = contacts.of_node[i];
  return {&f.place[i].x, &at.u[i].x, face.face,         contacts.face + contacts.at[i],
          face.spring,   face.edge,  face.root_friction};
}

/// As push_node() (mls/node_contact.cpp). Lanes share what touches a node.
template <int L>
__global__ void __launch_bounds__(kMlsThreads)
    mls_touches(CudaMlsField f, CudaMlsMotion at, CudaMlsNodeContacts contacts) {
  const Worker<L> worker(contacts.count);
  const int k = worker.node, i = contacts.node[k];
  const MlsContactSide own = side_of(f, at, contacts, i);
  float sum[12] = {};  // force, then force (x) arm
  for (int c = contacts.begin[i] + worker.lane; c < contacts.begin[i + 1] && !worker.is_spare;
       c += L) {
    const int j = contacts.other[c];
    const MlsContactSide other = side_of(f, at, contacts, j);
    const bool is_low = i < j;
    float force[3], place[3], d[3];
    MlsSlip slip = contacts.slip[c];
    const bool touches = touch_mls_faces(is_low ? own : other, is_low ? other : own, contacts.dt,
                                         slip, force, place);
    contacts.slip[c] = slip;
    if (!touches) continue;
    way(f, at.u, j, i, d);
    float arm[3];
    for (int a = 0; a < 3; ++a) {
      place[a] -= is_low ? 0.0f : d[a];
      force[a] = is_low ? force[a] : -force[a];
      sum[a] += force[a];
    }
    for (int a = 0; a < 3; ++a) arm[a] = mls_contact::dot(own.of->inverse + 3 * a, place);
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) sum[3 + 3 * a + b] += force[a] * arm[b];
    }
  }
  worker.add_lanes(sum);
  if (worker.lane != 0 || worker.is_spare) return;
  contacts.force[k] = {sum[0], sum[1], sum[2], 0};
  if (!(own.of->couples > 0)) return;
  float M[6], Q[9];
  inverse_moment(f, i, M);
  times_symmetric(sum + 3, M, Q);
  for (int b = 0; b < 3; ++b) {
    float4& column = f.stress[3 * i + b];
    column.x -= Q[b];
    column.y -= Q[3 + b];
    column.z -= Q[6 + b];
  }
}

template <int L>
__global__ void __launch_bounds__(kMlsThreads)
    mls_moves(CudaMlsField f, CudaMlsMotion at, CudaMlsMotion to, CudaMlsStep step,
              CudaMlsColliders colliders, CudaMlsNodeContacts contacts, CudaMlsHold hold) {
  const Worker<L> worker(f.count);
  const int i = worker.node;
  float sum[3] = {0, 0, 0};
  pair_forces(f, at.u, worker, sum);
  if (contacts.rest != nullptr) node_forces(f, at, contacts, worker, sum);
  worker.add_lanes(sum);
  MlsStop stop = no_stop();
  if (colliders.near != 0) stop_tools(f, at, colliders, step, worker, stop);
  if (worker.lane != 0 || worker.is_spare) return;
  const float4 u = at.u[i], v = at.v[i];
  if (contacts.count > 0 && __ldg(contacts.at + i) >= 0) {
    const float4 pushed = contacts.force[__ldg(contacts.at + i)];
    sum[0] += pushed.x;
    sum[1] += pushed.y;
    sum[2] += pushed.z;
  }
  const float inv_mass = __ldg(f.inv_mass + i);
  const float velocity[3] = {v.x, v.y, v.z}, displacement[3] = {u.x, u.y, u.z};
  float dv[3] = {}, next_v[3], next_u[3];
  if (colliders.near != 0) {
    const float4 X = __ldg(f.place + i);
    const float x[3] = {X.x + u.x, X.y + u.y, X.z + u.z};
    collider_forces(f, colliders, step, i, x, velocity, sum, stop);
    if (stop.collider >= 0 && inv_mass > 0) {
      float push[3];
      move_stopping(stop, __ldg(f.mass + i), sum, step.gravity, step.kick, dv, push);
      add_push(colliders, stop.collider, x, push);
    }
  }
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    if (stop.collider < 0) dv[a] = step.kick * (sum[a] * inv_mass + step.gravity[a]);
    next_v[a] = inv_mass > 0 ? step.keep * velocity[a] + dv[a] : 0.0f;
    next_u[a] = displacement[a] + step.dt * next_v[a];
  }
  if (!(inv_mass > 0)) {
    if (hold.impulse != nullptr) {
      const float4 J = hold.impulse[i];
      hold.impulse[i] = {J.x + step.kick * sum[0], J.y + step.kick * sum[1],
                         J.z + step.kick * sum[2], 0};
    }
    if (hold.anchors != nullptr) {
      const float4 X = __ldg(f.place + i);
      const float place[3] = {X.x, X.y, X.z};
      hold.anchors[hold.anchor[i]].displacement(place, next_u);
#pragma unroll
      for (int a = 0; a < 3; ++a) next_v[a] = (next_u[a] - displacement[a]) / step.dt;
    }
  }
  to.v[i] = {next_v[0], next_v[1], next_v[2], 0};
  to.u[i] = {next_u[0], next_u[1], next_u[2], 0};
}

template <int L>
__global__ void __launch_bounds__(kMlsThreads)
    mls_forces(CudaMlsField f, const float4* u, float4* force) {
  const Worker<L> worker(f.count);
  const int i = worker.node;
  float sum[3] = {0, 0, 0};
  pair_forces(f, u, worker, sum);
  worker.add_lanes(sum);
  if (worker.lane != 0 || worker.is_spare) return;
  force[i] = {sum[0], sum[1], sum[2], 0};
}

/// The field's arrays are const for all but this.
__global__ void __launch_bounds__(kMlsThreads)
    mls_changes(CudaMlsField f, CudaMlsFace* faces, const CudaMlsNodeChange* nodes, int node_count,
                const CudaMlsEntryChange* entries, int entry_count) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k < entry_count) {
    const CudaMlsEntryChange e = entries[k];
    const_cast<float*>(f.weight)[e.at] = e.weight;
    const_cast<std::uint8_t*>(f.whole)[e.at] = e.whole;
    if (f.spring != nullptr) const_cast<float*>(f.spring)[e.at] = e.spring;
  }
  if (k >= node_count) return;
  const CudaMlsNodeChange& c = nodes[k];
  for (int m = 0; m < 6; ++m) {
    const_cast<float*>(f.inverse_moment)[m * f.count + c.node] = c.inverse_moment[m];
  }
  const_cast<float*>(f.volume_mu)[c.node] = c.volume_mu;
  const_cast<float*>(f.volume_lambda)[c.node] = c.volume_lambda;
  const_cast<float*>(f.volume_eta)[c.node] = c.volume_eta;
  const_cast<float*>(f.kappa)[c.node] = c.kappa;
  const_cast<std::uint8_t*>(f.outer)[c.node] = c.outer;
  const_cast<float4*>(f.place)[c.node].w = c.outside;
  for (int a = 0; a < 4 && faces != nullptr; ++a) faces[c.node].face[a] = c.face[a];
}

__device__ __forceinline__ void take(CudaMlsMeasure& a, const CudaMlsMeasure& b) {
  a.elastic += b.elastic;
  a.kinetic += b.kinetic;
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    a.min[k] = fminf(a.min[k], b.min[k]);
    a.max[k] = fmaxf(a.max[k], b.max[k]);
  }
  if (!(b.speed <= a.speed)) a.speed = b.speed;
  a.stretch2 = fmaxf(a.stretch2, b.stretch2);
  a.finite &= b.finite;
}

__global__ void __launch_bounds__(kMlsThreads)
    mls_measure(CudaMlsField f, CudaMlsMotion at, CudaMlsMeasure* measures, float* stiffening,
                float* von_mises) {
  __shared__ CudaMlsMeasure of_thread[kMlsThreads];
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  CudaMlsMeasure m{0, 0, {1e30f, 1e30f, 1e30f}, {-1e30f, -1e30f, -1e30f}, 0, 0, 1};
  if (i < f.count) {
    float A[9], M[6], H[9], F[9], cof[9];
    moments_of(f, Worker<1>(f.count), at.u, A);
    inverse_moment(f, i, M);
    times_symmetric(A, M, H);
#pragma unroll
    for (int k = 0; k < 9; ++k) F[k] = k % 4 == 0 ? H[k] + 1.0f : H[k];
    m.stretch2 = most_stretch2(F);
    const float mu = __ldg(f.volume_mu + i), lambda = __ldg(f.volume_lambda + i);
    const float e = f.neo_hookean[i] != 0 ? energy<NeoHookean>(F, mu, lambda)
                                          : energy<FixedCorotated>(F, mu, lambda);
    cofactor(F, cof);
    float most = 1;
    float columns = 0;
#pragma unroll
    for (int k = 0; k < 3; ++k) {
      const float c = cof[k] * cof[k] + cof[3 + k] * cof[3 + k] + cof[6 + k] * cof[6 + k];
      columns += c;
      most = fmaxf(most, c);
    }
    m.finite = isfinite(e) && isfinite(columns) ? 1 : 0;
    if (stiffening != nullptr) stiffening[i] = m.finite != 0 ? most : INFINITY;
    if (von_mises != nullptr) {
      float P[9];
      stress_of(f, i, F, P);
      const float mises = sqrtf(fmaxf(0.0f, von_mises_squared(F, P)));
      von_mises[i] = mu > 0 ? mises / mu : 0.0f;
    }
    const float4 X = __ldg(f.place + i), u = at.u[i], v = at.v[i];
    const float x[3] = {X.x + u.x, X.y + u.y, X.z + u.z};
#pragma unroll
    for (int a = 0; a < 3; ++a) m.min[a] = m.max[a] = x[a];
    const float v2 = v.x * v.x + v.y * v.y + v.z * v.z;
    m.speed = sqrtf(v2);
    m.elastic = e;
    m.kinetic = 0.5 * __ldg(f.mass + i) * v2;
  }
  of_thread[threadIdx.x] = m;
  for (unsigned step = kMlsThreads / 2; step > 0; step /= 2) {
    __syncthreads();
    if (threadIdx.x < step) take(of_thread[threadIdx.x], of_thread[threadIdx.x + step]);
  }
  if (threadIdx.x == 0) measures[blockIdx.x] = of_thread[0];
}

int blocks_of(const CudaMlsField& f, int lanes) {
  return (f.count * lanes + kMlsThreads - 1) / kMlsThreads;
}

/// Calls launch(lanes, thread blocks) with the lanes a node that so many nodes are fastest with; an
/// H100 takes 18, 13, 12.5, 12.4 us a substep of 10 000 nodes with 1, 2, 4, 8; 21, 19, 24, 32 of 50
/// 000; 300, 326, 403, 620 of a million.
template <class Launch>
void by_lanes(const CudaMlsField& f, const Launch& launch) {
  if (f.count < 25000) {
    launch(std::integral_constant<int, 4>(), blocks_of(f, 4));
  } else if (f.count < 200000) {
    launch(std::integral_constant<int, 2>(), blocks_of(f, 2));
  } else {
    launch(std::integral_constant<int, 1>(), blocks_of(f, 1));
  }
}

}  // namespace

void launch_mls_stresses(const CudaMlsField& field, const CudaMlsMotion& at,
                         const CudaMlsNodeContacts& contacts, cudaStream_t stream) {
  by_lanes(field, [&](auto lanes, int blocks) {
    mls_stresses<lanes()><<<blocks, kMlsThreads, 0, stream>>>(field, at, contacts);
  });
}

void launch_mls_touches(const CudaMlsField& field, const CudaMlsMotion& at,
                        const CudaMlsNodeContacts& contacts, cudaStream_t stream) {
  mls_faces<<<(contacts.count + kMlsThreads - 1) / kMlsThreads, kMlsThreads, 0, stream>>>(field, at,
                                                                                          contacts);
  constexpr int kLanes = 4;
  const int blocks = (contacts.count * kLanes + kMlsThreads - 1) / kMlsThreads;
  mls_touches<kLanes><<<blocks, kMlsThreads, 0, stream>>>(field, at, contacts);
}

void launch_mls_moves(const CudaMlsField& field, const CudaMlsMotion& at, const CudaMlsMotion& to,
                      const CudaMlsStep& step, const CudaMlsColliders& colliders,
                      const CudaMlsNodeContacts& contacts, const CudaMlsHold& hold,
                      cudaStream_t stream) {
  by_lanes(field, [&](auto lanes, int blocks) {
    mls_moves<lanes()>
        <<<blocks, kMlsThreads, 0, stream>>>(field, at, to, step, colliders, contacts, hold);
  });
  check_cuda(cudaGetLastError(), "move nodes");
}

void launch_mls_changes(const CudaMlsField& field, CudaMlsFace* faces,
                        const CudaMlsNodeChange* nodes, int node_count,
                        const CudaMlsEntryChange* entries, int entry_count, cudaStream_t stream) {
  const int most = node_count > entry_count ? node_count : entry_count;
  if (most == 0) return;
  mls_changes<<<(most + kMlsThreads - 1) / kMlsThreads, kMlsThreads, 0, stream>>>(
      field, faces, nodes, node_count, entries, entry_count);
  check_cuda(cudaGetLastError(), "change pairs");
}

void launch_mls_forces(const CudaMlsField& field, const float4* u, float4* force,
                       cudaStream_t stream) {
  by_lanes(field, [&](auto lanes, int blocks) {
    mls_forces<lanes()><<<blocks, kMlsThreads, 0, stream>>>(field, u, force);
  });
  check_cuda(cudaGetLastError(), "sum forces");
}

void launch_mls_measure(const CudaMlsField& field, const CudaMlsMotion& at,
                        CudaMlsMeasure* measures, float* stiffening, float* von_mises,
                        cudaStream_t stream) {
  mls_measure<<<blocks_of(field, 1), kMlsThreads, 0, stream>>>(field, at, measures, stiffening,
                                                               von_mises);
  check_cuda(cudaGetLastError(), "measure");
}

}  // namespace tissue_sim
