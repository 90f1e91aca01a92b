// The search for facets that may meet, on the GPU.
#pragma once

#include <cuda_runtime_api.h>

#include "mpm/contact/narrow_phase.h"
#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// A facet in a grid.
struct alignas(16) CudaSeeker {
  float x[3], reach;  ///< place and half size of the box that it looks around in [m]
  std::int32_t facet;
};

/// Room that a search works in.
struct CudaSearchRoom {
  double* sums;                 ///< of search_sums(facets) numbers
  std::int32_t buckets;         ///< of a hash grid, a power of two
  std::int32_t *begin, *count;  ///< per bucket: the facets in it, from `begin` on in `sorted`
  std::int32_t* rank;           ///< per facet: in its bucket
  CudaSeeker* sorted;
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

/// Copies the springs of CudaLooks::contacts.
void launch_gather_contacts(const CudaLooks& looks, int count, FaceSpring* out,
                            cudaStream_t stream);

}  // namespace tissue_sim
