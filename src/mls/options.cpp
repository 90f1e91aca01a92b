#include "mls/options.h"

#include "geometry/tet_mesh.h"

namespace tissue_sim {
namespace {

constexpr Spelling<MlsPlacement> kMlsPlacements[] = {{MlsPlacement::kRegular, "regular"},
                                                     {MlsPlacement::kGraded, "graded"}};
constexpr Spelling<MlsContact> kMlsContacts[] = {{MlsContact::kNodes, "nodes"},
                                                 {MlsContact::kFaces, "faces"}};

std::vector<Option> list_mls(OptionSets& options) {
  MlsOptions& mls = options.mls;
  return {
      {"spacing", "between nodes, of graded ones at the surface", &mls.spacing, nullptr, 1e-5, 1,
       "m", "half a cell"},
      {"neighbours", "that a node has within a regular lattice: sets the supports", nullptr,
       &mls.neighbours, 14, 60},
      choice("placement", "of nodes: on a lattice, or dense at the surface and sparse inside",
             mls.placement, kMlsPlacements),
      {"grading", "spacing of graded nodes deep inside over that at the surface", &mls.grading,
       nullptr, 1, 4},
      {"stabilisation", "stiffness of what is not linear in a support, times E", &mls.stabilisation,
       nullptr, 0, 1},
      choice("contact",
             "of tissue with tissue: nodes push one another along the line between them, without "
             "friction; faces touch along their common normal, with friction",
             mls.contact, kMlsContacts)};
}

Spacing spacing_of_mls(const Scene& scene) {
  const double spacing = scene.mls.spacing;
  if (spacing > 0) return {2 * spacing, "mls.spacing", spacing};
  return {scene.cell_size, "cell_size", scene.cell_size};
}

bool moves_mesh(const Body& body) { return is_tet_file(body.mesh); }

}  // namespace

const MethodOptions kMlsOptions = {Method::kMls, list_mls, spacing_of_mls, false, 2, 0, moves_mesh};

}  // namespace tissue_sim
