// What tissue shows of itself, from the nodes on the host: what a cloud's points carry behind their
// Point, and its surface.
#pragma once

#include <cstdint>
#include <vector>

#include "fragments/pieces.h"
#include "mpm/mpm_state.h"
#include "tissue_sim/point.h"

namespace tissue_sim {

/// Where a point is that an anchor holds, whatever nodes beside it do [m]. False for others.
bool held_place(const MpmState& state, std::int32_t point, Vec3& place);

/// Makes room for the selection's fields in a cloud of Points, and fills them: `place` is where in
/// the cloud each point goes, -1 for none (select_points()).
void add_point_fields(MpmState& state, const PointSelection& selection,
                      const std::vector<std::int32_t>& place, int count,
                      std::vector<std::uint8_t>& cloud);

/// Replaces `surface` with the tissue's (mpm/surface/boundary_mesh.h), from the nodes on the host.
void read_surface(MpmState& state, const Pieces& pieces, SurfaceTriangles& surface);
/// Impulses on the corners of what it read last [N s] become velocity of the nodes.
void push_surface(MpmState& state, Span<const float> impulses);

/// Fills centroid (of the mass), velocity and box of all pieces.
void measure_pieces(MpmState& state, Pieces& pieces);

}  // namespace tissue_sim
