// The line along which a blade meets a surface, edge by edge.
#pragma once

#include <functional>
#include <queue>
#include <set>
#include <vector>

#include "cutting/blade_sweep.h"
#include "pbd/surface_mesh.h"

namespace tissue_sim {
namespace pbd {

/// Follows a blade over the surface in the order of time. Where it passes an edge, that edge gets a
/// vertex, or its nearer end stands for one where it would make slivers. Vertices that the blade
/// passes one after the other share a triangle, so an edge leads from each to the next: those edges
/// are cut. So the cut is one line, however the path bends, and however many frames it takes: the
/// line's ends (State::fronts) are kept for each stroke. Where strokes meet, edges between their
/// vertices are cut if a blade passed between the triangles' centres.
class SurfaceTrace {
 public:
  SurfaceTrace(State& s, const std::vector<Vec3>& before, int stroke,
               const std::vector<SweepPart>& parts, std::vector<std::int32_t>& origin,
               const std::vector<std::uint8_t>* whole);
  void run();

  /// Edges that were cut now.
  const std::vector<Edge>& fresh() const { return fresh_; }
  bool split_any() const { return split_any_; }

 private:
  struct Passing {
    std::size_t part;
    double time;  ///< of the part, 0 to 1
    Edge edge;
    double place;  ///< from edge[0]
    Vec3 normal;   ///< of the blade's sweep, world axes
    int round;     ///< how often the edge was passed before
    bool operator>(const Passing& o) const {
      if (part != o.part) return part > o.part;
      if (time != o.time) return time > o.time;
      return edge > o.edge;
    }
  };

  Vec3 at_before(std::int32_t v) const;
  MovingSegment segment(std::int32_t a, std::int32_t b) const {
    return {at_before(a), at_before(b), s_.vertices.position(a), s_.vertices.position(b)};
  }
  void await(const Edge& e, std::size_t part, double time, int round);
  void pass(const Passing& p);
  std::int32_t vertex_at(const Passing& p, const std::vector<int>& of);
  void cut(const Edge& e);
  bool would_be_alone(int t, const Edge& last) const;
  bool is_parted_by_blades(const Edge& e, const std::vector<int>& of) const;
  void join_strokes();

  State& s_;
  const std::vector<Vec3>& before_;
  const int stroke_, old_count_;
  const std::vector<SweepPart>& parts_;
  std::vector<std::int32_t>& origin_;
  std::vector<Vec3> before_of_new_;
  EdgeMap edges_;
  std::priority_queue<Passing, std::vector<Passing>, std::greater<Passing>> queue_;
  std::vector<Edge> fresh_;
  std::set<std::int32_t> touched_;
  bool split_any_ = false;
};

}  // namespace pbd
}  // namespace tissue_sim
