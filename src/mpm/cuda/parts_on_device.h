// What CudaTissue keeps on the GPU for contact with tools and of tissue with tissue, for anchors
// that hold tissue at their faces, and for fronts of cuts.
#pragma once

#include <array>
#include <functional>
#include <set>
#include <vector>

#include "compute/device_array.h"
#include "mpm/anchors/anchor_faces.h"
#include "mpm/contact/touching_tissue.h"
#include "mpm/cuda/block_tables.h"
#include "mpm/cuda/choose_plan.h"
#include "mpm/cuda/make_tables.h"
#include "mpm/cuda/near_cells.h"
#include "mpm/cuda/search_faces.h"
#include "mpm/cuda/state_on_host.h"
#include "mpm/cuda/tables.h"
#include "mpm/split/lattice_tissue.h"

namespace tissue_sim {

/// The points with which this one is a sheet that is two points thick.
std::vector<std::int32_t> across_sheet(const LatticeTissue& tissue, std::int32_t point);

class OuterPoints {
 public:
  /// Of whole tissue. Throws what find_outer_places() throws.
  OuterPoints(const LatticeTissue& tissue, const AnchorFaces& faces);
  /// As the point's bonds now are.
  CudaOuterPlace of(const LatticeTissue& tissue, std::int32_t point) const;

 private:
  std::vector<OuterPlace> whole_;
  std::set<std::array<int, 4>> beside_anchors_;  ///< cells: body, x, y, z
};

/// Whether a tool of the scene is so thin (contact/surface_spring.h) that it could come between the
/// places of stretched tissue: these are taken apart for it (mpm/contact/place_parts.h). Jaws press
/// with what they find.
bool has_thin_tools(const Scene& scene);

struct FacesOnDevice : FacesState {
  /// See CudaLooks.
  DeviceArray<CudaFacet> facets;
  DeviceArray<CudaLattice> lattices;
  DeviceArray<FacetMotion> motion;
  DeviceArray<ListedFacet> listed;
  DeviceArray<FaceSpring> springs;
  DeviceArray<std::int32_t> point_at, first_near, near_count, near, contacts, involved;
  DeviceArray<std::uint8_t> is_involved, takes_part;
  DeviceArray<CudaContactNodes> nodes;
  DeviceArray<CudaFaceFigures> figures;
  PinnedArray<CudaFaceFigures> host_figures;  ///< as of the last search
  /// See CudaSearchRoom.
  DeviceArray<double> sums;
  DeviceArray<std::int32_t> bucket_begin, bucket_count, rank;
  DeviceArray<CudaSeeker> sorted;

  DeviceArray<CudaFaces> of_launch;
  DeviceArray<KeptContact> kept;
  DeviceArray<FaceSpring> gathered;
  PinnedArray<CudaFacet> host_facets;
  bool search_begun = false;  ///< its figures are on their way

  CudaSearchRoom search_room() {
    return {sums.data(),         static_cast<std::int32_t>(bucket_count.size()),
            bucket_begin.data(), bucket_count.data(),
            rank.data(),         sorted.data()};
  }
};

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

/// Parted nodes and the cells that see them: mpm/split/front.h.
struct FrontOnDevice {
  DeviceArray<FrontCell> cells;
  DeviceArray<FrontPart> parts;
  DeviceArray<int4> tasks;     ///< CudaFront::tasks
  DeviceArray<double> energy;  ///< of the cells, then of the motion of parted nodes [J]
  PinnedArray<double> host_energy;
  DeviceArray<float4> motion_fields;  ///< CudaMotionRoom::fields, where `pushed` is no room
  int first_node = 0, node_count = 0;
  bool marked = false;  ///< whether CudaTables::slot_parts say which nodes it pushes

  CudaFront view() const {
    return {static_cast<int>(cells.size()), node_count,  first_node, cells.data(), parts.data(),
            static_cast<int>(tasks.size()), tasks.data()};
  }
};

template <class Archive>
void fields(Archive& archive, CudaShape& s) {
  BlockShape& b = s.blocks;
  archive(b.x, b.y, b.z, b.uniform, b.has_rows, b.room, s.threads, s.small);
}

}  // namespace tissue_sim
