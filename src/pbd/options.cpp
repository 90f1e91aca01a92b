#include "pbd/options.h"

namespace tissue_sim {
namespace {

constexpr Spelling<PbdModel> kPbdModels[] = {{PbdModel::kSurface, "surface"},
                                             {PbdModel::kTetrahedra, "tetrahedra"}};
constexpr Spelling<PbdElasticity> kPbdElasticities[] = {{PbdElasticity::kMaterial, "material"},
                                                        {PbdElasticity::kStrain, "strain"}};

std::vector<Option> list_pbd(OptionSets& options) {
  PbdOptions& pbd = options.pbd;
  return {choice("model", "what a body is made of", pbd.model, kPbdModels),
          choice("elasticity",
                 "of tetrahedra: by the material's E and ν, or stretch and shear of strain alone",
                 pbd.elasticity, kPbdElasticities),
          {"steps", "of a frame", nullptr, &pbd.steps, 1, 1000, "",
           "as many as tetrahedra of a material need, and else 20"},
          {"iterations", "of a step", nullptr, &pbd.iterations, 1, 100},
          {"edge", "stiffness of edges over what E gives them, of surfaces and of `strain`",
           &pbd.edge, nullptr, 0, 1e6},
          {"bending", "the same between neighbouring triangles", &pbd.bending, nullptr, 0, 1e6},
          {"internal", "the same of links through the inside of surfaces", &pbd.internal, nullptr,
           0, 1e6},
          {"stretch", "`strain`: share of an error of strain that a projection takes away",
           &pbd.stretch, nullptr, 0, 1},
          {"shear", "the same of shear", &pbd.shear, nullptr, 0, 1}};
}

// Its steps are as many as it is asked for.
Spacing pbd_spacing(const Scene& scene) { return {0, "cell_size", scene.cell_size}; }

}  // namespace

const MethodOptions kPbdOptions = {
    Method::kPbd, list_pbd, pbd_spacing, false, 0, 0, [](const Body&) { return true; }};

}  // namespace tissue_sim
