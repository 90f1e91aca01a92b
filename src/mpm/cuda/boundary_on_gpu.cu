#include <utility>

#include "compute/fixed_sum.h"
#include "compute/for_each_cuda.h"
#include "mpm/cuda/boundary_on_gpu.h"

namespace tissue_sim {
namespace {

struct PlaceVertex {
  CudaNodes nodes;
  const BoundaryMesh::Vertex* vertices;
  float* places;
  __device__ void operator()(int i) const {
    const BoundaryMesh::Vertex& v = vertices[i];
    const AxisWeights weights(v.place);
    double x[3];
    for (int a = 0; a < 3; ++a) x[a] = reinterpret_cast<const double*>(&v.rest)[a];
    for (int k = 0; k < 27; ++k) {
      const float4 u = nodes.u[v.node[k]];
      const float w = weights.at(k);
      x[0] += w * u.x, x[1] += w * u.y, x[2] += w * u.z;
    }
    for (int a = 0; a < 3; ++a) places[3 * i + a] = static_cast<float>(x[a]);
  }
};

struct PlaceCorners {
  const int4* faces;
  const float* places;
  float* corners;
  __device__ void operator()(int i) const {
    const int4 f = faces[i / 2];
    const int v[3] = {f.x, i % 2 == 0 ? f.y : f.z, i % 2 == 0 ? f.z : f.w};
    for (int k = 0; k < 9; ++k)
      corners[9 * static_cast<std::size_t>(i) + k] = places[3 * v[k / 3] + k % 3];
  }
};

struct PushVertices {
  const std::int32_t *corner_begin, *corner;
  const float* impulses;
  unsigned long long* pushed;
  __device__ void operator()(int i) const {
    float sum[3] = {};
    for (std::int32_t e = corner_begin[i]; e < corner_begin[i + 1]; ++e) {
      const float* of = impulses + 3 * static_cast<std::size_t>(corner[e] / 3);
      for (int a = 0; a < 3; ++a) sum[a] += of[a];
    }
    for (int a = 0; a < 3; ++a) {
      pushed[3 * static_cast<std::size_t>(i) + a] = 0;
      add_fixed(pushed + 3 * static_cast<std::size_t>(i) + a, sum[a], kImpulseUnit);
    }
  }
};

struct TakeWeak {
  const BoundaryMesh::Support::Weak* weak;
  unsigned long long *pushed, *left;
  __device__ void operator()(int i) const {
    unsigned long long* const of =
        pushed + 3 * static_cast<std::size_t>(weak[i / 3].vertex) + i % 3;
    left[i] = *of;
    *of = 0;
  }
};

/// A round of pass_on(), of which `left` is nothing after; the last: what is left stays.
struct PassOn {
  const BoundaryMesh::Support::Weak* weak;
  const BoundaryMesh::Support::Neighbour* around;
  const std::int32_t* weak_of;
  unsigned long long *left, *next, *pushed;
  bool is_last;
  __device__ void operator()(int i) const {
    const BoundaryMesh::Support::Weak& w = weak[i / 3];
    const int a = i % 3;
    if (left[i] == 0) return;
    const double all = from_fixed(left[i], kImpulseUnit);
    left[i] = 0;
    add_fixed(pushed + 3 * static_cast<std::size_t>(w.vertex) + a, is_last ? all : w.takes * all,
              kImpulseUnit);
    if (is_last) return;
    for (std::int32_t e = w.begin; e < w.end; ++e) {
      const std::int32_t v = around[e].vertex, other = weak_of[v];
      unsigned long long* const to = other < 0 ? pushed + 3 * static_cast<std::size_t>(v)
                                               : next + 3 * static_cast<std::size_t>(other);
      add_fixed(to + a, (1 - w.takes) * around[e].share * all, kImpulseUnit);
    }
  }
};

struct PushNodes {
  const std::int32_t *node, *begin, *vertex;
  const float* share;
  const unsigned long long* pushed;
  CudaNodes nodes, others;
  __device__ void operator()(int n) const {
    float sum[3] = {};
    for (std::int32_t e = begin[n]; e < begin[n + 1]; ++e) {
      const unsigned long long* of = pushed + 3 * static_cast<std::size_t>(vertex[e]);
      for (int a = 0; a < 3; ++a)
        sum[a] += share[e] * static_cast<float>(from_fixed(of[a], kImpulseUnit));
    }
    float4 v = nodes.v[node[n]];
    v.x += v.w * sum[0], v.y += v.w * sum[1], v.z += v.w * sum[2];
    nodes.v[node[n]] = others.v[node[n]] = v;
  }
};

}  // namespace

void launch_boundary_places(const CudaNodes& nodes, const BoundaryMesh::Vertex* vertices, int count,
                            float* places, cudaStream_t stream) {
  Gpu(stream).for_each(count, PlaceVertex{nodes, vertices, places});
}

void launch_boundary_corners(const BoundaryOnGpu& of, cudaStream_t stream) {
  Gpu(stream).for_each(static_cast<int>(2 * of.faces.size()),
                       PlaceCorners{of.faces.data(), of.places.data(), of.corners.data()});
}

void launch_push_boundary(const BoundaryOnGpu& of, const float* impulses, const CudaNodes& nodes,
                          const CudaNodes& others, cudaStream_t stream) {
  constexpr int kRounds = 6;  // as pass_on() does
  const Gpu gpu(stream);
  gpu.for_each(static_cast<int>(of.vertices.size()),
               PushVertices{of.corner_begin.data(), of.corner.data(), impulses, of.pushed.data()});
  const auto weak = static_cast<int>(3 * of.weak.size());
  if (weak > 0) {
    unsigned long long *left = of.left.data(), *next = of.next.data();
    gpu.for_each(weak, TakeWeak{of.weak.data(), of.pushed.data(), left});
    check_cuda(cudaMemsetAsync(next, 0, weak * sizeof *next, stream), "clear memory");
    for (int round = 0; round <= kRounds; ++round) {
      gpu.for_each(weak, PassOn{of.weak.data(), of.around.data(), of.weak_of.data(), left, next,
                                of.pushed.data(), round == kRounds});
      std::swap(left, next);
    }
  }
  gpu.for_each(static_cast<int>(of.node.size()),
               PushNodes{of.node.data(), of.begin.data(), of.vertex.data(), of.share.data(),
                         of.pushed.data(), nodes, others});
}

}  // namespace tissue_sim
