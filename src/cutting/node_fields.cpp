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
int components(const std::int32_t (&around)[216], const Points& points,
               std::uint8_t (&label)[216]) {
  std::memset(label, kNone, sizeof(label));
  int count = 0;
  std::uint8_t stack[216];
  for (int start = 0; start < 216; ++start) {
    if (around[start] < 0 || label[start] != kNone) continue;
    int top = 0;
    stack[top++] = static_cast<std::uint8_t>(start);
    label[start] = static_cast<std::uint8_t>(count);
    while (top > 0) {
      const int at = stack[--top];
      const int x = at % 6, y = at / 6 % 6, z = at / 36;
      for (unsigned bonds = points.bonds[around[at]]; bonds != 0; bonds &= bonds - 1) {
        const BondOffset o = bond_offset(__builtin_ctz(bonds));
        const int i = x + o.x, j = y + o.y, k = z + o.z;
        if (i < 0 || j < 0 || k < 0 || i > 5 || j > 5 || k > 5) continue;
        const int next = (k * 6 + j) * 6 + i;
        if (label[next] != kNone) continue;
        label[next] = static_cast<std::uint8_t>(count);
        stack[top++] = static_cast<std::uint8_t>(next);
      }
    }
    ++count;
  }
  return count;
}

// A node is held when this share of its mass is anchored. Nodes held up to a place clamp a body as
// a wall a quarter of a cell before it would; with this share that wall is within half a cell of
// the region's end, on average at it (of a node half a cell outside 16 % of the mass is in the
// region, of one a cell and a quarter outside 1.6 %).
constexpr double kAnchoredShare = 0.05;

/// Mass of each component at the node, and how much of it is anchored.
struct Share {
  double mass = 0, anchored_mass = 0;

  bool anchored() const { return anchored_mass > kAnchoredShare * mass; }
};

void set_mass(Nodes& nodes, int node, const Share& share) {
  nodes.mass[node] = static_cast<float>(share.mass);
  const bool fast = share.anchored() || share.mass <= 0;
  nodes.inv_mass[node] = fast ? 0.0f : 1.0f / nodes.mass[node];
  if (fast) {
    for (int c = 0; c < 3; ++c) nodes.v[c][node] = 0;
  }
}

std::vector<Share> shares(const LatticeBody& body, const Points& points,
                          const std::int32_t (&around)[216], const std::uint8_t (&label)[216],
                          int count) {
  std::vector<Share> result(count);
  for (int i = 0; i < 216; ++i) {
    if (around[i] < 0) continue;
    Share& s = result[label[i]];
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

bool NodeFields::split_node(const LatticeBody& body, const Points& points, const Cell& cell,
                            const Components& components, Nodes& nodes) {
  const int lattice_node = body.node(cell.x, cell.y, cell.z);
  const auto before = splits_.find(lattice_node);
  const int count_before =
      before == splits_.end() ? 1 : static_cast<int>(before->second.field.size());
  // Components only come apart, so the same number means the same components.
  if (components.count == count_before) return false;
  const auto& label = components.label;
  std::int32_t around[216];
  points_around(body, cell.x, cell.y, cell.z, around);
  Split split;
  std::copy(std::begin(label), std::end(label), split.component);
  const std::vector<Share> share = shares(body, points, around, label, components.count);
  std::vector<std::int32_t> taken;
  for (int i = 0; i < 216; ++i) {
    if (around[i] < 0 || label[i] != split.field.size()) continue;  // the first of its component
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
  for (int c = 0; c < components.count; ++c) set_mass(nodes, split.field[c], share[c]);
  splits_[lattice_node] = std::move(split);
  return true;
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
      [&](int i) {
        const Cell& c = cells[i];
        std::int32_t around[216];
        points_around(bodies[c.body], c.x, c.y, c.z, around);
        found[i].count = components(around, points, found[i].label);
      },
      32);
  std::vector<Cell> split;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (split_node(bodies[cells[i].body], points, cells[i], found[i], nodes)) {
      split.push_back(cells[i]);
    }
  }
  return split;
}

}  // namespace tissue_sim
