// The points of the clouds tissue/points and fragments/points, for the Point Cloud Library:
//   pcl::PointCloud<tissue_sim::PclPoint> cloud;
//   pcl::fromROSMsg(message, cloud);
// To be included before PCL's algorithms, which then compile for this type, too. Nothing else of
// this package needs PCL.
#pragma once

#ifndef PCL_NO_PRECOMPILE
#define PCL_NO_PRECOMPILE
#endif
#include <pcl/point_types.h>
#include <pcl/register_point_struct.h>

#include <cstdint>

namespace tissue_sim {

/// A Point in PCL's layout.
struct EIGEN_ALIGN16 PclPoint {
  PCL_ADD_POINT4D;        ///< x, y, z [m], in the cloud's frame
  PCL_ADD_RGB;            ///< colour of its fragment
  std::uint32_t id;       ///< of the material point, for ever
  std::int32_t fragment;  ///< Fragment::id
  float stress;           ///< von Mises, of the Cauchy stress [Pa]
  float damage;           ///< share of its bonds that are broken [0, 1]
  EIGEN_MAKE_ALIGNED_OPERATOR_NEW
};

}  // namespace tissue_sim

POINT_CLOUD_REGISTER_POINT_STRUCT(tissue_sim::PclPoint,
                                  (float, x, x)(float, y, y)(float, z, z)(float, rgb, rgb)(
                                      std::uint32_t, id,
                                      id)(std::int32_t, fragment,
                                          fragment)(float, stress, stress)(float, damage, damage))
