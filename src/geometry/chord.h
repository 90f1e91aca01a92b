// Where lines along x run within a shape: the intervals that sampling sums up.
#pragma once

#include <vector>

#include "geometry/mesh.h"
#include "tissue_sim/scene.h"

namespace tissue_sim {

/// An interval along x [m].
struct Interval {
  double begin, end;
};

/// Box of a body other than a mesh, in world axes: tight.
Box bounding_box(const Body& body);
/// Volume of a body other than a mesh [m^3].
double exact_volume(const Body& body);

/// A body other than a mesh, prepared for lines.
class Solid {
 public:
  explicit Solid(const Body& body);
  /// The interval of the line at (y, z) in world axes; false where it misses. Analytic.
  bool chord(double y, double z, Interval& interval) const;

 private:
  Shape shape_;
  Vec3 half_;  ///< half edges, semi-axes, or (radius, radius, height / 2)
  Vec3 position_;
  Eigen::Matrix3d to_local_;  ///< rotation from world to the body's axes
};

/// One sample line, or the strip that it stands for, along y or z.
struct SampleLine {
  double at;     ///< coordinate [m]
  double width;  ///< of the strip [m]
  int row;       ///< of half cells
};

/// The intervals where lines along x run inside a mesh (winding number above 0), for all lines at
/// `ys` x `zs`: entry [iz * ys.size() + iy], by rising x. `triangles` are those that can be met.
/// A line that meets edges or corners so that its crossings do not close is moved by a small share
/// of its strip, always the same way. Throws std::invalid_argument where no such line closes.
void mesh_chords(const TriangleMesh& mesh, const std::vector<int>& triangles,
                 const std::vector<SampleLine>& ys, const std::vector<SampleLine>& zs,
                 std::vector<std::vector<Interval>>& chords);

}  // namespace tissue_sim
