// What CudaMpmTissue keeps on the GPU.
#pragma once

#include <algorithm>
#include <array>

#include "compute/cuda_event.h"
#include "compute/device_array.h"
#include "mpm/cuda/anchors_on_device.h"
#include "mpm/cuda/choose_plan.h"
#include "mpm/cuda/connect_slots.h"
#include "mpm/cuda/cuda_linearised_motion.h"
#include "mpm/cuda/cuda_mpm_tissue.h"
#include "mpm/cuda/faces_on_device.h"
#include "mpm/cuda/frame_ends.h"
#include "mpm/cuda/front_cells.h"
#include "mpm/cuda/held_points.h"
#include "mpm/cuda/label_pieces.h"
#include "mpm/cuda/make_tables.h"
#include "mpm/cuda/near_cells.h"
#include "mpm/cuda/some_nodes.h"
#include "mpm/cuda/sweep_blade.h"

namespace tissue_sim {

/// See CudaSweep.
struct SweepOnDevice {
  DeviceArray<CudaSweptEdge> edges;
  DeviceArray<CudaBlockCell> cells;
  float* places[2];  ///< at the begin and the end, in OnDevice::cloud
  DeviceArray<BrokenBond> broken;
  DeviceArray<int> count;
  PinnedArray<int> host_count;
  DeviceArray<CudaPointChange> changes;

  std::size_t bytes() const {
    return edges.bytes() + cells.bytes() + broken.bytes() + changes.bytes();
  }
};

struct CudaMpmTissue::OnDevice {
  CudaLimits limits;
  CudaShape shape, cut_shape;  ///< now, and once bonds broke
  /// Without contact, with tools, with contact of tissue too, with fronts too.
  CudaPlan plan, push_plan, touch_plan, front_plan;
  /// Thread blocks that run at once.
  int resident = 0, push_resident = 0, touch_resident = 0, front_resident = 0;
  bool may_meet = true;  ///< whether any block may meet a collider in this frame
  int current = 0;       ///< which of the two states is the present one
  cudaStream_t stream = nullptr;
  std::string gpu;  ///< name

