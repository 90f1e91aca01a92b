// Anchors that hold nodes of the lattice, and act at their faces all the same: for a GPU.
//
// Nodes that are held up to one of them clamp a body as a wall a quarter of a cell before that node
// would. So the nodes are held up to the first that puts this wall at an anchor's face or outside
// of it, and the three layers of points around it are made so soft that they yield by what of the
// tissue is missing: a number for each column of cells, found from the equations of a column under
// uniform stress. Frequencies only fall. No node is moved by hand, no kernel is another.
#pragma once

#include "mpm/lattice_tissue.h"

namespace tissue_sim {

/// Of points that yield for `missing` cells of tissue (0 to 1), the share of the stiffness: from
/// the balance of the nodes of a row of cells, one of them held, whose points on both sides of that
/// node and the next one outwards are softer; a fit within 2e-5.
inline double yielding_share(double missing) {
  return 1 / (1 + missing * (0.76814 + missing * (0.02231 - missing * 0.00168)));
}

/// Widens Points::anchored to what holds these nodes, and fills Points::yielding. Before the nodes
/// get their masses. Throws what find_face_links() throws.
void soften_at_faces(const Scene& scene, LatticeTissue& tissue);

}  // namespace tissue_sim
