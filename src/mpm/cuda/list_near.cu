// The lists of facets that may touch one another, from a hash grid.
#include <cuda_runtime.h>

#include "mpm/cuda/search_faces.h"
#include "mpm/cuda/search_kernels.h"

namespace tissue_sim {
namespace {

/// Clears what lists are made of.
__global__ void clear_lists(const CudaLooks s, const CudaSearchRoom room) {
  if (!lists_wanted(s)) return;
  const int first = thread_index(), step = static_cast<int>(gridDim.x * blockDim.x);
  for (int i = first; i < room.buckets; i += step) room.count[i] = 0;
  for (std::size_t i = first; i < s.node_count; i += step) s.marks[i] &= ~kMarkedByFaces;
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
  const auto reach = static_cast<float>(kSearchReach * s.cell_size + s.listed[f].skin);
  const CudaSeeker seeker = {{x[0], x[1], x[2]}, reach, f};
  room.sorted[room.begin[Grid(s, room).bucket_at(x)] + room.rank[f]] = seeker;
}

/// Whether a facet touches another that may meet it: they face one another, and no bonds bind them,
/// as far as point_at is there to tell.
__device__ __forceinline__ bool may_touch(const CudaLooks& s, int f, int g) {
  if (f == g || dot(s.motion[f].normal, s.motion[g].normal) > kFacing) return false;
  const CudaFacet &p = s.facets[f], &q = s.facets[g];
  if (!touches(p.piece, q.piece)) return false;
  if (p.piece.id != q.piece.id) return true;
  if (are_back_to_back(s.motion[f], s.motion[g], s.cell_size)) return false;
  if (s.point_at == nullptr) return true;
  const CudaLattice& lattice = s.lattices[p.body];
  return !are_bound({p.site[0], p.site[1], p.site[2]}, {q.site[0], q.site[1], q.site[2]},
                    [&](int x, int y, int z) {
                      const std::size_t row = static_cast<std::size_t>(z) * lattice.sites_y + y;
                      return s.bonds[s.point_at[lattice.first_site + row * lattice.sites_x + x]];
                    });
}

/// Whether a facet's place in the box of another.
__device__ __forceinline__ bool meets(const float* x, const float* y, float far) {
  bool meets = true;
  for (int a = 0; a < 3; ++a) meets = meets && fabsf(x[a] - y[a]) < far;
  return meets;
}

/// The facet of another piece that f presses on where may_touch() no longer tells of it, for the
/// tissue between has turned away; -1 if none.
__device__ __forceinline__ int pressed_by(const CudaLooks& s, int f, float own_reach) {
  if (s.springs == nullptr) return -1;
  const FaceSpring& c = s.springs[f];
  const int g = c.other;
  if (g < 0 || !c.touching || s.takes_part[g] == 0) return -1;
  const PieceSize &own = s.facets[f].piece, &other = s.facets[g].piece;
  if (own.id == other.id || !touches(own, other)) return -1;
  const float far = own_reach + (kSearchReach * s.cell_size + s.listed[g].skin);
  return meets(s.motion[f].x, s.motion[g].x, far) && may_touch(s, f, g) ? -1 : g;
}

/// Calls visit(g) for each facet g that f may touch; the lanes of a warp share them.
template <class F>
__device__ __forceinline__ void for_each_near(const CudaLooks& s, const CudaSearchRoom& room,
                                              const Grid& grid, int f, int lane, const F& visit) {
  const float* x = s.motion[f].x;
  const float own_reach = kSearchReach * s.cell_size + s.listed[f].skin;
  if (lane == 0) {
    const int pressed = pressed_by(s, f, own_reach);
    if (pressed >= 0) visit(pressed);
  }
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
        bool is_here = true;
        for (int a = 0; a < 3; ++a) is_here = is_here && grid.cell(other.x[a]) == cell[a];
        if (is_here && meets(x, other.x, far) && may_touch(s, f, other.facet)) visit(other.facet);
      }
    }
  }
}

/// Facets found for one, in shared memory, while there are so few; in any order.
struct FoundFacets {
  static constexpr int kMost = 128;
  int count;
  std::int32_t facet[kMost];
};

