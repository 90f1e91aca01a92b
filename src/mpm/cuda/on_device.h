// Tissue on the GPU, and what is done with it.
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "compute/cuda_event.h"
#include "compute/device_array.h"
#include "compute/lent_points.h"
#include "mpm/cuda/block_tables.h"
#include "mpm/cuda/boundary_on_gpu.h"
#include "mpm/cuda/choose_plan.h"
#include "mpm/cuda/cuda_linearised_motion.h"
#include "mpm/cuda/frame_ends.h"
#include "mpm/cuda/label_pieces.h"
#include "mpm/cuda/make_tables.h"
#include "mpm/cuda/near_cells.h"
#include "mpm/cuda/parts_on_device.h"
#include "mpm/cuda/sweep_blade.h"
#include "mpm/device.h"

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
};

/// Nodes and contacts live here; lattice, bonds, blocks and pieces on the host too (`run`), where
/// nodes around a cut are taken apart between frames.
struct CudaTissue final : MpmDevice, DistantNodes {
  const std::size_t others_hold = device_bytes_held;  ///< before this tissue had any

  /// Throws std::runtime_error where there is no GPU, or not enough memory on it.
  CudaTissue(const Scene& scene, MpmRun& of);
  ~CudaTissue() override;
  CudaTissue(const CudaTissue&) = delete;
  CudaTissue& operator=(const CudaTissue&) = delete;

  std::string name() const override;
  NodeRange node_range() const override { return NodeRange::kBox; }
  void begin() override;
  void begun() override;
  unsigned measure(unsigned what) override;
  double measure_limit(const std::vector<std::uint8_t>& blocks, int steps) override;
  void begin_frame(const FrameInput& input, bool move) override;
  void begin_rest() override;
  void save_motion() override;
  int run_part(const FramePart& part) override;
  unsigned measure_part(unsigned what) override;
  bool missed_contact() override { return has_missed; }
  bool can_restore_motion() const override;
  void restore_motion(bool missed) override;
  void end_frame() override;
  void sweep(const std::vector<BladePath>& paths, bool moves, std::vector<std::int32_t>& changed,
             std::vector<std::int32_t>& touched, CutReport& report) override;
  void before_parting(const std::vector<std::int32_t>& points) override;
  void parted(const std::vector<std::int32_t>& points, const Apart& apart) override;
  std::vector<int> label_pieces() override;
  bool labels_by_bonds_alone() const override { return false; }
  void bring_nodes(const std::vector<std::int32_t>& points) override;
  void send_nodes() override;
  void bring_all_nodes() override;
  void bring_motion(const std::vector<std::int32_t>& nodes) override;
  void bring_motion_around(const std::vector<EdgePlace>& places) override;
  void send_velocities(const std::vector<std::int32_t>& nodes) override;
  void place_boundary() override;
  GpuSurface place_boundary_on_gpu() override;
  void push_boundary_on_gpu(const float* impulses) override;
  std::vector<StrainedPoint> strained() override;
  int read_points(const PointSelection& selection, std::vector<std::uint8_t>& cloud) override;
  GpuPoints read_points_on_gpu(const PointSelection& selection) override;
  void save(ArchiveWriter& archive) override;
  void restore(ArchiveReader& archive) override;
  void restored() override;

  MpmRun& run;
  MpmState& state;
  Pieces& pieces;
  FrameResult& result;
  FramePart part;       ///< that was run last, ...
  int loads_of = 0;     ///< ... so many substeps of it, as long as their loads are not summed, ...
  float dt_before = 0;  ///< ... and the substep before it [s]
  std::vector<std::vector<ColliderLoad>> edge_loads;  ///< of blades' edges in those; or empty
  std::vector<std::int32_t> brought;  ///< nodes that the host has as they are, but for its changes
  int nodes_before = 0;               ///< that there were before_parting()
  CudaLimits limits;
  CudaShape shape, cut_shape;  ///< now, and once bonds broke
  /// Which contact kernels know, each besides that of all before it.
  enum Way { kAlone, kWithTools, kWithTissue, kWithFronts, kWays };
  CudaPlan plans[kWays];
  CudaPlan& plan = plans[kAlone];
  bool may_meet = true;  ///< whether any block may meet a collider in this frame
  int current = 0;       ///< which of the two states is the present one
  cudaStream_t stream = nullptr;
  std::string gpu;  ///< name