  DeviceArray<CudaBlock> blocks;
  HostTables host_tables;  ///< as they went up
  DeviceArray<CudaBundle> bundles;
  DeviceArray<CudaColumn> columns;
  DeviceArray<CudaNearCell> near_cells;
  DeviceArray<int> near_count, unforeseen;
  DeviceArray<std::uint32_t> near_listed;   ///< CudaNearCells::listed
  DeviceArray<std::uint8_t> marks;          ///< per node: what may push it
  DeviceArray<std::uint32_t> pushed_parts;  ///< CudaTables::slot_parts with kPushed
  DeviceArray<long long> pushed, inertia;   ///< NodePushes::force and ::inertia
  DeviceArray<CudaBody> bodies;
  BlockTables of_blocks, made, spare;  ///< those that hold; of new blocks; room for the next
  DeviceArray<CudaBlockOrigin> origins;
  DeviceArray<std::int32_t> piece, place, some_nodes;
  DeviceArray<float4> packed;  ///< of some nodes: u, then v
  DeviceArray<std::uint32_t> slot_parts, parts, colour;
  DeviceArray<uint4> first_parts;
  ConnectRoom connect_room;
  PinnedArray<int> most_sharing;
  DeviceArray<float4> hold;
  DeviceArray<float4> outer, planes;  ///< CudaTables::outer, ::planes
  DeviceArray<std::uint8_t> bonds, soft, with, whole;
  int held_by = 0, place_parts = 1;  ///< CudaTables::held_by, ::place_parts
  DeviceArray<float4> u[2], v[2], force[2], u_before;
  /// In a part that is done again: where blocks and nodes went before.
  std::vector<BlockMotion> went;
  DeviceArray<float4> u_went;
  DeviceArray<Collider> colliders;
  DeviceArray<long long> loads;
  DeviceArray<CudaBox> reach;
  DeviceArray<CudaMeasure> measures;
  DeviceArray<unsigned> arrived;
  DeviceArray<StretchedPoint> stretched;
  DeviceArray<int> stretched_count;
  PinnedArray<int> host_stretched_count, host_unforeseen;
  DeviceArray<Point> cloud;
  FacesOnDevice faces;
  FrontOnDevice front;
  AnchorsOnDevice anchors;
  SweepOnDevice sweep;
  PieceLabels labels;
  CudaMotionRoom motion_room;
  /// What a part of a frame changes until something is cut or tears, as it was before the part.
  struct Checkpoint {
    DeviceArray<float4> u, v;
    DeviceArray<HeldPoint> held;
    DeviceArray<int> held_count;
    PinnedArray<int> host_held_count;
    DeviceArray<FaceSpring> springs;
    DeviceArray<CudaFaceFigures> figures;
    DeviceArray<double> impulse;       ///< AnchorFaces::impulse
    std::vector<RigidMotion> anchors;  ///< AnchorFaces::now
    std::vector<KeptContact> kept;
    bool new_facets = false;  ///< there were some without a spring yet
    double time = 0;
    float dt = 0;
    FrameResult result;
    SubstepChoice substep;  ///< run_frame()'s
    /// Room for those of `entries` of CudaTables::with that are not 0, which are few: where they
    /// are more, a part is not undone.
    static std::size_t most_held(std::size_t entries) {
      return std::min(entries, 32768 + entries / 32);
    }
    void resize(std::size_t nodes, std::size_t entries) {
      u.resize(nodes);
      v.resize(nodes);
      held.resize(most_held(entries));
      held_count.resize(1);
      host_held_count.resize(1);
    }
    std::size_t bytes() const {
      return u.bytes() + v.bytes() + held.bytes() + springs.bytes() + figures.bytes() +
             impulse.bytes();
    }
  } checkpoint;
  PinnedArray<Collider> host_colliders;
  PinnedArray<CudaBox> host_reach;
  PinnedArray<long long> host_loads;
  PinnedArray<CudaMeasure> host_measures;
  PinnedArray<Point> host_cloud;
  std::array<CudaEvent, 8> cloud_came;  ///< parts of it
  PinnedArray<float4> host_nodes;       ///< u, then v
  bool points_changed = true;           ///< pieces must be uploaded

  ~OnDevice() {
    if (stream != nullptr) cudaStreamDestroy(stream);
  }
  CudaTables tables() const {
    CudaTables t;
    t.blocks = blocks.data();
    t.bodies = bodies.data();
    t.bundles = bundles.data();
    t.columns = columns.data();
    t.block_count = static_cast<int>(blocks.size());
    t.bundle_count = static_cast<int>(bundles.size());
    t.slot_node = of_blocks.slot_node.data();
    t.slot_parts = slot_parts.data();
    t.first_parts = first_parts.data();
    t.parts = parts.data();
    t.volume = of_blocks.volume.data();
    t.point = of_blocks.point.data();
    t.partial = of_blocks.partial.data();
    t.outer = outer.size() > 0 ? outer.data() : nullptr;
    t.bonds = bonds.data();
    t.soft = soft.size() > 0 ? soft.data() : nullptr;
    t.lightness = anchors.lightness.size() > 0 ? anchors.lightness.data() : nullptr;
    t.planes = planes.size() > 0 ? planes.data() : nullptr;
    t.held_by = held_by;
    t.place_parts = place_parts;
    t.with = with.data();
    t.hold = hold.data();
    return t;
  }
  /// Those for plans that push.
  CudaTables pushed_tables() const {
    CudaTables t = tables();
    t.slot_parts = pushed_parts.data();
    return t;
  }
  /// Nodes, and parted ones behind them.
  std::size_t entries() const { return u[0].size(); }
  /// How far from the points of a cell its surface may be [cells].
  double surface_reach() const { return outer.size() > 0 ? 0.5 : 0; }
  CudaNodes nodes(int which) const { return {u[which].data(), v[which].data()}; }
  CudaNodes present() const { return nodes(current); }
};

}  // namespace tissue_sim
