// What is told of a cell that may part across its largest stretch: invariants, whatever the axes of
// the lattice and of the world.
#pragma once

#include "mpm/fragment_features.h"

namespace tissue_sim {

/// Strain counts in that of the limit, as in fragments/features.h. Neighbours are those along the
/// lattice's axis nearest to the stretch, the more strained one first, then the four beside it in
/// the same order.
namespace parting {
inline constexpr int kExcess = 0;                  ///< largest strain, as the neighbours' below
inline constexpr int kOther = 1;                   ///< [2] the cell's other strains
inline constexpr int kRate = 3;                    ///< of the largest, in h / c
inline constexpr int kBrokenInside = 4;            ///< share of the bonds in the cell
inline constexpr int kAlong = 5;                   ///< [2] excess, 0 where there is no neighbour
inline constexpr int kBrokenAlong = kAlong + 2;    ///< [2] share of the bonds that lead there
inline constexpr int kBeside = kBrokenAlong + 2;   ///< [4] excess
inline constexpr int kBrokenBeside = kBeside + 4;  ///< [4]
inline constexpr int kThere = kBrokenBeside + 4;   ///< [2] share of the neighbours that are there
inline constexpr int kAround = kThere + 2;         ///< [14] surroundings::kRegion to kParting
inline constexpr int kTearLength = kAround + 14;   ///< in cells
inline constexpr int kLimit = kTearLength + 1;     ///< strain that it bears
inline constexpr int kAligned = kLimit + 1;        ///< cosine of the stretch and the axis, squared
inline constexpr int kEnd = kAligned + 1;
}  // namespace parting

/// Fills x[parting::kEnd] of a point's cell. Returns the axis (0 x, 1 y, 2 z) nearest to the
/// largest stretch.
int parting_features(const MpmState& state, const Pieces& pieces,
                     const FragmentSurroundings& around, std::int32_t point, float* x);

}  // namespace tissue_sim
