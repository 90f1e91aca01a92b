// What CudaTissue keeps on the GPU of anchors that hold tissue at their faces.
#pragma once

#include <functional>
#include <vector>

#include "compute/device_array.h"
#include "mpm/anchors/anchor_faces.h"
#include "mpm/cuda/hold_still.h"
#include "mpm/cuda/make_tables.h"

namespace tissue_sim {

struct AnchorsOnDevice {
  HostFaceRows made;
  std::vector<std::int32_t> held_points;  ///< that have no volume outside of anchors
  DeviceArray<CudaFaceChunk> chunks;
  DeviceArray<CudaHeldNode> held;
  DeviceArray<int> first_held, first_carried;
  DeviceArray<CudaFaceEntry> entries;
  DeviceArray<CudaFaceShare> shares;
  DeviceArray<CudaFaceRow> rows;
  DeviceArray<CudaCarriedNode> carried;
  DeviceArray<CudaRowGroup> groups;
  DeviceArray<CudaRowNodes> row_nodes;
  DeviceArray<float> inverse, room;
  DeviceArray<double> impulse;          ///< of AnchorFaces::rows since the frame began [N s]
  DeviceArray<CudaAnchorPlace> places;  ///< of a part of a frame; empty where all stay in it
  DeviceArray<float4> pull;             ///< the same
  DeviceArray<float> lightness;         ///< Points::lightness, 1 where a bond broke
  std::size_t room_each = 0;
  bool carries_always = false;

  std::size_t bytes() const {
    return held.bytes() + first_held.bytes() + pull.bytes() + first_carried.bytes() +
           chunks.bytes() + entries.bytes() + shares.bytes() + rows.bytes() + carried.bytes() +
           groups.bytes() + row_nodes.bytes() + inverse.bytes() + room.bytes() + impulse.bytes() +
           places.bytes() + lightness.bytes();
  }
  /// What the kernels need, but for the drift; `substep` of the part is the first.
  CudaHeldFaces view(int substep, int anchors) const {
    CudaHeldFaces h;
    if (chunks.size() == 0) return h;
    h.first_carried = first_carried.data();
    h.chunks = chunks.data();
    h.held = held.data();
    h.first_held = first_held.data();
    h.entries = entries.data();
    h.shares = shares.data();
    h.rows = rows.data();
    h.carried = carried.data();
    h.inverse = inverse.data();
    h.impulse = impulse.data();
    h.places = places.size() > 0 ? places.data() + substep * anchors : nullptr;
    h.pull = pull.size() > 0 ? pull.data() + 4 * substep * anchors : nullptr;
    h.carries_always = carries_always;
    h.anchors = anchors;
    h.room = room.data();
    h.room_each = room_each;
    return h;
  }
  /// CudaLinearisedMotion::Hold
  std::function<void(float4*)> hold_still(cudaStream_t stream) const {
    if (groups.size() == 0) return {};
    return [this, stream](float4* field) {
      launch_hold_still(groups.data(), static_cast<int>(groups.size()), row_nodes.data(),
                        inverse.data(), field, stream);
    };
  }
};

}  // namespace tissue_sim
