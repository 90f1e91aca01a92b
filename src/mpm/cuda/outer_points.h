// Where points on a GPU touch tools (CudaOuterPlace): at the true surface of their body, cuts among
// it.
#pragma once

#include <array>
#include <set>
#include <vector>

#include "mpm/anchors/anchor_faces.h"
#include "mpm/cuda/tables.h"
#include "mpm/split/lattice_tissue.h"

namespace tissue_sim {

/// The points with which this one is a sheet that is two points thick.
std::vector<std::int32_t> across_sheet(const LatticeTissue& tissue, std::int32_t point);

class OuterPoints {
 public:
  /// Of whole tissue. Throws what find_outer_places() throws.
  OuterPoints(const LatticeTissue& tissue, const AnchorFaces& faces);
  /// As the point's bonds now are.
  CudaOuterPlace of(const LatticeTissue& tissue, std::int32_t point) const;

 private:
  std::vector<OuterPlace> whole_;
  std::set<std::array<int, 4>> beside_anchors_;  ///< cells: body, x, y, z
};

/// Whether a tool of the scene is so thin (contact/surface_spring.h) that it could come between the
/// places of stretched tissue: these are taken apart for it (mpm/contact/place_parts.h). Jaws press
/// with what they find.
bool has_thin_tools(const Scene& scene);

}  // namespace tissue_sim
