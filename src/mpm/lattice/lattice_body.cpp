#include "mpm/lattice/lattice_body.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>

#include "math/bspline.h"
#include "mpm/lattice/bonds.h"

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

/// Puts a material into the list unless it is there; returns its number.
int number_of(std::vector<Material>& materials, const Material& m) {
  const auto same = [&m](const Material& other) { return other.name == m.name; };
  const auto at = std::find_if(materials.begin(), materials.end(), same);
  const auto number = static_cast<int>(at - materials.begin());
  if (at == materials.end()) materials.push_back(m);
  return number;
}

[[noreturn]] void refuse_region(const char* list, std::size_t index, const Scene& scene,
                                const std::string& body, const char* what) {
  throw std::invalid_argument(
      std::string(list) + "[" + std::to_string(index) + "] of body '" + body +
      "' holds no point of it" + what +
      ": a region is in world coordinates and must reach at least a cell (" +
      std::to_string(scene.cell_size) + " m) into the body");
}

/// Fills Points::material of the body's points, which are the last ones.
void assign_materials(const Scene& scene, LatticeBody& b, Points& points) {
  b.materials = {find_material(scene, b.body.material)};
  const std::vector<Inclusion>& inclusions = b.body.inclusions;
  std::vector<std::uint8_t> number;
  for (const Inclusion& i : inclusions) {
    const int n = number_of(b.materials, find_material(scene, i.material));
    number.push_back(static_cast<std::uint8_t>(n));
  }
  if (inclusions.empty() && points.material.empty()) return;
  points.material.resize(points.size(), 0);
  std::vector<int> held(inclusions.size(), 0);
  for (int p = b.first_point; p < points.size(); ++p) {
    const Points::Site& s = points.site[p];
    const Vec3 x = b.site_position(s.x, s.y, s.z);
    for (std::size_t i = inclusions.size(); i-- > 0;) {
      if (!inclusions[i].region.contains(x)) continue;
      points.material[p] = number[i];
      ++held[i];
      break;
    }
  }
  for (std::size_t i = 0; i < held.size(); ++i) {
    if (held[i] > 0) continue;
    refuse_region("inclusions", i, scene, b.body.name, " that no later one holds");
  }
  const auto first = points.material.begin() + b.first_point;
  if (std::find(first, points.material.end(), 0) != points.material.end()) return;
  b.materials.erase(b.materials.begin());  // inclusions fill the body
  for (auto m = first; m != points.material.end(); ++m) --*m;
}

LatticeRows rows_of(const Lattice& lattice) {
  LatticeRows rows(0, 2 * lattice.ny);
  auto site = lattice.sites.begin();  // x fastest
  for (int z = 0; z < 2 * lattice.nz; ++z) {
    for (int y = 0; y < 2 * lattice.ny; ++y) {
      rows.start_row();
      for (; site != lattice.sites.end() && site->y == y && site->z == z; ++site) {
        rows.add(site->x, site->x + 1);
      }
    }
  }
  return rows;
}

