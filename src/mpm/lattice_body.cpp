#include "mpm/lattice_body.h"

#include <algorithm>
#include <stdexcept>

#include "cutting/bonds.h"
#include "math/bspline.h"

namespace tissue_sim {
namespace {

void check_size(const Lattice& lattice, const std::string& name) {
  const double nodes = double(lattice.nx + 2) * (lattice.ny + 2) * (lattice.nz + 2);
  if (nodes > 5e8 || lattice.nx > 16000 || lattice.ny > 16000 || lattice.nz > 16000) {
    throw std::invalid_argument("body '" + name + "' needs " + std::to_string(lattice.nx) + " x " +
                                std::to_string(lattice.ny) + " x " + std::to_string(lattice.nz) +
                                " cells: more than 5e8, raise cell_size");
  }
}

}  // namespace

std::uint8_t whole_bonds(const LatticeBody& b, const Points::Site& s) {
  unsigned bonds = 0;
  for (int k = 0; k < kBondCount; ++k) {
    const BondOffset o = bond_offset(k);
    if (b.point(s.x + o.x, s.y + o.y, s.z + o.z) >= 0) bonds |= 1u << k;
  }
  return static_cast<std::uint8_t>(bonds);
}

std::vector<LatticeBody> make_lattice_bodies(const Scene& scene, Points& points,
                                             std::vector<std::string>* notes) {
  std::vector<LatticeBody> bodies;
  int first_node = 0;
  for (const Body& body : scene.bodies) {
    const Lattice lattice = make_lattice(body, scene.cell_size, notes);
    check_size(lattice, body.name);
    LatticeBody b;
    b.body = body;
    b.material = find_material(scene, body.material);
    b.origin = lattice.origin;
    b.cell_size = lattice.cell_size;
    b.nx = lattice.nx;
    b.ny = lattice.ny;
    b.nz = lattice.nz;
    b.pitch_y = b.nx + 2;
    b.pitch_z = b.pitch_y * (b.ny + 2);
    b.first_node = first_node;
    first_node += b.node_count();
    b.first_point = points.size();
    b.point_count = static_cast<int>(lattice.sites.size());
    b.point_at.assign(static_cast<std::size_t>(8) * b.nx * b.ny * b.nz, -1);
    const auto index = static_cast<std::int16_t>(bodies.size());
    std::vector<int> anchored(body.anchors.size(), 0);
    for (const Lattice::Site& s : lattice.sites) {
      b.point_at[(static_cast<std::size_t>(s.z) * 2 * b.ny + s.y) * 2 * b.nx + s.x] = points.size();
      points.site.push_back({static_cast<std::int16_t>(s.x), static_cast<std::int16_t>(s.y),
                             static_cast<std::int16_t>(s.z), index});
      points.volume.push_back(s.volume);
      std::uint8_t held = 0;
      for (std::size_t r = 0; r < body.anchors.size(); ++r) {
        if (body.anchors[r].contains(b.site_position(s.x, s.y, s.z))) {
          ++anchored[r];
          held = 1;
        }
      }
      points.anchored.push_back(held);
    }
    for (std::size_t r = 0; r < anchored.size(); ++r) {
      if (anchored[r] == 0) {
        throw std::invalid_argument(
            "anchors[" + std::to_string(r) + "] of body '" + body.name +
            "' holds no point of it: a region is in world coordinates and must "
            "reach at least a cell (" +
            std::to_string(scene.cell_size) + " m) into the body");
      }
    }
    bodies.push_back(std::move(b));
  }
  points.bonds.resize(points.size());
  for (int p = 0; p < points.size(); ++p) {
    points.bonds[p] = whole_bonds(bodies[points.site[p].body], points.site[p]);
  }
  return bodies;
}

void points_around(const LatticeBody& b, int x, int y, int z, std::int32_t (&around)[216]) {
  const int x0 = 2 * x - 2, y0 = 2 * y - 2, z0 = 2 * z - 2;
  const bool inside = x0 >= 0 && x0 + 6 <= 2 * b.nx;
  for (int n = 0; n < 216; n += 6) {
    const int j = y0 + n / 6 % 6, k = z0 + n / 36;
    if (inside && j >= 0 && j < 2 * b.ny && k >= 0 && k < 2 * b.nz) {
      std::copy_n(&b.point_at[(static_cast<std::size_t>(k) * 2 * b.ny + j) * 2 * b.nx + x0], 6,
                  around + n);
    } else {
      for (int i = 0; i < 6; ++i) around[n + i] = b.point(x0 + i, j, k);
    }
  }
}

float site_weight(const Points::Site& s, int k) {
  return lattice_weight(s.x & 1, k % 3) * lattice_weight(s.y & 1, k / 3 % 3) *
         lattice_weight(s.z & 1, k / 9);
}

}  // namespace tissue_sim
