// The search for facets that may meet, on the GPU.
#pragma once

#include <cuda_runtime_api.h>

#include "contact/look_at_face.h"
#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// Room that a search works in.
struct CudaSearchRoom {
  double* sums;         ///< of search_sums(facets) numbers
  float4* reach;        ///< per facet: place and how far it reaches [m]
  std::int32_t* far;    ///< facets that reach far
  std::int32_t* heads;  ///< [buckets], a power of two: of the facets in each
  std::int32_t* next;   ///< per facet: another in its bucket, -1 if none
  std::int32_t buckets;
};
std::size_t search_sums(int facet_count);

/// Puts contacts without any other facet in place of all.
void launch_fresh_contacts(const CudaLooks& looks, cudaStream_t stream);

/// Brings the motion of all facets up to date and finds out when the next search is due, and
/// whether the lists hold until then; not if they have to be made `anew`. Then makes the lists.
void launch_search(const CudaLooks& looks, const CudaNodes& state, const CudaSearchRoom& room,
                   bool anew, cudaStream_t stream);

/// Makes the lists that launch_search() could not for want of places in CudaLooks::near.
void launch_lists(const CudaLooks& looks, const CudaSearchRoom& room, cudaStream_t stream);

/// Lets contacts go on from what was kept of them, sorted; substeps have `dt` seconds.
void launch_take_up(const CudaLooks& looks, const CudaNodes& state, const KeptContact* kept,
                    int kept_count, int contact_count, float dt, cudaStream_t stream);

/// Copies the active contacts, in any order.
void launch_gather_active(const CudaLooks& looks, int count, FaceSpring* out, cudaStream_t stream);

}  // namespace tissue_sim
