// Sums over vertices and constraints, in double precision and in a fixed order.
#include <cmath>

#include "pbd/cuda/lanes_cuda.h"

namespace tissue_sim {
namespace pbd {
namespace {

constexpr int kThreads = 128;

/// The sum of what the threads of a block have, at thread 0; all threads call it.
template <class T, class Take>
__device__ __forceinline__ void reduce(T* of_thread, const T& own, const Take& take) {
  of_thread[threadIdx.x] = own;
  for (unsigned step = kThreads / 2; step > 0; step /= 2) {
    __syncthreads();
    if (threadIdx.x < step) take(of_thread[threadIdx.x], of_thread[threadIdx.x + step]);
  }
}

struct TakeFlight {
  __device__ __forceinline__ void operator()(CudaPbdFlight& a, const CudaPbdFlight& b) const {
#pragma unroll
    for (int k = 0; k < 3; ++k) {
      a.moment[k] += b.moment[k];
      a.linear[k] += b.linear[k];
      a.angular[k] += b.angular[k];
      a.second[k] += b.second[k];
      a.second[3 + k] += b.second[3 + k];
    }
    a.pushed |= b.pushed;
  }
};

__global__ void __launch_bounds__(kThreads)
    pbd_flights(CudaPbdField f, CudaPbdFlights flights, CudaPbdFlight* result) {
  __shared__ CudaPbdFlight of_thread[kThreads];
  const CudaPbdChunk chunk = flights.chunks[blockIdx.x];
  const float4 origin = f.x[chunk.first];
  CudaPbdFlight sum = {{origin.x, origin.y, origin.z}, {}, {}, {}, {}, 0};
  for (int k = chunk.begin + static_cast<int>(threadIdx.x); k < chunk.end; k += kThreads) {
    const int i = flights.order[k];
    add_to_flight(f.x[i], f.v[i], f.mass[i], f.pushed[i], sum);
  }
  reduce(of_thread, sum, TakeFlight());
  if (threadIdx.x == 0) result[blockIdx.x] = of_thread[0];
}

__global__ void __launch_bounds__(kThreads)
    pbd_change(CudaPbdField f, const std::int32_t* component, const CudaPbdChange* changes) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= f.count) return;
  const CudaPbdChange& c = changes[component[i]];
  if (c.is_free == 0) return;
  const float4 x = f.x[i];
  float4 v = f.v[i];
  const double d[3] = {x.x - c.centre[0], x.y - c.centre[1], x.z - c.centre[2]};
  const auto keep = static_cast<float>(c.keep);
  v.x = keep * v.x + static_cast<float>(c.linear[0] + (c.spin[1] * d[2] - c.spin[2] * d[1]));
  v.y = keep * v.y + static_cast<float>(c.linear[1] + (c.spin[2] * d[0] - c.spin[0] * d[2]));
  v.z = keep * v.z + static_cast<float>(c.linear[2] + (c.spin[0] * d[1] - c.spin[1] * d[0]));
  f.v[i] = v;
}

struct TakeMeasure {
  __device__ __forceinline__ void operator()(CudaPbdMeasure& a, const CudaPbdMeasure& b) const {
    a.elastic += b.elastic;
    a.kinetic += b.kinetic;
    if (!(b.speed2 <= a.speed2)) a.speed2 = b.speed2;
    a.finite &= b.finite;
  }
};

template <class Kind>
__device__ __forceinline__ void add_energy(const CudaPbdField& f, const CudaPbdSet<Kind>& set,
                                           double& sum) {
  if (set.colours == 0) return;
  const int threads = static_cast<int>(gridDim.x * blockDim.x);
  const int count = set.begin[set.colours] * kLanes;
  for (int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x); k < count; k += threads) {
    const Item<Kind> item = load_item(set.blocks, k);
    if (item.vertex[0] >= f.count) continue;  // padding
    Vertex<float> v[Kind::kVertices];
#pragma unroll
    for (int i = 0; i < Kind::kVertices; ++i) {
      const float4 at = f.x[item.vertex[i]], by = f.moved[item.vertex[i]];
      v[i] = {at.x, at.y, at.z, at.w, {by.x, by.y, by.z}};
    }
    sum += Kind::energy(v, item.number);
  }
}

__global__ void __launch_bounds__(kThreads) pbd_measure(CudaPbdField f, CudaPbdMeasure* measures) {
  __shared__ CudaPbdMeasure of_thread[kThreads];
  const int threads = static_cast<int>(gridDim.x * blockDim.x);
  CudaPbdMeasure m = {0, 0, 0, 1};
  for (int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x); i < f.count; i += threads) {
    const float4 x = f.x[i], v = f.v[i];
    const double speed2 = static_cast<double>(v.x) * v.x + static_cast<double>(v.y) * v.y +
                          static_cast<double>(v.z) * v.z;
    if (!(speed2 <= m.speed2)) m.speed2 = speed2;
    m.kinetic += 0.5 * f.mass[i] * speed2;
    m.finite &= isfinite(x.x) && isfinite(x.y) && isfinite(x.z) ? 1 : 0;
  }
  add_energy(f, f.links, m.elastic);
  add_energy(f, f.bends, m.elastic);
  add_energy(f, f.elastics, m.elastic);
  reduce(of_thread, m, TakeMeasure());
  if (threadIdx.x == 0) measures[blockIdx.x] = of_thread[0];
}

}  // namespace

void launch_pbd_flights(const CudaPbdField& field, const CudaPbdFlights& flights,
                        CudaPbdFlight* result, cudaStream_t stream) {
  if (flights.count == 0) return;
  pbd_flights<<<flights.count, kThreads, 0, stream>>>(field, flights, result);
  check_cuda(cudaGetLastError(), "sum momentum");
}

void launch_pbd_changes(const CudaPbdField& field, const std::int32_t* component,
                        const CudaPbdChange* changes, cudaStream_t stream) {
  const int blocks = (field.count + kThreads - 1) / kThreads;
  pbd_change<<<blocks, kThreads, 0, stream>>>(field, component, changes);
  check_cuda(cudaGetLastError(), "keep momentum");
}

void launch_pbd_measure(const CudaPbdField& field, CudaPbdMeasure* measures, cudaStream_t stream) {
  pbd_measure<<<kPbdMeasures, kThreads, 0, stream>>>(field, measures);
  check_cuda(cudaGetLastError(), "measure");
}

}  // namespace pbd
}  // namespace tissue_sim
