// The nodes of the meshless method: where they are in reference space, and what each stands for.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "compute/array.h"
#include "geometry/near_gaps.h"
#include "tissue_sim/scene.h"

namespace tissue_sim {

/// Nodes of all bodies, body after body.
struct MlsNodes {
  std::vector<Vec3> place;             ///< reference [m]
  Array<float> volume;                 ///< its share of the body: all that is nearest to it [m^3]
  Array<float> free_volume;            ///< of that, what lies outside of anchors (mls/anchors.h)
  Array<float> strained_volume;        ///< of that, what bears strain (mls/own_rate.h)
  std::vector<std::int16_t> body;      ///< index into Scene::bodies
  std::vector<std::int32_t> part;      ///< PlacedNode::part
  std::vector<std::uint8_t> material;  ///< index into `materials`
  Array<std::uint8_t> anchored;        ///< lies in an anchored region
  std::vector<std::int16_t> anchor;    ///< that holds it, in the order of the scene; -1: none
  std::vector<std::uint8_t> surface;   ///< its share reaches the surface of the body
  std::vector<float> depth;            ///< of those at the surface, below it; 0 of all others [m]
  std::vector<Vec3> normal;            ///< of the surface there, outward; 0 where unknown
  std::vector<Material> materials;     ///< of all bodies and inclusions
  std::vector<NearGaps> gaps;          ///< of each body
  std::vector<std::array<std::int32_t, 2>> mesh_edges;  ///< of tetrahedral meshes, each once

  std::int32_t count() const { return static_cast<std::int32_t>(place.size()); }
  const Material& material_of(std::int32_t node) const { return materials[material[node]]; }
};

/// Spacing of nodes, of graded ones at the surface [m].
double mls_spacing(const Scene& scene);

/// Of each body whose nodes are given, the spacing of as many even ones; 0 of the others [m].
std::vector<double> usual_spacings(const MlsNodes& nodes);

/// Places the nodes of a valid scene. The shares add up to each body's volume. Throws
/// std::invalid_argument where a body cannot be sampled or a region holds no node of its body.
MlsNodes make_mls_nodes(const Scene& scene, std::vector<std::string>* notes);

}  // namespace tissue_sim