/// Numbers the nodes of a body whose points are there.
LatticeRows nodes_of(const LatticeBody& b, NodeRange range) {
  LatticeRows nodes(-1, b.ny + 2);
  std::vector<std::uint8_t> seen;  // by x + 1
  for (int z = -1; z <= b.nz; ++z) {
    for (int y = -1; y <= b.ny; ++y) {
      nodes.start_row();
      seen.assign(b.nx + 2, range == NodeRange::kBox ? 1 : 0);
      for (int row = 0; row < 36; ++row) {
        b.for_each_point_in_row(
            0, 2 * b.nx, 2 * y - 2 + row % 6, 2 * z - 2 + row / 6, [&](int x, int, int count) {
              std::fill(seen.begin() + x / 2, seen.begin() + (x + count - 1) / 2 + 3, 1);
            });
      }
      for (int x = -1; x <= b.nx; ++x) {
        if (seen[x + 1] != 0) nodes.add(x, x + 1);
      }
    }
  }
  return nodes;
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

std::uint8_t whole_bonds(const LatticeBody& body, const Points& points, std::int32_t point) {
  const unsigned never = points.beside_gap.empty() ? 0 : points.beside_gap[point];
  return static_cast<std::uint8_t>(whole_bonds(body, points.site[point]) & ~never);
}

std::vector<LatticeBody> make_lattice_bodies(const Scene& scene, Points& points,
                                             std::vector<std::string>* notes, NodeRange range) {
  std::vector<LatticeBody> bodies;
  int first_node = 0;
  for (const Body& body : scene.bodies) {
    const Lattice lattice =
        make_lattice(body, scene.cell_size, notes, work_limits().max_points - points.size());
    check_size(lattice, body.name);
    LatticeBody b;
    b.body = body;
    b.origin = lattice.origin;
    b.cell_size = lattice.cell_size;
    b.nx = lattice.nx;
    b.ny = lattice.ny;
    b.nz = lattice.nz;
    b.first_point = points.size();
    b.point_count = static_cast<int>(lattice.sites.size());
    b.points = rows_of(lattice);
    b.first_node = first_node;
    b.nodes = nodes_of(b, range);
    first_node += b.nodes.count();
    const std::size_t count = points.site.size() + lattice.sites.size();
    points.site.reserve(count);
    points.volume.reserve(count);
    points.anchored.reserve(count);
    const auto index = static_cast<std::int16_t>(bodies.size());
    for (const Lattice::Site& s : lattice.sites) {
      if (points.size() % 4096 == 0) stop_if_asked();
      points.site.push_back({static_cast<std::int16_t>(s.x), static_cast<std::int16_t>(s.y),
                             static_cast<std::int16_t>(s.z), index});
      points.volume.push_back(s.volume);
      const Vec3 x = b.site_position(s.x, s.y, s.z);
      const bool held = std::any_of(body.anchors.begin(), body.anchors.end(),
                                    [&](const Anchor& a) { return a.contains(x); });
      points.anchored.push_back(held ? Points::kInAnchor : 0);
    }
    assign_materials(scene, b, points);
    for (const Lattice::Gap& g : lattice.gaps) {
      const std::int32_t p = b.first_point + g.site;
      BrokenBond bond{p, b.next_point(points.site[p], g.axis), g.axis, {}};
      bond.crossing.place = static_cast<float>(g.place);
      for (int a = 0; a < 3; ++a) bond.crossing.normal[a] = static_cast<float>(g.normal[a]);
      points.gaps.push_back(bond);
    }
    bodies.push_back(std::move(b));
  }
  points.bonds.resize(points.size());
  for (int p = 0; p < points.size(); ++p) {
    if (p % 4096 == 0) stop_if_asked();
    points.bonds[p] = whole_bonds(bodies[points.site[p].body], points.site[p]);
  }
  if (!points.gaps.empty()) points.beside_gap.assign(points.size(), 0);
  for (const BrokenBond& g : points.gaps) {
    const int k = kForwardBond + g.axis;
    points.beside_gap[g.point] |= static_cast<std::uint8_t>(1u << k);
    points.beside_gap[g.other] |= static_cast<std::uint8_t>(1u << opposite_bond(k));
  }
  return bodies;
}

void points_around(const LatticeBody& b, int x, int y, int z, std::int32_t (&around)[216]) {
  std::fill_n(around, 216, -1);
  for (int row = 0; row < 36; ++row) {
    const int x0 = 2 * x - 2;
    b.for_each_point_in_row(
        x0, x0 + 6, 2 * y - 2 + row % 6, 2 * z - 2 + row / 6, [&](int from, int point, int count) {
          std::iota(around + 6 * row + from - x0, around + 6 * row + from - x0 + count, point);
        });
  }
}

float site_weight(const Points::Site& s, int k) {
  return lattice_weight(s.x & 1, k % 3) * lattice_weight(s.y & 1, k / 3 % 3) *
         lattice_weight(s.z & 1, k / 9);
}

}  // namespace tissue_sim
