// What RViz shows besides the clouds: tools, forces, pieces.
#pragma once

#include <visualization_msgs/Marker.h>
#include <visualization_msgs/MarkerArray.h>

#include <string>
#include <vector>

#include "tissue_sim/scene.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

struct MarkerInput {
  const Scene& scene;
  const std::vector<ToolMotion>& tools;
  const std::vector<ToolLoad>& loads;
  Span<const Fragment> fragments;
  std::string frame;  ///< the world's
  ros::Time stamp;
  double force_scale;  ///< [m/N]
};

/// The tissue's surface as a list of triangles, in the colours of its pieces' points. Without
/// triangles a marker that deletes itself. The header is left to the caller.
visualization_msgs::Marker to_marker(const SurfaceTriangles& surface,
                                     Span<const Fragment> fragments);

/// Makes the markers of one frame after another: what is gone is deleted.
class Markers {
 public:
  visualization_msgs::MarkerArray make(const MarkerInput& input);

 private:
  bool first_ = true;
  int fragments_shown_ = 0;
};

}  // namespace tissue_sim