  DeviceArray<CudaBlock> blocks;
  HostTables host_tables;  ///< as they went up
  DeviceArray<CudaBundle> bundles;
  DeviceArray<CudaColumn> columns;
  DeviceArray<CudaNearCell> near_cells;
  DeviceArray<int> near_count, any_missed;
  DeviceArray<std::uint32_t> near_listed;   ///< CudaNearCells::listed
  DeviceArray<std::uint8_t> marks;          ///< per node: what may push it
  DeviceArray<std::uint32_t> pushed_parts;  ///< CudaTables::slot_parts with kPushed
  DeviceArray<long long> pushed, inertia;   ///< NodePushes::force and ::inertia
  DeviceArray<CudaBody> bodies;
  BlockTables of_blocks, made, spare;  ///< those that hold; of new blocks; room for the next
  DeviceArray<CudaBlockOrigin> origins;
  DeviceArray<std::int32_t> piece, place;
  SomeMotion some;  ///< u and mass, v and inverse mass
  DeviceArray<std::uint32_t> slot_parts, parts, colour;
  DeviceArray<uint4> first_parts;
  ConnectRoom connect_room;
  PinnedArray<int> most_sharing;
  DeviceArray<float4> hold;
  DeviceArray<float4> outer, planes;  ///< CudaTables::outer, ::planes
  DeviceArray<float> area;            ///< CudaTables::area
  DeviceArray<std::uint8_t> bonds, soft, with, whole;
  int held_by = 0, place_parts = 1;         ///< CudaTables::held_by, ::place_parts
  std::optional<OuterPoints> outer_points;  ///< once it is begun, where colliders touch points
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
  PinnedArray<int> host_stretched_count, host_missed;
  DeviceArray<Point> cloud;
  DeviceArray<AnchoredPoint> anchored_points;  ///< of the cloud that is written
  LentPoints lent;
  FacesOnDevice faces;
  FrontOnDevice front;
  AnchorsOnDevice anchors;
  SweepOnDevice blade;
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
    std::vector<EdgeHold> edges;
    bool new_facets = false;  ///< there were some without a spring yet
    double time = 0;
    float dt = 0;
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
  } checkpoint;
  PinnedArray<Collider> host_colliders;
  PinnedArray<CudaBox> host_reach;
  PinnedArray<long long> host_loads;
  PinnedArray<CudaMeasure> host_measures;
  PinnedArray<Point> host_cloud;
  std::array<CudaEvent, 8> cloud_came;  ///< parts of it
  PinnedArray<float4> host_nodes;       ///< u, then v
  BoundaryOnGpu boundary;
  bool points_changed = true;  ///< pieces must be uploaded
  bool has_missed = false;     ///< missed_contact()
  std::unique_ptr<StateOnHost> to_restore;
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
    t.outer = outer.data();
    t.area = area.data();
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
  /// The share of the frame at the end of the part's substep `i`.
  double share_of(int i) const { return part.substeps.share(i + 1, part.from, part.to); }
  /// Nodes, and parted ones behind them.
  std::size_t entries() const { return u[0].size(); }
  CudaNodes nodes(int which) const { return {u[which].data(), v[which].data()}; }
  CudaNodes present() const { return nodes(current); }
};

// Blocks, and the tables for them.
/// With BlockShape::room.
void make_blocks(CudaTissue& tissue, const CudaShape& shape, int room);
void divide_anew(CudaTissue& tissue, int room);  ///< into blocks for what is cut
void make_room_for_cuts(CudaTissue& tissue);     ///< makes blocks anew that are good for whole
                                                 ///< tissue alone
void push_tables(CudaTissue& tissue);            ///< of blocks that are new; those that stay move
                                                 ///< on the GPU
void push(CudaTissue& tissue);                   ///< everything but contacts

// Nodes.
void pull_nodes(CudaTissue& tissue);
void push_nodes(CudaTissue& tissue);
/// The nodes that a cut of these points may change, or looks at.
std::vector<std::int32_t> nodes_around(const CudaTissue& tissue,
                                       const std::vector<std::int32_t>& points);
void pull_some(CudaTissue& tissue, const std::vector<std::int32_t>& nodes);
void push_some(CudaTissue& tissue, const std::vector<std::int32_t>& nodes);

