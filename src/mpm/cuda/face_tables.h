// What the GPU's kernels see of contact of tissue with tissue (mpm/contact/face_contact.h): plain
// structs with device pointers.
#pragma once

#include <cstddef>
#include <cstdint>

#include "compute/host_device.h"
#include "mpm/contact/face_search.h"
#include "mpm/contact/face_spring.h"
#include "mpm/surface/facet_in_world.h"

namespace tissue_sim {

/// Bit of CudaTables::slot_parts for a node that contact may push.
inline constexpr std::uint32_t kPushed = 1u << 31;

/// What may push a node: facets, colliders, the front of a cut.
inline constexpr std::uint8_t kMarkedByFaces = 1, kMarkedByTools = 2, kMarkedByFront = 4;

/// A facet and where it is found.
struct CudaFacet {
  Facet facet;
  std::int32_t slot;          ///< of the lowest of its cell's nodes: CudaTables::slot_node
  std::int32_t pitch, plane;  ///< slots from a node to the next along y and z
  std::int32_t body;          ///< its lattice: a CudaLattice
  std::int16_t cell[3];       ///< in its lattice
  std::int16_t site[3];       ///< of its point [half cells]
  PieceSize piece;            ///< that it is of
  float friction;             ///< Coulomb's
  double modulus;             ///< of P-waves [Pa]
};

/// The lattice of a body.
struct CudaLattice {
  double origin[3];  ///< reference place of the middle of cell (0, 0, 0) [m]
  double cell_size;  ///< [m]
  std::int32_t sites_x, sites_y;
  std::size_t first_site;  ///< in CudaLooks::point_at
};

/// Figures of the search and of the looks; speeds and lengths that are never negative as the bits
/// of a float, whose order is theirs.
struct CudaFaceFigures {
  unsigned box[6];           ///< SweptBox of what does not fly: -min, max as in_order() [m]
  double mean_moved[3];      ///< of the facets that take part, since they were listed [m]
  double mean_velocity[3];   ///< of the same [m/s]
  double horizon;            ///< until the next search [s]
  double until_look;         ///< as of the last substep [s]
  float since_look;          ///< the same
  float dt;                  ///< of the last substep [s]
  unsigned fastest;          ///< facet against the mean [m/s]
  unsigned largest_reach;    ///< [m]
  unsigned meeting;          ///< rate_of_meeting() of the first two of the lists [1/s]
  unsigned fastest_pair[2];  ///< of looks in turn [m/s]
  int next_pair;             ///< which of them the next look takes
  int listed_anew;           ///< whether the lists no longer held
  int in_grid;               ///< facets there
  int near;                  ///< places wanted in CudaLooks::near
  int contacts, involved;    ///< facets with any in their list; these, and those in lists
  TISSUE_SIM_FIELDS(box, mean_moved, mean_velocity, horizon, until_look, since_look, dt, fastest,
                    largest_reach, meeting, fastest_pair, next_pair, listed_anew, in_grid, near,
                    contacts, involved)
};

/// Where a contact gets its displacements from and gives its force to.
struct CudaContactNodes {
  std::int32_t own[27];    ///< nodes of the facet's cell, x fastest
  std::int32_t other[27];  ///< nodes of the cell of the place held
  float weight[27];        ///< of `own`, at the facet's centre
  TISSUE_SIM_FIELDS(own, other, weight)
};

/// What the search and the looks work on. A contact has the number of its facet.
struct CudaLooks {
  int facet_count;
  float per_cell;    ///< [1/m]
  double cell_size;  ///< the scene's, and of all lattices [m]
  const CudaFacet* facets;
  const CudaLattice* lattices;
  const std::int32_t* point_at;           ///< [2 nz][2 ny][2 nx], -1: none, by bodies; or null
  const std::uint8_t* bonds;              ///< per point
  const std::int32_t* slot_node;          ///< CudaTables::slot_node
  FacetMotion* motion;                    ///< per facet; up to date where a contact needs it
  ListedFacet* listed;                    ///< per facet
  FaceSpring* springs;                    ///< per facet
  std::int32_t *first_near, *near_count;  ///< per facet: the facets that it may touch, in `near`
  std::int32_t* near;                     ///< each list in order
  std::size_t near_capacity;
  std::uint8_t *is_involved, *takes_part;  ///< per facet: is in a list; in the search
  std::int32_t *contacts, *involved;       ///< facets, in any order
  CudaContactNodes* nodes;                 ///< parallels `contacts`
  std::uint8_t* marks;                     ///< per node: what may push it
  std::size_t node_count;
  const std::uint32_t* slot_parts;  ///< CudaTables::slot_parts without
  std::uint32_t* pushed_parts;      ///< and with kPushed
  std::size_t slot_count;
  CudaFaceFigures* figures;
};

/// Contacts of tissue with tissue of the substeps of one launch.
struct CudaFaces {
  int look_first;          ///< they were just searched
  int contacts, involved;  ///< see CudaFaceFigures
  int ranks;               ///< of the bundles that thread blocks begin with: CudaBundle::rank
  CudaLooks looks;
};

}  // namespace tissue_sim
