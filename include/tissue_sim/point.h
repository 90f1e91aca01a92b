// The point that clouds are made of, in the layout of sensor_msgs/PointCloud2.
#pragma once

#include <cstdint>

namespace tissue_sim {

/// One material point as it stands in a cloud: 32 bytes, little endian.
struct Point {
  float x, y, z;          ///< [m], world frame
  std::uint32_t rgb;      ///< 0x00RRGGBB, PCL's packing
  std::uint32_t id;       ///< of the material point, for ever
  std::int32_t fragment;  ///< Fragment::id
  float stress;           ///< von Mises, of the Cauchy stress [Pa]
  float damage;           ///< share of its bonds that are broken [0, 1]
};
static_assert(sizeof(Point) == 32, "the layout that read_points() and PointCloud2 promise");

/// Which points a cloud holds.
struct PointSelection {
  int stride = 1;             ///< every stride-th id
  bool surface_only = false;  ///< only points on the outer surface or on a cut face
  bool loose_only = false;    ///< only points of loose fragments
};

}  // namespace tissue_sim