// The front of a cut.
void pull_front(
    CudaTissue& tissue);  ///< how far parted nodes are apart; the host has the same ones
void push_front(CudaTissue& tissue);  ///< that the host has, behind the nodes, which are all there
inline bool has_front(const CudaTissue& tissue) { return tissue.front.node_count > 0; }
/// The kernels for a launch in which tissue touches tissue, or does not. Those of fronts alone take
/// places apart for thin tools, for the others to keep their registers.
inline CudaTissue::Way way_of(const CudaTissue& tissue, bool touches) {
  if (has_front(tissue) || (tissue.may_meet && tissue.place_parts > 1)) {
    return CudaTissue::kWithFronts;
  }
  if (touches) return CudaTissue::kWithTissue;
  return tissue.may_meet ? CudaTissue::kWithTools : CudaTissue::kAlone;
}
NodePushes clear_pushes(CudaTissue& tissue);  ///< for a launch that pushes; slots know which nodes
                                              ///< a front does
/// As that of mpm/split/front.h.
void pass_rim(CudaTissue& tissue, const BladePath& path, bool moves,
              const std::vector<std::int32_t>& broken, std::vector<std::int32_t>& touched);
void push_points(CudaTissue& tissue, const std::vector<std::int32_t>& changed);  ///< their bonds,
                                                                                 ///< whether soft,
                                                                                 ///< their places
void push_outer_points(CudaTissue& tissue);                                      ///< of all

// Anchors.
void push_anchors(CudaTissue& tissue);  ///< rows that their faces hold: after push_tables(), or
                                        ///< where nodes split
void push_lightness(CudaTissue& tissue);
void pull_impulses(CudaTissue& tissue);            ///< AnchorFaces::impulse
void upload_anchor_places(CudaTissue& tissue);     ///< of a part
void leave_anchors(CudaTissue& tissue, int done);  ///< where they are after so many substeps of it
/// What anchors hold, in a cloud: `index` of each point, or each of `stride` where it is empty.
/// Enqueues.
void put_anchored_points(CudaTissue& tissue, const std::vector<std::int32_t>& index, int stride,
                         Point* cloud);

// Contact with tools.
void find_near(CudaTissue& tissue);        ///< lists the cells that they may meet
void look_for_missed(CudaTissue& tissue);  ///< enqueues what missed_contact() tells then
/// Whether tissue has come to a collider that find_near() did not foresee, for it went faster
/// later.
bool missed_contact(const CudaTissue& tissue);

// Contact of tissue with tissue.
void upload_lattices(CudaTissue& tissue);
void upload_sites(CudaTissue& tissue);   ///< which point is where in the lattices
void upload_facets(CudaTissue& tissue);  ///< where there are new ones, or pieces
void send_facets(CudaTissue& tissue);
void make_room_for_facets(CudaTissue& tissue);
void begin_contacts(CudaTissue& tissue);  ///< all anew; until any facets may touch, they take no
                                          ///< memory
CudaLooks looks_of(const CudaTissue& tissue);
/// Begins the search that the next substep would have to wait for, at the end of a frame whose
/// figures are waited for anyway.
void search_ahead(CudaTissue& tissue);
/// Takes the figures that came, and says when the next search is due: FaceContacts::until_search.
void finish_search(CudaTissue& tissue, float dt);
void search_anew(CudaTissue& tissue);                  ///< before the next substep
const CudaFaces* faces_of_launch(CudaTissue& tissue);  ///< null where there are no contacts
void pull_contacts(CudaTissue& tissue);
void bring_faces(const CudaTissue& tissue, FacesOnHost& to);
void send_faces(CudaTissue& tissue, const FacesOnHost& from);

// Frames.
/// Enqueues the part's substeps from `begin` up to `end`; waits for a search of faces that comes
/// due among them.
void run_substeps(CudaTissue& tissue, int begin, int end);
void launch(CudaTissue& tissue, int begin, int end, float dt);
void launch_measure(CudaTissue& tissue);
void finish_measure(CudaTissue& tissue);
/// Points whose strain is at least `share` of what their body's weakest material bears.
std::vector<StretchedPoint> list_stretched(CudaTissue& tissue, float share);

}  // namespace tissue_sim
