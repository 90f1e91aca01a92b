// What CudaMpmTissue keeps on the GPU.
#pragma once

#include "compute/device_array.h"
#include "mpm/cuda/choose_plan.h"
#include "mpm/cuda/cuda_mpm_tissue.h"
#include "mpm/cuda/frame_ends.h"
#include "mpm/cuda/make_tables.h"

namespace tissue_sim {

struct CudaMpmTissue::OnDevice {
  CudaShape shape;
  CudaPlan plan;
  int resident = 0;  ///< thread blocks that run at once
  int current = 0;   ///< which of the two states is the present one
  cudaStream_t stream = nullptr;
  std::string gpu;  ///< name

  DeviceArray<CudaBlock> blocks;
  DeviceArray<CudaBody> bodies;
  DeviceArray<std::int32_t> slot_node, point, piece, place;
  DeviceArray<std::uint32_t> slot_parts, parts, near, colour;
  DeviceArray<float> volume, partial, hold;
  DeviceArray<std::uint8_t> bonds, with, whole;
  DeviceArray<float4> u[2], v[2], force[2], u_before;
  DeviceArray<Collider> colliders;
  DeviceArray<long long> loads;
  DeviceArray<CudaBox> reach;
  DeviceArray<CudaMeasure> measures;
  DeviceArray<unsigned> arrived;
  DeviceArray<StretchedPoint> stretched;
  DeviceArray<int> stretched_count;
  PinnedArray<int> host_stretched_count;
  DeviceArray<Point> cloud;
  PinnedArray<Collider> host_colliders;
  PinnedArray<CudaBox> host_reach;
  PinnedArray<long long> host_loads;
  PinnedArray<CudaMeasure> host_measures;
  PinnedArray<Point> host_cloud;
  PinnedArray<float4> host_nodes;  ///< u, then v
  bool points_changed = true;      ///< bonds and pieces must be uploaded

  ~OnDevice() {
    if (stream != nullptr) cudaStreamDestroy(stream);
  }
  CudaTables tables() const {
    CudaTables t;
    t.blocks = blocks.data();
    t.bodies = bodies.data();
    t.block_count = static_cast<int>(blocks.size());
    t.slot_node = slot_node.data();
    t.slot_parts = slot_parts.data();
    t.parts = parts.data();
    t.volume = volume.data();
    t.point = point.data();
    t.partial = partial.data();
    t.bonds = bonds.data();
    t.near = near.data();
    t.with = with.data();
    t.hold = hold.data();
    return t;
  }
  CudaNodes nodes(int which) const { return {u[which].data(), v[which].data()}; }
  CudaNodes present() const { return nodes(current); }
};

}  // namespace tissue_sim
