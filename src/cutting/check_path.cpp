// Paths of blades that make no sense are refused before anything moves.
#include <cmath>
#include <stdexcept>
#include <string>

#include "cutting/blade_sweep.h"
#include "tissue_sim/cut.h"
#include "tools/pose_fault.h"

namespace tissue_sim {
namespace {

constexpr double kMostSwept = 1e5;  // edges of a cut, see swept_edges()

}  // namespace

void check_path(const BladePath& path) {
  if (path.poses.size() < 2) {
    throw std::invalid_argument("a cut needs at least 2 poses, got " +
                                std::to_string(path.poses.size()));
  }
  if (path.edge.size() < 2) {
    throw std::invalid_argument("a blade's edge needs at least 2 points, got " +
                                std::to_string(path.edge.size()));
  }
  if (!path.edge_at_end.empty() && path.edge_at_end.size() != path.edge.size()) {
    throw std::invalid_argument("a blade's edge has " + std::to_string(path.edge.size()) +
                                " points, and " + std::to_string(path.edge_at_end.size()) +
                                " at the end of its path");
  }
  std::vector<Vec3> places = path.edge;
  places.insert(places.end(), path.edge_at_end.begin(), path.edge_at_end.end());
  for (const Vec3& x : places) {
    if (!x.allFinite()) throw std::invalid_argument("a point of the blade's edge is not finite");
    if (!(x.cwiseAbs().maxCoeff() <= kFarthestPlace)) {
      throw std::invalid_argument("a point of the blade's edge is more than 1e6 m away");
    }
  }
  for (const Pose& pose : path.poses) check_pose(pose, "a pose of the blade");
  const double product =
      (static_cast<double>(path.edge.size()) - 1) * (static_cast<double>(path.poses.size()) - 1);
  if (const double swept = product > kMostSwept ? product : swept_edges(path); swept > kMostSwept) {
    throw std::invalid_argument(
        "the cut sweeps " + std::to_string(std::lround(swept)) +
        " edges (pieces of the blade's edge times steps of its path, each turned by less than 4 "
        "degrees), at most 100000 are done: give fewer points of the edge or poses");
  }
}

}  // namespace tissue_sim
