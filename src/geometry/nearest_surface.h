// The place on a body's true surface that is nearest to another place.
#pragma once

#include <memory>
#include <vector>

#include "geometry/mesh.h"
#include "tissue_sim/scene.h"

namespace tissue_sim {

struct SurfacePoint {
  Vec3 place;   ///< [m], world axes, as the body is at rest
  Vec3 normal;  ///< unit, outward
};

/// Nearest place of a triangle to p.
Vec3 on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c);

/// Prepared for many places that lie near the surface.
class NearestSurface {
 public:
  /// `reach`: how far from the surface places will be at most [m]. Throws what load_solid() throws.
  NearestSurface(const Body& body, double reach);
  ~NearestSurface();
  /// False where no surface is within reach (meshes alone say so). Of faces equally near, the one
  /// that looks along `towards` counts.
  bool find(const Vec3& x, const Vec3& towards, SurfacePoint& found) const;

 private:
  class Triangles;
  Body body_;
  Eigen::Matrix3d to_local_;
  std::unique_ptr<Triangles> triangles_;
};

}  // namespace tissue_sim
