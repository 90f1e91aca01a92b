// What the fragment network is told of a cell that may part across its largest stretch, and what
// that is made from: the features of the 2024 paper (Sung, Kim and Shin, Electronics 13:1340,
// section 2.1; in space instead of a plane), and what was found to be missing among them.
#pragma once

namespace tissue_sim {

/// Deformation gradient F (row by row) and mass, of the point's cell and of its neighbours at -x,
/// +x, -y, +y, -z, +z. Mass is a share of that of a full cell, of what unbroken bonds lead to.
/// Where they lead to nothing F is the identity.
inline constexpr int kFeatureCells = 7, kFeaturesOfCell = 10;
inline constexpr int kFeatureCount = kFeatureCells * kFeaturesOfCell;

/// From these shares of the limit's strain on, bonds count as broken when tissue is looked at for
/// regions that may come off.
inline constexpr float kRegionLevels[] = {0.4f, 0.6f, 0.8f, 1.0f};
inline constexpr int kRegionLevelCount = 4;

/// Features beside the paper's, behind its 70. Strain counts in that of the limit, lengths in
/// standard deviations of the piece's points about its centre, all in reference space.
namespace surroundings {
inline constexpr int kExcess = kFeatureCount;                ///< [7] largest strain of each cell
inline constexpr int kOther = kExcess + kFeatureCells;       ///< [2] the cell's other strains
inline constexpr int kRate = kOther + 2;                     ///< of the largest, in h / c
inline constexpr int kBrokenInside = kRate + 1;              ///< share of the bonds in the cell
inline constexpr int kBroken = kBrokenInside + 1;            ///< [6] of those to each neighbour
inline constexpr int kRegion = kBroken + kFeatureCells - 1;  ///< [4][2] its region's share of the
                                                             ///< body, and ln(1 + cells) / 4
inline constexpr int kPiece = kRegion + 2 * kRegionLevelCount;  ///< its piece's share of the body
inline constexpr int kAlongGradient = kPiece + 1;         ///< place, towards where strain is larger
inline constexpr int kAlongStretch = kAlongGradient + 1;  ///< along the stretch, the same way
inline constexpr int kFromCentre = kAlongStretch + 1;     ///< distance
inline constexpr int kSpeed = kFromCentre + 1;  ///< of its region at the second level, relative to
                                                ///< the piece, over c times the limit's strain
inline constexpr int kParting = kSpeed + 1;     ///< the part of it that leads away from the piece
inline constexpr int kEnd = kParting + 1;
}  // namespace surroundings
inline constexpr int kAllFeatureCount = surroundings::kEnd;

/// The network's: invariants, whatever the axes of the lattice and of the world. Neighbours are
/// those along the lattice's axis nearest to the largest stretch, the more strained one first, then
/// the four beside it in the same order.
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
inline constexpr int kPartingFeatureCount = parting::kEnd;

}  // namespace tissue_sim
