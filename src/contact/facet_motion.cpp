#include "contact/facet_motion.h"

namespace tissue_sim {

void deformation_gradient_at(const Array<float>* u, const CellNodes& nodes, double cell_size,
                             const float (&place)[3], float (&F)[9]) {
  deformation_gradient(CellField{u, nodes}, cell_size, place, F);
}

Vec3 reference_place(const LatticeBody& body, const Block& block, int cell,
                     const float (&place)[3]) {
  const int z = cell / block.plane, y = cell % block.plane / block.pitch,
            x = cell % block.plane % block.pitch;
  return body.node_position(block.x + x, block.y + y, block.z + z) +
         body.cell_size * Vec3(place[0], place[1], place[2]);
}

FacetMotion facet_motion(const LatticeBody& body, const Block& block, const Facet& facet,
                         const Nodes& nodes) {
  const CellNodes cell(block, facet.cell);
  const Vec3 place = reference_place(body, block, facet.cell, facet.center);
  return facet_motion(facet, {place[0], place[1], place[2]}, body.cell_size,
                      CellField{nodes.u, cell}, CellField{nodes.v, cell});
}

}  // namespace tissue_sim
