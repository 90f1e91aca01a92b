// The bodies of a scene on their lattices: which point sits where, and which node is whose.
#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>
#include <vector>

#include "compute/array.h"
#include "geometry/lattice.h"
#include "tissue_sim/scene.h"

namespace tissue_sim {

/// Where a blade went through a bond.
struct Crossing {
  float place;      ///< along the bond, 0 at its lower-numbered point to 1
  float normal[3];  ///< of the cut in reference space, unit, to either side
};

/// Points of all bodies, numbered body after body in the order of Lattice::sites.
struct Points {
  struct Site {
    std::int16_t x, y, z;  ///< half cells of the body's lattice
    std::int16_t body;
  };
  Array<Site> site;
  Array<float> volume;        ///< [m^3]
  Array<std::uint8_t> bonds;  ///< bit k: still bound to the neighbour of bond k (cutting/bonds.h)
  Array<std::uint8_t> anchored;  ///< lies in an anchored region
  Array<std::uint8_t> material;  ///< in LatticeBody::materials; empty where no body has inclusions
  /// Of bonds that blades broke, by crossing_key(); a bond that tore has none.
  std::unordered_map<std::int64_t, Crossing> crossings;
  int size() const { return static_cast<int>(site.size()); }
  /// Number of a point's material among those of its body.
  int material_of(std::int32_t point) const { return material.empty() ? 0 : material[point]; }
};

/// Key of the forward bond of a point along an axis (0 x, 1 y, 2 z).
inline std::int64_t crossing_key(std::int32_t point, int axis) {
  return 3 * std::int64_t{point} + axis;
}

struct LatticeBody {
  Body body;
  std::vector<Material> materials;  ///< that its points are of: its own and its inclusions'
  Vec3 origin = Vec3::Zero();       ///< lowest corner of cell (0, 0, 0) [m]
  double cell_size = 0;
  int nx = 0, ny = 0, nz = 0;  ///< cells
  int first_node = 0;          ///< of its lattice nodes in Nodes; cell (0,0,0) has node (1,1,1)
  int pitch_y = 0, pitch_z = 0;
  int first_point = 0, point_count = 0;
  std::vector<std::int32_t> point_at;  ///< [2 nz][2 ny][2 nx], point number or -1

  const Material& material_of(const Points& points, std::int32_t point) const {
    return materials[points.material_of(point)];
  }
  int node_count() const { return pitch_z * (nz + 2); }
  /// Point at a site, -1 where there is none or outside.
  int point(int x, int y, int z) const {
    if (x < 0 || y < 0 || z < 0 || x >= 2 * nx || y >= 2 * ny || z >= 2 * nz) return -1;
    return point_at[(static_cast<std::size_t>(z) * 2 * ny + y) * 2 * nx + x];
  }
  /// Lattice node of cell (x, y, z), -1 .. n each.
  int node(int x, int y, int z) const {
    return first_node + (z + 1) * pitch_z + (y + 1) * pitch_y + x + 1;
  }
  Vec3 node_position(int x, int y, int z) const {
    return origin + cell_size * Vec3(x + 0.5, y + 0.5, z + 0.5);
  }
  Vec3 site_position(int x, int y, int z) const {
    return origin + 0.5 * cell_size * Vec3(x + 0.5, y + 0.5, z + 0.5);
  }
};

/// Nodes of all bodies' lattices; higher numbers are fields that cuts made.
inline int lattice_node_count(const std::vector<LatticeBody>& bodies) {
  return bodies.back().first_node + bodies.back().node_count();
}

/// Puts the bodies of a scene on their lattices and fills `points`, all bonds whole. Throws
/// std::invalid_argument (a mesh that cannot be used, an anchor that holds nothing, ...).
std::vector<LatticeBody> make_lattice_bodies(const Scene& scene, Points& points,
                                             std::vector<std::string>* notes);

/// Points around lattice node (x, y, z) of `body` in the order of a 6 x 6 x 6 box, -1 where none:
/// those whose stencils hold the node.
void points_around(const LatticeBody& body, int x, int y, int z, std::int32_t (&around)[216]);

/// Weight of node `k` (0..26: x fastest) of the point's stencil.
float site_weight(const Points::Site& site, int k);

/// The bonds of a point while the tissue is whole.
std::uint8_t whole_bonds(const LatticeBody& body, const Points::Site& site);

}  // namespace tissue_sim
