// What the fragment network is told of a point (Sung, Kim and Shin, Electronics 13:1340, 2024,
// section 2.1; in space instead of a plane).
#pragma once

namespace tissue_sim {

/// Deformation gradient F (row by row) and mass, of the point's cell and of its neighbours at -x,
/// +x, -y, +y, -z, +z. Mass is a share of that of a full cell, of what unbroken bonds lead to.
/// Where they lead to nothing F is the identity.
inline constexpr int kFeatureCells = 7, kFeaturesOfCell = 10;
inline constexpr int kFeatureCount = kFeatureCells * kFeaturesOfCell;

}  // namespace tissue_sim