/// A warp for each facet: the facets that it may touch, and what becomes of its contact. They are
/// looked for once, or, where they are more than FoundFacets holds, again to write them down.
__global__ void __launch_bounds__(kThreads)
    find_near(const CudaLooks s, const CudaSearchRoom room) {
  __shared__ FoundFacets of_warps[kThreads / 32];
  const int f = thread_index() / 32, lane = static_cast<int>(threadIdx.x) % 32;
  if (f >= s.facet_count || !lists_wanted(s)) return;
  const Grid grid(s, room);
  FoundFacets& found = of_warps[threadIdx.x / 32];
  if (lane == 0) found.count = 0;
  __syncwarp();
  if (s.takes_part[f] != 0) {
    for_each_near(s, room, grid, f, lane, [&](int g) {
      const int at = atomicAdd(&found.count, 1);
      if (at < FoundFacets::kMost) found.facet[at] = g;
    });
  }
  __syncwarp();
  const int all = found.count;
  int first = 0;
  if (lane == 0) {
    s.near_count[f] = all;
    s.first_near[f] = 0;
  }
  if (all == 0) {
    if (lane == 0 && s.springs != nullptr) {
      s.springs[f].other = -1;
      s.springs[f].touching = false;
    }
    return;
  }
  const bool fits = all <= FoundFacets::kMost;
  const int places = fits ? all : 2 * all;  // those that do not fit are sorted in twice the places
  if (lane == 0) {
    first = atomicAdd(&s.figures->near, places);
    s.first_near[f] = first;
  }
  first = __shfl_sync(0xffffffffu, first, 0);
  if (static_cast<std::size_t>(first) + places > s.near_capacity) return;
  if (lane == 0) {
    s.contacts[atomicAdd(&s.figures->contacts, 1)] = f;
    s.is_involved[f] = 1;
    if (s.springs[f].other >= 0) s.is_involved[s.springs[f].other] = 1;
  }
  std::int32_t* unsorted = fits ? found.facet : s.near + first + all;
  if (!fits) {
    __syncwarp();
    if (lane == 0) found.count = 0;
    __syncwarp();
    for_each_near(s, room, grid, f, lane, [&](int g) { unsorted[atomicAdd(&found.count, 1)] = g; });
    __syncwarp();
  }
  for (int i = lane; i < all; i += 32) {
    int rank = 0;
    for (int j = 0; j < all; ++j) rank += unsorted[j] < unsorted[i] ? 1 : 0;
    s.near[first + rank] = unsorted[i];
    s.is_involved[unsorted[i]] = 1;
  }
}

/// Whether there are lists, and whether they were made anew.
__device__ __forceinline__ bool lists_fit(const CudaLooks& s) {
  return !out_of_control(s) && static_cast<std::size_t>(s.figures->near) <= s.near_capacity;
}
__device__ __forceinline__ bool lists_made(const CudaLooks& s) {
  return lists_wanted(s) && lists_fit(s);
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
    s.marks[entry < 0 ? ~entry : entry] |= kMarkedByFaces;
  }
}

/// The slots of these nodes.
__global__ void mark_slots(const CudaLooks s) {
  const int slot = thread_index();
  if (slot >= s.slot_count || !lists_made(s) || s.figures->contacts == 0) return;
  mark_slot(s.slot_node, s.slot_parts, s.marks, slot, s.pushed_parts);
}

/// How soon the first two of the lists may meet.
__global__ void find_meeting(const CudaLooks s) {
  const int f = thread_index();
  float rate = 0;
  if (f < s.facet_count && lists_fit(s)) {
    const float fastest = __uint_as_float(s.figures->fastest);
    const std::int32_t* near = s.near + s.first_near[f];
    for (int i = 0; i < s.near_count[f]; ++i) {
      const FacetMotion& other = s.motion[near[i]];
      rate = fmaxf(rate, rate_of_meeting(s.motion[f], other, fastest, s.cell_size));
    }
    if (s.near_count[f] > 0 && s.springs[f].touching) rate = 1e30f;
  }
  take_largest(__float_as_uint(rate), &s.figures->meeting);
}

}  // namespace

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
  find_meeting<<<blocks, kThreads, 0, stream>>>(looks);
  check_launch();
}

}  // namespace tissue_sim
