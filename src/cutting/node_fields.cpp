#include "cutting/node_fields.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "cutting/bonds.h"
#include "math/bspline.h"

namespace tissue_sim {
namespace {

constexpr int kNone = 255;

/// Place of a point in the 6 x 6 x 6 box of the node of cell (x, y, z).
int place(const Points::Site& p, int x, int y, int z) {
  return ((p.z - 2 * z + 2) * 6 + p.y - 2 * y + 2) * 6 + p.x - 2 * x + 2;
}

/// Weight of the box's centre node at place i of one axis of the box.
float weight_at(int i) { return lattice_weight(i & 1, 2 - i / 2); }

/// The lowest bits of a word's first six bytes.
std::uint64_t row_bits(std::uint64_t bytes) { return (bytes * 0x0102040810204080) >> 56 & 0x3f; }

/// Places of the box: each z-plane of it is 36 bits of a word.
using Planes = std::array<std::uint64_t, 6>;

/// Components of the bonds within the box, in the order of their first places. Each grows along all
/// bonds at once.
std::vector<Planes> components(const std::int32_t (&around)[216], const Points& points) {
  Planes left = {}, along_x = {}, along_y = {}, along_z = {};  // points; bonds to the next place
  constexpr std::uint64_t kNotLastX = 0x7df7df7df,
                          kNotLastY = 0x3fffffff;  // places with a next one
  for (int row = 0; row < 36; ++row) {
    const int z = row / 6, shift = 6 * (row % 6);
    const std::int32_t* p = around + 6 * row;
    std::uint64_t bonds = 0, there = 0;  // a byte of each point; its lowest bit if there is one
    for (int x = 0; x < 6; ++x) {
      if (p[x] < 0) continue;
      bonds |= std::uint64_t(points.bonds[p[x]]) << (8 * x);
      there |= std::uint64_t(1) << (8 * x);
    }
    left[z] |= row_bits(there) << shift;
    along_x[z] |= row_bits(bonds >> kForwardBond & there) << shift & kNotLastX;
    along_y[z] |= row_bits(bonds >> (kForwardBond + 1) & there) << shift & kNotLastY;
    if (z < 5) along_z[z] |= row_bits(bonds >> (kForwardBond + 2) & there) << shift;
  }
  std::vector<Planes> found;
  for (int start = 0; start < 6; ++start) {
    while (left[start] != 0) {
      Planes reached = {};
      reached[start] = left[start] & -left[start];
      for (bool grows = true; grows;) {
        grows = false;
        for (int z = 0; z < 6; ++z) {
          const std::uint64_t before = reached[z];
          std::uint64_t m = before;
          if (z > 0) m |= reached[z - 1] & along_z[z - 1];
          if (z < 5) m |= reached[z + 1] & along_z[z];
          m |= (m & along_x[z]) << 1 | (m >> 1 & along_x[z]);
          m |= (m & along_y[z]) << 6 | (m >> 6 & along_y[z]);
          reached[z] = m;
          grows = grows || m != before;
        }
      }
      for (int z = 0; z < 6; ++z) left[z] &= ~reached[z];
      found.push_back(reached);
    }
  }
  return found;
}

// A node is held when this share of its mass is anchored. Nodes held up to a place clamp a body as
// a wall a quarter of a cell before it would; with this share that wall is within half a cell of
// the region's end, on average at it (of a node half a cell outside 16 % of the mass is in the
// region, of one a cell and a quarter outside 1.6 %).
constexpr double kAnchoredShare = 0.05;

void set_mass(Nodes& nodes, int node, const NodeShare& share) {
  nodes.mass[node] = static_cast<float>(share.mass);
  const bool fast = share.anchored_mass > kAnchoredShare * share.mass || share.mass <= 0;
  nodes.inv_mass[node] = fast ? 0.0f : 1.0f / nodes.mass[node];
  if (fast) {
    for (int c = 0; c < 3; ++c) nodes.v[c][node] = 0;
  }
}

std::vector<NodeShare> shares(const LatticeBody& body, const Points& points,
                              const std::int32_t (&around)[216], const std::uint8_t (&label)[216],
                              int count) {
  std::vector<NodeShare> result(count);
  for (int i = 0; i < 216; ++i) {
    if (around[i] < 0) continue;
    NodeShare& s = result[label[i]];
    const double mass = body.material_of(points, around[i]).density * points.volume[around[i]] *
                        weight_at(i % 6) * weight_at(i / 6 % 6) * weight_at(i / 36);
    s.mass += mass;
    if (points.anchored[around[i]]) s.anchored_mass += mass;
  }
  return result;
}

}  // namespace

NodeFields::NodeFields(const std::vector<LatticeBody>& bodies, const Points& points, Nodes& nodes) {
  nodes.resize(lattice_node_count(bodies));
  std::int32_t around[216];
  const std::uint8_t one[216] = {};
  for (const LatticeBody& b : bodies) {
    for (int z = -1; z <= b.nz; ++z) {
      for (int y = -1; y <= b.ny; ++y) {
        for (int x = -1; x <= b.nx; ++x) {
          points_around(b, x, y, z, around);
          set_mass(nodes, b.node(x, y, z), shares(b, points, around, one, 1)[0]);
        }
      }
    }
  }
}

int NodeFields::node(const LatticeBody& body, const Points::Site& p, int x, int y, int z) const {
  const int lattice_node = body.node(x, y, z);
  const Split* s = split(lattice_node);
  return s == nullptr ? lattice_node : s->seen_by(p, x, y, z);
}

int NodeFields::Split::seen_by(const Points::Site& p, int x, int y, int z) const {
  return field[component[place(p, x, y, z)]];
}

int NodeFields::node(const LatticeBody& body, const Points::Site& p, int k) const {
  return node(body, p, p.x / 2 + k % 3 - 1, p.y / 2 + k / 3 % 3 - 1, p.z / 2 + k / 9 - 1);
}

NodeFields::Components NodeFields::find_components(const LatticeBody& body, const Points& points,
                                                   const Cell& cell) const {
  std::int32_t around[216];
  points_around(body, cell.x, cell.y, cell.z, around);
  const std::vector<Planes> parts = components(around, points);
  const Split* before = split(body.node(cell.x, cell.y, cell.z));
  Components found;
  // Components only come apart, so the same number means the same components.
  if (parts.size() == (before == nullptr ? 1 : before->field.size())) return found;
  std::memset(found.label, kNone, sizeof(found.label));
  for (std::size_t i = 0; i < parts.size(); ++i) {
    for (int z = 0; z < 6; ++z) {
      for (std::uint64_t m = parts[i][z]; m != 0; m &= m - 1) {
        found.label[36 * z + __builtin_ctzll(m)] = static_cast<std::uint8_t>(i);
      }
    }
  }
  found.share = shares(body, points, around, found.label, static_cast<int>(parts.size()));
  return found;
}

void NodeFields::split_node(int lattice_node, const Components& components, Nodes& nodes) {
  const Split* before = this->split(lattice_node);
  const auto& label = components.label;
  Split split;
  std::copy(std::begin(label), std::end(label), split.component);
  std::vector<std::int32_t> taken;
  for (int i = 0; i < 216; ++i) {
    if (label[i] != split.field.size()) continue;  // the first of its component
    const int parent = before == nullptr ? lattice_node : before->field[before->component[i]];
    int field = parent;
    if (std::find(taken.begin(), taken.end(), parent) != taken.end()) {
      field = static_cast<int>(nodes.size());
      nodes.resize(nodes.size() + 1);
      for (int c = 0; c < 3; ++c) {
        nodes.u[c][field] = nodes.u[c][parent];
        nodes.v[c][field] = nodes.v[c][parent];
      }
    }
    taken.push_back(parent);
    split.field.push_back(field);
  }
  for (std::size_t c = 0; c < components.share.size(); ++c) {
    set_mass(nodes, split.field[c], components.share[c]);
  }
  if (before != nullptr) {
    splits_[split_of_[lattice_node]] = std::move(split);
    return;
  }
  split_of_[lattice_node] = static_cast<std::int32_t>(splits_.size());
  splits_.push_back(std::move(split));
}

std::vector<NodeFields::Cell> NodeFields::update(const std::vector<LatticeBody>& bodies,
                                                 const Points& points,
                                                 const std::vector<std::int32_t>& changed,
                                                 Nodes& nodes, Cpu& cpu) {
  std::vector<Cell> cells;
  std::vector<bool> seen(lattice_node_count(bodies), false);
  for (const std::int32_t p : changed) {
    const Points::Site& s = points.site[p];
    for (int k = 0; k < 27; ++k) {
      const Cell c{s.body, s.x / 2 + k % 3 - 1, s.y / 2 + k / 3 % 3 - 1, s.z / 2 + k / 9 - 1};
      const int node = bodies[c.body].node(c.x, c.y, c.z);
      if (!seen[node]) cells.push_back(c);
      seen[node] = true;
    }
  }
  std::vector<Components> found(cells.size());
  cpu.for_each(
      static_cast<int>(cells.size()),
      [&](int i) { found[i] = find_components(bodies[cells[i].body], points, cells[i]); }, 32);
  if (split_of_.empty()) split_of_.assign(seen.size(), -1);
  std::vector<Cell> split;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (found[i].share.empty()) continue;
    const Cell& c = cells[i];
    split_node(bodies[c.body].node(c.x, c.y, c.z), found[i], nodes);
    split.push_back(c);
  }
  return split;
}

}  // namespace tissue_sim
