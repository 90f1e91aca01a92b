// The point that clouds are made of, in the layout of sensor_msgs/PointCloud2.
#pragma once

#include <cstddef>
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

/// What a point of a cloud can carry behind its Point, in this order, each as 4-byte floats.
enum PointField : unsigned {
  kRestPosition = 1,   ///< 3: where it was in the undeformed body [m]
  kDisplacement = 2,   ///< 3: from there [m]
  kVelocity = 4,       ///< 3: [m/s]
  kVolume = 8,         ///< 1: its share of the undeformed body [m^3]
  kStressTensor = 16,  ///< 6: Cauchy stress xx yy zz xy yz zx, without viscosity [Pa]
};

/// Which points a cloud holds, and what of each.
struct PointSelection {
  int stride = 1;             ///< every stride-th id
  bool surface_only = false;  ///< only points on the outer surface or on a cut face
  bool loose_only = false;    ///< only points of loose fragments
  unsigned fields = 0;        ///< PointFields that each carries behind its Point

  /// Bytes of one point.
  std::size_t point_size() const {
    constexpr int kFloats[] = {3, 3, 3, 1, 6};
    std::size_t size = sizeof(Point);
    for (int i = 0; i < 5; ++i) size += (fields >> i & 1) * kFloats[i] * sizeof(float);
    return size;
  }
};

}  // namespace tissue_sim
