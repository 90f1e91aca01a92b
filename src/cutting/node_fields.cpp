#include "cutting/node_fields.h"

#include <algorithm>
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

/// Components of the bonds within the box, numbered by their first place. Returns their count.
/// A z-plane of the box is 36 bits of a word, and a component grows along all bonds at once.
int components(const std::int32_t (&around)[216], const Points& points,
               std::uint8_t (&label)[216]) {
  using Planes = std::uint64_t[6];
  Planes left = {}, along_x = {}, along_y = {}, along_z = {};  // points; bonds to the next place
  constexpr std::uint64_t kNotLastX = 0x7df7df7df,
                          kNotLastY = 0x3fffffff;  // places with a next one
  for (int i = 0; i < 216; ++i) {
    if (around[i] < 0) continue;
    const std::uint64_t bit = std::uint64_t(1) << (i % 36);
    const unsigned bonds = points.bonds[around[i]];
    left[i / 36] |= bit;
    if ((bonds >> kForwardBond & 1) != 0) along_x[i / 36] |= bit & kNotLastX;
    if ((bonds >> (kForwardBond + 1) & 1) != 0) along_y[i / 36] |= bit & kNotLastY;
    if ((bonds >> (kForwardBond + 2) & 1) != 0 && i < 180) along_z[i / 36] |= bit;
  }
  std::memset(label, kNone, sizeof(label));
  int count = 0;
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
      for (int z = 0; z < 6; ++z) {
        left[z] &= ~reached[z];
        for (std::uint64_t m = reached[z]; m != 0; m &= m - 1) {
          label[36 * z + __builtin_ctzll(m)] = static_cast<std::uint8_t>(count);
        }
      }
      ++count;
    }
  }
  return count;
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
    const double mass = body.material.density * points.volume[around[i]] * weight_at(i % 6) *
                        weight_at(i / 6 % 6) * weight_at(i / 36);
    s.mass += mass;
    if (points.anchored[around[i]]) s.anchored_mass += mass;
  }
  return result;
}

}  // namespace

NodeFields::NodeFields(const std::vector<LatticeBody>& bodies, const Points& points, Nodes& nodes) {
  nodes.resize(bodies.back().first_node + bodies.back().node_count());
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
  Components found;
  const int count = components(around, points, found.label);
  const Split* before = split(body.node(cell.x, cell.y, cell.z));
  // Components only come apart, so the same number means the same components.
  if (count != (before == nullptr ? 1 : static_cast<int>(before->field.size()))) {
    found.share = shares(body, points, around, found.label, count);
  }
  return found;
}

void NodeFields::split_node(int lattice_node, const Components& components, Nodes& nodes) {
  const auto before = splits_.find(lattice_node);
  const auto& label = components.label;
  Split split;
  std::copy(std::begin(label), std::end(label), split.component);
  std::vector<std::int32_t> taken;
  for (int i = 0; i < 216; ++i) {
    if (label[i] != split.field.size()) continue;  // the first of its component
    const int parent =
        before == splits_.end() ? lattice_node : before->second.field[before->second.component[i]];
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
  splits_[lattice_node] = std::move(split);
}

std::vector<NodeFields::Cell> NodeFields::update(const std::vector<LatticeBody>& bodies,
                                                 const Points& points,
                                                 const std::vector<std::int32_t>& changed,
                                                 Nodes& nodes, Cpu& cpu) {
  std::vector<Cell> cells;
  std::vector<bool> seen(bodies.back().first_node + bodies.back().node_count(), false);
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
