// Where points on a GPU touch tools: at the true surface of their body.
#pragma once

#include <vector_types.h>

#include <vector>

#include "mpm/anchors/anchor_faces.h"
#include "mpm/split/lattice_tissue.h"

namespace tissue_sim {

inline constexpr int kSoftPlace = 16;  ///< more than a point has bonds

/// Of each point, while the bodies are whole.
struct OuterPoints {
  /// At which colliders touch it, in cells from the middle of its cell, as long as it has the
  /// number of bonds that is the fourth figure: where it lost one it is touched itself. 0 for a
  /// point that has neighbours all around. Where the body's surface is flat around the point that
  /// is straight before it, at an edge on the edge: the point's place is brought onto the surface
  /// that each of its missing bonds stands for (mpm/surface/surface_places.h). The fourth figure is
  /// larger by kSoftPlace where `faces` of anchors hold nodes of the point's cell: the spring there
  /// is the point's, which needs no inerter, for faces are held as if nodes had none.
  std::vector<float4> place;
  /// What of the surface its places stand for that look one way, that which has most [m^2].
  std::vector<float> area;
  /// The plane of the surface there: its axis in the fourth figure, -1 where the place stays whole,
  /// and the normal, 1 along that. Along it places of points are next to one another.
  std::vector<float4> plane;
};
/// Throws what find_outer_places() throws.
OuterPoints outer_points(const LatticeTissue& tissue, const AnchorFaces& faces);

/// Whether a tool of the scene is so thin (contact/surface_spring.h) that it could come between the
/// places of stretched tissue: these are taken apart for it (mpm/contact/place_parts.h). Jaws press
/// with what they find.
bool has_thin_tools(const Scene& scene);

}  // namespace tissue_sim
