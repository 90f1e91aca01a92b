#include <cuda_runtime.h>

#include "compute/cuda_check.h"
#include "mpm/cuda/search_faces.h"
#include "mpm/cuda/warp_faces.h"

namespace tissue_sim {
namespace {

constexpr int kThreads = 128;
constexpr int kSums =
    7;  // of a thread block: velocities, ways since the facets were listed, facets
int blocks_for(int n) { return (n + kThreads - 1) / kThreads; }

__device__ __forceinline__ int thread_index() {
  return static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
}

/// Sums over the threads of a block, in a fixed order, into the first one's.
__device__ void reduce(double (*all)[kSums]) {
  for (int step = static_cast<int>(blockDim.x) / 2; step > 0; step /= 2) {
    __syncthreads();
    if (static_cast<int>(threadIdx.x) >= step) continue;
    for (int i = 0; i < kSums; ++i) all[threadIdx.x][i] += all[threadIdx.x + step][i];
  }
}

/// Bits that are in the order of the floats.
__device__ __forceinline__ unsigned in_order(float value) {
  const unsigned bits = __float_as_uint(value);
  return (bits & 0x80000000u) != 0 ? ~bits : bits | 0x80000000u;
}
__device__ __forceinline__ float from_order(unsigned bits) {
  return __uint_as_float((bits & 0x80000000u) != 0 ? bits & 0x7fffffffu : ~bits);
}

/// Sum over the lanes up to this one.
__device__ __forceinline__ int sum_up_to(int value, int lane) {
#pragma unroll
  for (int step = 1; step < 32; step *= 2) {
    const int before = __shfl_up_sync(0xffffffffu, value, step);
    if (lane >= step) value += before;
  }
  return value;
}

/// Largest over a warp and all warps.
__device__ __forceinline__ void take_largest(unsigned value, unsigned* largest) {
#pragma unroll
  for (int step = 16; step > 0; step /= 2) {
    value = max(value, __shfl_xor_sync(0xffffffffu, value, step));
  }
  if (threadIdx.x % 32 == 0 && value > 0) atomicMax(largest, value);
}

__device__ __forceinline__ bool flies(const CudaLooks& s, int f) {
  return flies(s.motion[f], s.facets[f].piece.points, s.cell_size);
}

__global__ void __launch_bounds__(kThreads) move_facets(const CudaLooks s, const CudaNodes state) {
  const int f = thread_index();
  unsigned box[6] = {};
  if (f < s.facet_count) {
    move_facet(s, state, f);
    if (!flies(s, f)) {
      const SweptBox swept(s.motion[f], s.cell_size);
      for (int a = 0; a < 3; ++a) {
        box[a] = in_order(-swept.min[a]);
        box[3 + a] = in_order(swept.max[a]);
      }
    }
  }
  for (int i = 0; i < 6; ++i) take_largest(box[i], s.figures->box + i);
}

__global__ void __launch_bounds__(kThreads) sum_facets(const CudaLooks s, double* sums) {
  __shared__ double all[kThreads][kSums];
  const int f = thread_index();
  double* mine = all[threadIdx.x];
  for (int i = 0; i < kSums; ++i) mine[i] = 0;
  if (f < s.facet_count) {
    const FacetMotion& m = s.motion[f];
    SweptBox others;
    for (int a = 0; a < 3; ++a) {
      others.min[a] = -from_order(s.figures->box[a]);
      others.max[a] = from_order(s.figures->box[3 + a]);
    }
    const bool takes_part = !flies(s, f) || SweptBox(m, s.cell_size).meets(others);
    s.takes_part[f] = takes_part ? 1 : 0;
    for (int a = 0; a < 3 && takes_part; ++a) {
      mine[a] = m.v[a];
      mine[3 + a] = static_cast<double>(m.x[a]) - s.listed[f].x[a];
      mine[6] = 1;
    }
  }
  reduce(all);
  if (threadIdx.x < kSums) sums[blockIdx.x * kSums + threadIdx.x] = all[0][threadIdx.x];
}

/// One thread block: the means of all facets; the other figures begin anew.
__global__ void __launch_bounds__(kThreads)
    sum_up(const CudaLooks s, const double* sums, int blocks, bool anew) {
  __shared__ double all[kThreads][kSums];
  double* mine = all[threadIdx.x];
  for (int i = 0; i < kSums; ++i) mine[i] = 0;
  for (int b = static_cast<int>(threadIdx.x); b < blocks; b += kThreads) {
    for (int i = 0; i < kSums; ++i) mine[i] += sums[b * kSums + i];
  }
  reduce(all);
  if (threadIdx.x != 0) return;
  CudaFaceFigures& figures = *s.figures;
  const double count = fmax(1.0, all[0][6]);
  for (int a = 0; a < 3; ++a) {
    figures.mean_velocity[a] = all[0][a] / count;
    figures.mean_moved[a] = all[0][3 + a] / count;
  }
  figures.fastest = 0;
  figures.listed_anew = anew ? 1 : 0;
}

__device__ __forceinline__ float speed_of(const CudaLooks& s, int f) {
  const double* mean = s.figures->mean_velocity;
  const float* v = s.motion[f].v;
  const double x = v[0] - mean[0], y = v[1] - mean[1], z = v[2] - mean[2];
  return static_cast<float>(sqrt(x * x + y * y + z * z));
}

__global__ void find_fastest(const CudaLooks s) {
  const int f = thread_index();
  const bool takes_part = f < s.facet_count && s.takes_part[f] != 0;
  // Not a number is more than any number as unsigned, too.
  take_largest(takes_part ? __float_as_uint(speed_of(s, f)) & 0x7fffffffu : 0, &s.figures->fastest);
}

__device__ __forceinline__ bool out_of_control(const CudaLooks& s) {
  return !(__uint_as_float(s.figures->fastest) < kOutOfControl);
}
__device__ __forceinline__ double horizon_of(const CudaLooks& s) {
  return search_horizon(__uint_as_float(s.figures->fastest), s.cell_size);
}
/// How far a facet gets until the next search [m].
__device__ __forceinline__ float travel_of(const CudaLooks& s, int f) {
  return speed_of(s, f) * static_cast<float>(kForesight * horizon_of(s));
}

/// Whether no facet has left its skin, nor will until the next search.
__global__ void check_lists(const CudaLooks s) {
  const int f = thread_index();
  CudaFaceFigures& figures = *s.figures;
  if (f == 0) figures.horizon = out_of_control(s) ? kHorizon : horizon_of(s);
  if (f >= s.facet_count || out_of_control(s) || s.takes_part[f] == 0) return;
  const ListedFacet& listed = s.listed[f];
  double way2 = 0;
  for (int a = 0; a < 3; ++a) {
    const double way = static_cast<double>(s.motion[f].x[a]) - listed.x[a] - figures.mean_moved[a];
    way2 += way * way;
  }
  if (!(sqrt(way2) + travel_of(s, f) <= listed.skin)) figures.listed_anew = 1;
}

/// Whether lists are to be made.
__device__ __forceinline__ bool lists_wanted(const CudaLooks& s) {
  return s.figures->listed_anew != 0 && !out_of_control(s);
}

/// Clears what lists are made of.
__global__ void clear_lists(const CudaLooks s, const CudaSearchRoom room) {
  if (!lists_wanted(s)) return;
  const int first = thread_index(), step = static_cast<int>(gridDim.x * blockDim.x);
  for (int i = first; i < room.buckets; i += step) room.count[i] = 0;
  for (std::size_t i = first; i < s.node_count; i += step) s.marks[i] = 0;
  if (first != 0) return;
  CudaFaceFigures& figures = *s.figures;
  figures.largest_reach = 0;
  figures.in_grid = figures.near = figures.contacts = figures.involved = 0;
}

__global__ void list_facets(const CudaLooks s) {
  const int f = thread_index();
  if (!lists_wanted(s)) return;
  float reach = 0;
  if (f < s.facet_count) {
    ListedFacet& listed = s.listed[f];
    for (int a = 0; a < 3; ++a) listed.x[a] = s.motion[f].x[a];
    listed.skin = s.takes_part[f] != 0 ? travel_of(s, f) + kSkin * s.cell_size : -1.0f;
    s.is_involved[f] = 0;
    if (s.takes_part[f] != 0) reach = kSearchReach * s.cell_size + listed.skin;
  }
  take_largest(__float_as_uint(reach), &s.figures->largest_reach);
}

/// A hash grid whose cells are so large that facets meet others in their own and the next alone.
struct Grid {
  float reach, per_metre;  // the largest of all [m], [1/m]
  std::uint32_t mask;

