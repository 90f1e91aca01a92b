// Cuts of meshes: what a blade's sweep does to triangles and tetrahedra.
#pragma once

#include <vector>

#include "cutting/blade_sweep.h"
#include "pbd/pbd_state.h"
#include "tissue_sim/cut.h"

namespace tissue_sim {
namespace pbd {

/// Where a vertex stood before: those made since stood where they are.
inline Vec3 place_before(const State& s, const std::vector<Vec3>& before, std::int32_t v) {
  return static_cast<std::size_t>(v) < before.size() ? before[v] : s.vertices.position(v);
}

/// Cuts along a blade's path, while vertices move from `before` to where they are. `stroke` is the
/// same for all that one blade does. Appends to `origin` the vertex that each new one came from.
/// Returns whether anything changed; masses (after_cut), constraints and colours (after_cuts) are
/// to be made anew then. `whole`: of each vertex, whether its piece is not cut; none: all are.
bool cut_surface(State& s, const BladePath& path, const std::vector<Vec3>& before, int stroke,
                 std::vector<std::int32_t>& origin, CutReport& report,
                 const std::vector<std::uint8_t>* whole = nullptr);
/// `smooth`: vertices move onto the blade's surface first; not for a path that goes on, for in
/// tissue that is strained what moves there may step across the edge.
bool cut_tetrahedra(State& s, const BladePath& path, const std::vector<Vec3>& before, bool smooth,
                    std::vector<std::int32_t>& origin, CutReport& report);

/// Makes State::faces, all whole.
void find_faces(State& s);
/// Parts tetrahedra at these of State::faces; as cut_tetrahedra() for the rest.
bool part_faces(State& s, const std::vector<std::int32_t>& faces, std::vector<std::int32_t>& origin,
                CutReport& report);

/// Momentum of a body's free vertices.
struct Motion {
  double mass = 0;  ///< [kg]
  Vec3 centre = Vec3::Zero(), linear = Vec3::Zero(), angular = Vec3::Zero();
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
};
/// Of each body, angular momentum about its centre of mass.
std::vector<Motion> motions(const State& s);

/// Closes the wounds of pieces that came apart (surface model) and shares out masses.
void after_cut(State& s, std::vector<std::int32_t>& origin);
/// Makes constraints and colours anew. Linear and angular momentum of each body are what they were
/// before the cuts.
void after_cuts(State& s, const std::vector<Motion>& before);

/// Closes each loop of cut edges between two pieces by a surface of triangles about as large as
/// those around (cut_caps.cpp). Returns the vertices that need internal constraints anew.
std::vector<std::int32_t> close_wounds(State& s, std::vector<std::int32_t>& origin);

/// A copy of a vertex, at the same place, with the same velocity.
int copy_vertex(State& s, int of, std::vector<std::int32_t>& origin);

}  // namespace pbd
}  // namespace tissue_sim
