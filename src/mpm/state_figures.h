// Figures that a state has, the same for all devices, and what it shows of itself from the nodes on
// the host.
#pragma once

#include <cstdint>
#include <vector>

#include "fragments/pieces.h"
#include "frame/put_faces.h"
#include "mpm/mpm_state.h"
#include "tissue_sim/point.h"

namespace tissue_sim {

/// How much tissue stiffened as it deformed: for each material of each body the largest of
/// BlockState's, and after them the largest ||F||^2 of the body's points.
using Stiffening = std::vector<std::vector<float>>;

/// The same for all.
Stiffening even_stiffening(const MpmState& state, float stiffening);

/// The largest such `damping` of all materials, as they are deformed and however they are cut
/// [1/s].
double fastest_damping(const MpmState& state, const Stiffening& stiffening);

/// The substep that is stable however the tissue is cut, by the scene's CFL number [s].
float stable_substep(const MpmState& state, const Stiffening& stiffening);

/// Whether a bond bridge or a bit of debris may be ill-conditioned, as of
/// MpmState::worst_stiffening: mpm/tear/debris.h.
bool may_be_ill_conditioned(const MpmState& state);

/// Hash of nodes, bonds and pieces.
std::uint64_t checksum(const MpmState& state, const Pieces& pieces);

/// Sums over the nodes, in double.
Momentum momentum(const MpmState& state);

/// Where a point is that an anchor holds, whatever nodes beside it do [m]. False for others.
bool held_place(const MpmState& state, std::int32_t point, Vec3& place);

/// Makes room for the selection's fields in a cloud of Points, and fills them: `place` is where in
/// the cloud each point goes, -1 for none (select_points()).
void add_point_fields(MpmState& state, const PointSelection& selection,
                      const std::vector<std::int32_t>& place, int count,
                      std::vector<std::uint8_t>& cloud);

/// Sets BoundaryMesh::now: where anchors hold a vertex, else what of_nodes(i) says of vertex i [m].
template <class F>
void place_boundary(MpmState& s, const F& of_nodes) {
  BoundaryMesh& mesh = s.boundary;
  constexpr int kGrain = 256;
  const auto vertices = static_cast<int>(mesh.vertices.size());
  mesh.now.resize(vertices);
  s.cpu->for_each(
      vertices,
      [&](int i) {
        const BoundaryMesh::Vertex& v = mesh.vertices[i];
        if (s.points.free_volume_of(v.point) > 0) {
          mesh.now[i] = of_nodes(i);
          return;
        }
        const std::int32_t body = s.points.site[v.point].body;
        mesh.now[i] = floats(
            s.anchors.moves ? s.anchors.place_of_held(s.bodies[body].body, body, v.rest) : v.rest);
      },
      kGrain);
}
/// From the nodes on the host.
void place_boundary(MpmState& state);
/// Tissue::push_surface().
void push_surface(MpmState& state, Span<const float> impulses);

/// Fills centroid (of the mass), velocity and box of all pieces.
void measure_pieces(MpmState& state, Pieces& pieces);

}  // namespace tissue_sim
