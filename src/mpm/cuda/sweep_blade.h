// A blade's sweep through tissue that lives on a GPU.
#pragma once

#include "cutting/edge_passes.h"
#include "mpm/cuda/tables.h"
#include "mpm/lattice/bonds.h"

namespace tissue_sim {

/// An edge of a part of a path, and the share of the path's time that the part spans.
struct CudaSweptEdge {
  SweptEdgeOf<Vector3> edge;
  double begin, end;
};

/// Where a block is: its lowest cell, in its body's lattice, and which that is.
struct CudaBlockCell {
  std::int32_t x, y, z, lattice;
};

struct CudaSweep {
  const CudaSweptEdge* edges;
  int edge_count;
  double reach;  ///< bonds of points within this from what an edge sweeps are looked at [m]
  const CudaBlockCell* cells;  ///< per block
  const CudaLattice* lattices;
  const std::int32_t* point_at;  ///< as in CudaLooks
  const float *begin, *end;      ///< places of the points at both times, [points][3] [m]
  const float4* u;               ///< displacements at the end
  BrokenBond* broken;
  int* broken_count;  ///< may become more than there is room for
  int room;           ///< of `broken`
};

/// Lists the bonds that edges pass while the tissue moves from one of these places to the other.
void launch_sweep(const CudaTables& tables, const CudaSweep& sweep, cudaStream_t stream);

/// What cuts change of a point.
struct CudaPointChange {
  std::int32_t point;
  std::uint8_t bonds, soft, whole;  ///< `whole`: no bond of its broke
  CudaOuterPlace outer;
};
/// What is changed so, per point: see CudaTables.
struct CudaChangedPoints {
  std::uint8_t *bonds, *soft;  ///< `soft` is null where no point is soft, ...
  float* lightness;            ///< ... and this where all are as heavy as their neighbours
  float4 *outer, *planes;      ///< null where no tool touches points, or none that is thin
  float* area;
  std::uint8_t* with;  ///< `held` for each: where it is touched elsewhere, contact begins anew
  int held;
};
void launch_change_points(const CudaPointChange* changes, int count, const CudaChangedPoints& of,
                          cudaStream_t stream);

}  // namespace tissue_sim
