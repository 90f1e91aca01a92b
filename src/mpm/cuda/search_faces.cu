#include <cuda_runtime.h>

#include "mpm/cuda/contact_lanes.h"
#include "mpm/cuda/search_faces.h"
#include "mpm/cuda/search_kernels.h"

namespace tissue_sim {
namespace {

// Of a thread block: velocities, ways since the facets were listed, facets.
constexpr int kSums = 7;

/// Sums over the threads of a block, in a fixed order, into the first one's.
__device__ void reduce(double (*all)[kSums]) {
  for (int step = static_cast<int>(blockDim.x) / 2; step > 0; step /= 2) {
    __syncthreads();
    if (static_cast<int>(threadIdx.x) >= step) continue;
    for (int i = 0; i < kSums; ++i) all[threadIdx.x][i] += all[threadIdx.x + step][i];
  }
  __syncthreads();
}

/// Bits that are in the order of the floats.
__device__ __forceinline__ unsigned in_order(float value) {
  const unsigned bits = __float_as_uint(value);
  return (bits & 0x80000000u) != 0 ? ~bits : bits | 0x80000000u;
}
__device__ __forceinline__ float from_order(unsigned bits) {
  return __uint_as_float((bits & 0x80000000u) != 0 ? bits & 0x7fffffffu : ~bits);
}

__device__ __forceinline__ bool flies(const CudaLooks& s, int f) {
  return flies(s.motion[f], s.facets[f].piece.points, s.cell_size);
}

__global__ void __launch_bounds__(kThreads) move_facets(const CudaLooks s, const CudaNodes state) {
  const int f = thread_index();
  unsigned box[6] = {};
  if (f < s.facet_count) {
    s.motion[f] = motion_of(s, state, s.facets[f]);
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
  figures.fastest = figures.meeting = 0;
  figures.listed_anew = anew ? 1 : 0;
}

__global__ void find_fastest(const CudaLooks s) {
  const int f = thread_index();
  const bool takes_part = f < s.facet_count && s.takes_part[f] != 0;
  // Not a number is more than any number as unsigned, too.
  take_largest(takes_part ? __float_as_uint(speed_of(s, f)) & 0x7fffffffu : 0, &s.figures->fastest);
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

__global__ void begin_anew(const CudaLooks s) {
  const int f = thread_index();
  if (f >= s.facet_count) return;
  FaceSpring c = {};
  c.facet = f;
  s.springs[f] = c;
}

/// A group of lanes for each contact.
__global__ void take_up_kept(const CudaLooks s, const CudaNodes state, const KeptContact* kept,
                             int kept_count, float dt) {
  const int i = thread_index() / kContactLanes;
  if (i >= s.figures->contacts) return;
  FaceSpring& at = s.springs[s.contacts[i]];
  FaceSpring c = at;
  const KeptContact* before = find_kept(kept, kept_count, s.facets[c.facet].facet);
  if (before == nullptr) return;
  LaneFaces faces(s, state);
  faces.index = c.facet;
  faces.take(c);
  faces.bring();
  take_up(faces, c, *before, dt);
  __syncwarp(faces.lanes.mask);
  if (faces.lanes.lane == 0) at = c;
}

__global__ void gather_contacts(const CudaLooks s, int count, FaceSpring* out) {
  const int i = thread_index();
  if (i < count) out[i] = s.springs[s.contacts[i]];
}

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

void launch_take_up(const CudaLooks& looks, const CudaNodes& state, const KeptContact* kept,
                    int kept_count, int contact_count, float dt, cudaStream_t stream) {
  if (contact_count == 0) return;
  take_up_kept<<<blocks_for(kContactLanes * contact_count), kThreads, 0, stream>>>(
      looks, state, kept, kept_count, dt);
  check_launch();
}

void launch_gather_contacts(const CudaLooks& looks, int count, FaceSpring* out,
                            cudaStream_t stream) {
  if (count == 0) return;
  gather_contacts<<<blocks_for(count), kThreads, 0, stream>>>(looks, count, out);
  check_launch();
}

}  // namespace tissue_sim
