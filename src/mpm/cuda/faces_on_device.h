// What CudaTissue keeps on the GPU for contact of tissue with tissue.
#pragma once

#include "compute/device_array.h"
#include "mpm/cuda/search_faces.h"

namespace tissue_sim {

struct FacesOnDevice {
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
  int version = -1;             ///< FaceContacts::version of the facets that are there
  bool pieces_changed = false;  ///< since they went up
  bool lists_hold = false;      ///< there are lists
  int contacts_count = 0, involved_count = 0;  ///< see CudaFaceFigures
  bool search_begun = false;                   ///< its figures are on their way
  bool searched = false;                       ///< and not looked at since
  bool may_meet = false;                       ///< whether any two may before the next search

  CudaSearchRoom search_room() {
    return {sums.data(),         static_cast<std::int32_t>(bucket_count.size()),
            bucket_begin.data(), bucket_count.data(),
            rank.data(),         sorted.data()};
  }

  std::size_t bytes() const {
    return facets.bytes() + lattices.bytes() + motion.bytes() + listed.bytes() + springs.bytes() +
           point_at.bytes() + first_near.bytes() + near_count.bytes() + near.bytes() +
           contacts.bytes() + involved.bytes() + is_involved.bytes() + takes_part.bytes() +
           nodes.bytes() + figures.bytes() + sums.bytes() + bucket_begin.bytes() +
           bucket_count.bytes() + rank.bytes() + sorted.bytes() + kept.bytes() + gathered.bytes();
  }
};

}  // namespace tissue_sim
