// The cells around the front of a cut: docs/mpm.md, "The front".
#pragma once

#include <cstdint>

#include "tissue_sim/material.h"

namespace tissue_sim {

/// Points of one cell that see the same fields, of whose nodes some are parted ahead of the cut.
struct FrontCell {
  std::int32_t node[27];   ///< in Nodes, x fastest
  float mu[8], lambda[8];  ///< Lame parameters times volumes [J]; 0 for places that are not of it
  float viscosity[2];      ///< what it damps where nothing is parted, and where nodes are [J s]
  float stabilised;        ///< kStabilisation mu V, 0 where its points need none [J]
  float inverse_size;      ///< of the cells [1/m]
  Law law;
  std::int32_t body;
  std::int32_t first, count;  ///< of its FrontPart
};

/// A parted node as the points of a cell see it. In a cell the largest share comes first.
struct FrontPart {
  std::int32_t node;                ///< among the parted nodes
  std::int32_t k;                   ///< among the cell's 27
  float side;                       ///< its points see u + side d
  float share, step;                ///< FrontNode::share; by how much it is above the next one's
  float volume_share, volume_step;  ///< the same for the energy of volume: front_stress.h
};

/// What the cells' kernel reads: of nodes u and v, of parted nodes d and its rate.
struct FrontField {
  const float *u[3], *v[3], *d[3], *rate[3];
  const FrontPart* parts;
};

inline constexpr int kFrontForce = 4 * 28;  ///< floats of a cell's force: x, y, z, 0 of 27 nodes

}  // namespace tissue_sim
