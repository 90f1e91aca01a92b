// Edges of a surface near a cut, and triangles that are split at them.
#pragma once

#include <algorithm>
#include <array>
#include <map>
#include <vector>

#include "pbd/pbd_state.h"

namespace tissue_sim {
namespace pbd {

using Edge = std::array<std::int32_t, 2>;  ///< lower vertex first
inline Edge edge_of(std::int32_t a, std::int32_t b) { return {std::min(a, b), std::max(a, b)}; }

/// Triangles of each edge, of some of the surface's triangles.
class EdgeMap {
 public:
  EdgeMap(const State& s, const std::vector<int>& triangles) : s_(s) {
    for (const int t : triangles) add(t);
  }
  void add(int t) {
    const Triangle& c = s_.triangles[t];
    for (int i = 0; i < 3; ++i) edges_[edge_of(c[i], c[(i + 1) % 3])].push_back(t);
  }
  void remove(int t) {
    const Triangle& c = s_.triangles[t];
    for (int i = 0; i < 3; ++i) {
      std::vector<int>& of = edges_[edge_of(c[i], c[(i + 1) % 3])];
      of.erase(std::find(of.begin(), of.end(), t));
    }
  }
  const std::map<Edge, std::vector<int>>& all() const { return edges_; }
  std::vector<int> of(const Edge& e) const {
    const auto at = edges_.find(e);
    return at == edges_.end() ? std::vector<int>() : at->second;
  }

 private:
  const State& s_;
  std::map<Edge, std::vector<int>> edges_;
};

/// Smallest angle of a triangle [rad]; 0 where it has no area.
double smallest_angle(const Vec3& a, const Vec3& b, const Vec3& c);

/// Whether a new vertex may be put on the edge at `place` (0 to 1, from e[0]): it keeps off the
/// edge's ends and makes no triangle thinner than a few degrees (surface_trace.cpp says which).
bool may_split(const State& s, const Edge& e, double place, const std::vector<int>& of);

/// Puts a vertex on the edge and splits its triangles, which `edges` follows. Appends to `origin`
/// the nearer end. Returns the vertex.
std::int32_t split_edge(State& s, EdgeMap& edges, const Edge& e, double place,
                        std::vector<std::int32_t>& origin);

}  // namespace pbd
}  // namespace tissue_sim