  __device__ __forceinline__ Grid(const CudaLooks& s, const CudaSearchRoom& room) {
    reach = __uint_as_float(s.figures->largest_reach);
    per_metre = 0.5f / reach;
    mask = static_cast<std::uint32_t>(room.buckets) - 1;
  }
  __device__ __forceinline__ int cell(float x) const {
    return static_cast<int>(floorf(x * per_metre));
  }
  __device__ __forceinline__ std::uint32_t bucket(int x, int y, int z) const {
    const std::uint32_t h = static_cast<std::uint32_t>(x) * 73856093u ^
                            static_cast<std::uint32_t>(y) * 19349663u ^
                            static_cast<std::uint32_t>(z) * 83492791u;
    return (h ^ h >> 15) & mask;
  }
  __device__ __forceinline__ std::uint32_t bucket_at(const float* x) const {
    return bucket(cell(x[0]), cell(x[1]), cell(x[2]));
  }
};

__global__ void count_in_grid(const CudaLooks s, const CudaSearchRoom room) {
  const int f = thread_index();
  if (f >= s.facet_count || !lists_wanted(s) || s.takes_part[f] == 0) return;
  room.rank[f] = atomicAdd(room.count + Grid(s, room).bucket_at(s.motion[f].x), 1);
}

/// Gives the buckets their places, in any order: those of a warp one after the other.
__global__ void place_buckets(const CudaLooks s, const CudaSearchRoom room) {
  const int i = thread_index(), lane = static_cast<int>(threadIdx.x) % 32;
  if (!lists_wanted(s)) return;
  const int count = i < room.buckets ? room.count[i] : 0;
  const int end = sum_up_to(count, lane);
  int first = 0;
  if (lane == 31 && end > 0) first = atomicAdd(&s.figures->in_grid, end);
  first = __shfl_sync(0xffffffffu, first, 31);
  if (i < room.buckets) room.begin[i] = first + end - count;
}

__global__ void fill_grid(const CudaLooks s, const CudaSearchRoom room) {
  const int f = thread_index();
  if (f >= s.facet_count || !lists_wanted(s) || s.takes_part[f] == 0) return;
  const float* x = s.motion[f].x;
  CudaSeeker seeker = {{x[0], x[1], x[2]}, kSearchReach * s.cell_size + s.listed[f].skin, f};
  room.sorted[room.begin[Grid(s, room).bucket_at(x)] + room.rank[f]] = seeker;
}

/// Whether a facet touches another that may meet it: they face one another, and no bonds bind them.
__device__ __forceinline__ bool may_touch(const CudaLooks& s, int f, int g) {
  if (f == g || dot(s.motion[f].normal, s.motion[g].normal) > kFacing) return false;
  const CudaFacet &p = s.facets[f], &q = s.facets[g];
  if (!touches(p.piece, q.piece)) return false;
  if (p.piece.id != q.piece.id) return true;
  const CudaLattice& lattice = s.lattices[p.body];
  return !are_bound({p.site[0], p.site[1], p.site[2]}, {q.site[0], q.site[1], q.site[2]},
                    [&](int x, int y, int z) {
                      const std::size_t row = static_cast<std::size_t>(z) * lattice.sites_y + y;
                      return s.bonds[s.point_at[lattice.first_site + row * lattice.sites_x + x]];
                    });
}

/// Calls visit(g) for each facet g that f may touch; the lanes of a warp share them.
template <class F>
__device__ __forceinline__ void for_each_near(const CudaLooks& s, const CudaSearchRoom& room,
                                              const Grid& grid, int f, int lane, const F& visit) {
  const float* x = s.motion[f].x;
  const float own_reach = kSearchReach * s.cell_size + s.listed[f].skin;
  int lowest[3], size[3];
  for (int a = 0; a < 3; ++a) {
    lowest[a] = grid.cell(x[a] - own_reach - grid.reach);
    size[a] = grid.cell(x[a] + own_reach + grid.reach) - lowest[a] + 1;
  }
  const int cells = size[0] * size[1] * size[2];
  for (int first = 0; first < cells; first += 32) {
    const int i = first + lane;
    const int cx = lowest[0] + i % size[0], cy = lowest[1] + i / size[0] % size[1],
              cz = lowest[2] + i / size[0] / size[1];
    const std::uint32_t bucket = grid.bucket(cx, cy, cz);
    const int count = i < cells ? room.count[bucket] : 0;
    const int begin = count > 0 ? room.begin[bucket] : 0;
    for (unsigned left = __ballot_sync(0xffffffffu, count > 0); left != 0; left &= left - 1) {
      const int from = __ffs(static_cast<int>(left)) - 1;
      const int cell[3] = {__shfl_sync(0xffffffffu, cx, from), __shfl_sync(0xffffffffu, cy, from),
                           __shfl_sync(0xffffffffu, cz, from)};
      const int at = __shfl_sync(0xffffffffu, begin, from),
                end = at + __shfl_sync(0xffffffffu, count, from);
      for (int j = at + lane; j < end; j += 32) {
        const CudaSeeker other = room.sorted[j];
        const float far = own_reach + other.reach;
        bool meets = true;
        for (int a = 0; a < 3; ++a) {
          meets = meets && fabsf(x[a] - other.x[a]) < far && grid.cell(other.x[a]) == cell[a];
        }
        if (meets && may_touch(s, f, other.facet)) visit(other.facet);
      }
    }
  }
}

/// A warp for each facet: the facets that it may touch, and what becomes of its contact.
__global__ void __launch_bounds__(kThreads)
    find_near(const CudaLooks s, const CudaSearchRoom room) {
  const int f = thread_index() / 32, lane = static_cast<int>(threadIdx.x) % 32;
  if (f >= s.facet_count || !lists_wanted(s)) return;
  const Grid grid(s, room);
  int count = 0;
  if (s.takes_part[f] != 0) for_each_near(s, room, grid, f, lane, [&](int) { ++count; });
  const int end = sum_up_to(count, lane);  // of this lane's among all
  const int all = __shfl_sync(0xffffffffu, end, 31);
  if (lane == 0) s.near_count[f] = all;
  if (all == 0) {
    if (lane == 0) {
      s.springs[f].other = -1;
      s.springs[f].touching = false;
    }
    return;
  }
  int first = 0;  // each list has twice the places, to be sorted in
  if (lane == 0) {
    first = atomicAdd(&s.figures->near, 2 * all);
    s.first_near[f] = first;
    s.contacts[atomicAdd(&s.figures->contacts, 1)] = f;
    s.is_involved[f] = 1;
    if (s.springs[f].other >= 0) s.is_involved[s.springs[f].other] = 1;
  }
  first = __shfl_sync(0xffffffffu, first, 0);
  if (static_cast<std::size_t>(first) + 2 * all > s.near_capacity) return;
  std::int32_t* unsorted = s.near + first + all;
  int to = end - count;
  for_each_near(s, room, grid, f, lane, [&](int g) { unsorted[to++] = g; });
  __syncwarp();
  for (int i = lane; i < all; i += 32) {
    int rank = 0;
    for (int j = 0; j < all; ++j) rank += unsorted[j] < unsorted[i] ? 1 : 0;
    s.near[first + rank] = unsorted[i];
    s.is_involved[unsorted[i]] = 1;
  }
}

/// Whether lists were made.
__device__ __forceinline__ bool lists_made(const CudaLooks& s) {
  return lists_wanted(s) && static_cast<std::size_t>(s.figures->near) <= s.near_capacity;
}

/// Facets that looks ask for, and the nodes that contacts may push.
__global__ void list_involved(const CudaLooks s) {
  const int f = thread_index();
  if (f >= s.facet_count || !lists_made(s) || s.is_involved[f] == 0) return;
  s.involved[atomicAdd(&s.figures->involved, 1)] = f;
  const CudaFacet& at = s.facets[f];
  for (int k = 0; k < 27; ++k) {
    const std::int32_t entry =
        s.slot_node[at.slot + k / 9 * at.plane + k / 3 % 3 * at.pitch + k % 3];
    s.marks[entry < 0 ? ~entry : entry] = 1;
  }
}

/// The slots of these nodes.
__global__ void mark_slots(const CudaLooks s) {
  const int slot = thread_index();
  if (slot >= s.slot_count || !lists_made(s)) return;
  const std::int32_t entry = s.slot_node[slot];
  const bool pushed = s.marks[entry < 0 ? ~entry : entry] != 0;
  s.pushed_parts[slot] = s.slot_parts[slot] | (pushed ? kPushed : 0);
}

__global__ void begin_anew(const CudaLooks s) {
  const int f = thread_index();
  if (f >= s.facet_count) return;
  FaceSpring c = {};
  c.facet = f;
  s.springs[f] = c;
}

/// A warp for each contact.
__global__ void take_up_kept(const CudaLooks s, const CudaNodes state, const KeptContact* kept,
                             int kept_count, float dt) {
  const int i = thread_index() / 32;
  if (i >= s.figures->contacts) return;
  FaceSpring& at = s.springs[s.contacts[i]];
  FaceSpring c = at;
  const KeptContact* before = find_kept(kept, kept_count, s.facets[c.facet].facet);
  if (before == nullptr) return;
  WarpFaces faces(s, state, c);
  take_up(faces, c, *before, dt);
  __syncwarp();
  if (threadIdx.x % 32 == 0) at = c;
}

__global__ void gather_contacts(const CudaLooks s, int count, FaceSpring* out) {
  const int i = thread_index();
  if (i < count) out[i] = s.springs[s.contacts[i]];
}

void check_launch() { check_cuda(cudaGetLastError(), "start a kernel"); }

}  // namespace

std::size_t search_sums(int facet_count) {
  return static_cast<std::size_t>(kSums) * blocks_for(facet_count);
}

void launch_fresh_contacts(const CudaLooks& looks, cudaStream_t stream) {
  begin_anew<<<blocks_for(looks.facet_count), kThreads, 0, stream>>>(looks);
  check_launch();
}

void launch_search(const CudaLooks& looks, const CudaNodes& state, const CudaSearchRoom& room,
                   bool anew, cudaStream_t stream) {
  const int blocks = blocks_for(looks.facet_count);
  check_cuda(cudaMemsetAsync(looks.figures->box, 0, sizeof(looks.figures->box), stream),
             "clear memory");
  move_facets<<<blocks, kThreads, 0, stream>>>(looks, state);
  sum_facets<<<blocks, kThreads, 0, stream>>>(looks, room.sums);
  sum_up<<<1, kThreads, 0, stream>>>(looks, room.sums, blocks, anew);
  find_fastest<<<blocks, kThreads, 0, stream>>>(looks);
  check_lists<<<blocks, kThreads, 0, stream>>>(looks);
  check_launch();
  launch_lists(looks, room, stream);
}

void launch_lists(const CudaLooks& looks, const CudaSearchRoom& room, cudaStream_t stream) {
  const int blocks = blocks_for(looks.facet_count);
  clear_lists<<<blocks, kThreads, 0, stream>>>(looks, room);
  list_facets<<<blocks, kThreads, 0, stream>>>(looks);
  count_in_grid<<<blocks, kThreads, 0, stream>>>(looks, room);
  place_buckets<<<blocks_for(room.buckets), kThreads, 0, stream>>>(looks, room);
  fill_grid<<<blocks, kThreads, 0, stream>>>(looks, room);
  find_near<<<blocks_for(32 * looks.facet_count), kThreads, 0, stream>>>(looks, room);
  list_involved<<<blocks, kThreads, 0, stream>>>(looks);
  mark_slots<<<blocks_for(static_cast<int>(looks.slot_count)), kThreads, 0, stream>>>(looks);
  check_launch();
}

void launch_take_up(const CudaLooks& looks, const CudaNodes& state, const KeptContact* kept,
                    int kept_count, int contact_count, float dt, cudaStream_t stream) {
  if (contact_count == 0) return;
  take_up_kept<<<blocks_for(32 * contact_count), kThreads, 0, stream>>>(looks, state, kept,
                                                                        kept_count, dt);
  check_launch();
}

void launch_gather_contacts(const CudaLooks& looks, int count, FaceSpring* out,
                            cudaStream_t stream) {
  if (count == 0) return;
  gather_contacts<<<blocks_for(count), kThreads, 0, stream>>>(looks, count, out);
  check_launch();
}

}  // namespace tissue_sim
