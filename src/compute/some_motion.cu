#include "compute/for_each_cuda.h"
#include "compute/some_motion.h"

namespace tissue_sim {
namespace {

struct Gather {
  MotionOnGpu from;
  const std::int32_t* list;
  int count;
  float4* packed;
  __device__ void operator()(int i) const {
    packed[i] = from.u[list[i]];
    packed[count + i] = from.v[list[i]];
  }
};

struct Scatter {
  const float4* packed;
  const std::int32_t* list;
  int count;
  MotionOnGpu to, and_to;
  __device__ void operator()(int i) const {
    const float4 u = packed[i], v = packed[count + i];
    to.u[list[i]] = and_to.u[list[i]] = u;
    to.v[list[i]] = and_to.v[list[i]] = v;
  }
};

}  // namespace

void SomeMotion::list(const std::vector<std::int32_t>& nodes, cudaStream_t stream) {
  if (listed_ == nodes) return;
  listed_ = nodes;
  list_.upload(listed_, stream);
}

float4* SomeMotion::room(std::size_t nodes, cudaStream_t stream) {
  if (2 * nodes > motion_.size()) {  // what is sent may be under way
    check_cuda(cudaStreamSynchronize(stream), "receive data");
  }
  motion_.resize(2 * nodes);
  return motion_.data();
}

const float4* SomeMotion::bring(const MotionOnGpu& from, const std::vector<std::int32_t>& nodes,
                                cudaStream_t stream) {
  const int count = static_cast<int>(nodes.size());
  list(nodes, stream);
  float4* const packed = room(nodes.size(), stream);
  Gpu gpu(stream);
  gpu.for_each(count, Gather{from, list_.data(), count, packed});
  gpu.wait();
  return packed;
}

void SomeMotion::send(const std::vector<std::int32_t>& nodes, const MotionOnGpu& to,
                      const MotionOnGpu& and_to, cudaStream_t stream) {
  const int count = static_cast<int>(nodes.size());
  list(nodes, stream);
  Gpu(stream).for_each(count, Scatter{motion_.data(), list_.data(), count, to, and_to});
}

}  // namespace tissue_sim
