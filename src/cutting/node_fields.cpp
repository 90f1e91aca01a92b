#include "cutting/node_fields.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "cutting/bonds.h"
#include "math/bspline.h"

namespace tissue_sim {
namespace {

/// Place of a point in the 6 x 6 x 6 box of the node of cell (x, y, z).
int place(const Points::Site& p, int x, int y, int z) {
  return ((p.z - 2 * z + 2) * 6 + p.y - 2 * y + 2) * 6 + p.x - 2 * x + 2;
}

// A node is held when this share of its mass is anchored. Nodes held up to a place clamp a body as
// a wall a quarter of a cell before it would; with this share that wall is within half a cell of
// the region's end, on average at it (of a node half a cell outside 16 % of the mass is in the
// region, of one a cell and a quarter outside 1.6 %).
constexpr double kAnchoredShare = 0.05;

/// Weights of the box's centre node at the places of one axis of the box; and for each choice of
/// the six points of a row 1 for those of it, 0 for the others.
struct Tables {
  double weight[6] = {}, chosen[64][6] = {};
  constexpr Tables() {
    for (int i = 0; i < 6; ++i) weight[i] = lattice_weight(i & 1, 2 - i / 2);
    for (int i = 0; i < 64 * 6; ++i) chosen[i / 6][i % 6] = i / 6 >> i % 6 & 1;
  }
};
constexpr Tables kTables;

/// Gives a node the mass of those points that are in the places `part`.
void share_mass(const LatticeBody& body, const Points& points, const NodeBox& box,
                const Planes& part, int node, Nodes& nodes) {
  double mass[6] = {}, anchored[6] = {};  // by place along x
  const bool one_material = body.materials.size() == 1;
  for (int plane = 0, row = 0; plane < 6; ++plane) {
    for (std::uint64_t bits = part[plane], y = 0; y < 6; bits >>= 6, ++y, ++row) {
      if ((bits & 0x3f) == 0) continue;
      const std::int32_t* p = box.row(row);
      const double weight = kTables.weight[plane] * kTables.weight[y];
      std::uint64_t held = 1;  // a byte of each point: whether it is anchored
      if (one_material && box.is_whole(row)) {
        held = 0;
        std::memcpy(&held, &points.anchored[p[0]], 6);
      }
      if (held == 0) {
        const double density = body.materials[0].density * weight;
        const float* volume = &points.volume[p[0]];
        const double* chosen = kTables.chosen[bits & 0x3f];
        for (int x = 0; x < 6; ++x) mass[x] += volume[x] * (density * chosen[x]);
        continue;
      }
      for (int x = 0; x < 6; ++x) {
        if ((bits >> x & 1) == 0 || p[x] < 0) continue;
        const double m = body.material_of(points, p[x]).density * weight * points.volume[p[x]];
        mass[x] += m;
        if (points.anchored[p[x]] != 0) anchored[x] += m;
      }
    }
  }
  double sum = 0, sum_anchored = 0;
  for (int x = 0; x < 6; ++x) {
    sum += kTables.weight[x] * mass[x];
    sum_anchored += kTables.weight[x] * anchored[x];
  }
  nodes.mass[node] = static_cast<float>(sum);
  const bool fast = sum_anchored > kAnchoredShare * sum || sum <= 0;
  nodes.inv_mass[node] = fast ? 0.0f : 1.0f / nodes.mass[node];
  if (fast) {
    for (int c = 0; c < 3; ++c) nodes.v[c][node] = 0;
  }
}

/// The cells whose nodes one of the points belongs to, in the order of these points.
std::vector<NodeFields::Cell> cells_around(const std::vector<LatticeBody>& bodies,
                                           const Points& points,
                                           const std::vector<std::int32_t>& some) {
  constexpr std::uint8_t kListed = 1, kDone = 2;  // itself; all around it
  std::vector<std::uint8_t> state(lattice_node_count(bodies), 0);
  std::vector<NodeFields::Cell> cells;
  for (const std::int32_t p : some) {
    const Points::Site& s = points.site[p];
    const LatticeBody& b = bodies[s.body];
    std::uint8_t& middle = state[b.node(s.x / 2, s.y / 2, s.z / 2)];
    if ((middle & kDone) != 0) continue;
    middle |= kDone;
    for (int k = 0; k < 27; ++k) {
      const NodeFields::Cell c{s.body, s.x / 2 + k % 3 - 1, s.y / 2 + k / 3 % 3 - 1,
                               s.z / 2 + k / 9 - 1};
      std::uint8_t& at = state[b.node(c.x, c.y, c.z)];
      if ((at & kListed) == 0) cells.push_back(c);
      at |= kListed;
    }
  }
  return cells;
}

}  // namespace

NodeFields::NodeFields(const std::vector<LatticeBody>& bodies, const Points& points, Nodes& nodes) {
  nodes.resize(lattice_node_count(bodies));
  Planes all;
  all.fill(0xfffffffff);
  for (const LatticeBody& b : bodies) {
    for (int z = -1; z <= b.nz; ++z) {
      for (int y = -1; y <= b.ny; ++y) {
        for (int x = -1; x <= b.nx; ++x) {
          share_mass(b, points, {b, x, y, z}, all, b.node(x, y, z), nodes);
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
  return field_at(place(p, x, y, z));
}

int NodeFields::node(const LatticeBody& body, const Points::Site& p, int k) const {
  return node(body, p, p.x / 2 + k % 3 - 1, p.y / 2 + k / 3 % 3 - 1, p.z / 2 + k / 9 - 1);
}

void NodeFields::list_fields(int lattice_node, std::vector<Planes>& parts,
                             std::vector<std::int32_t>& parent_of_new, int node_count) {
  std::int32_t& index = split_of_[lattice_node];
  if (index < 0) {
    index = static_cast<std::int32_t>(splits_.size());
    splits_.push_back({{{}}, {lattice_node}});
  }
  Split& split = splits_[index];
  std::vector<std::int32_t> field;
  field.reserve(parts.size());
  for (const Planes& part : parts) {
    int z = 0;
    while (part[z] == 0) ++z;
    const std::int32_t parent = split.field_at(36 * z + __builtin_ctzll(part[z]));
    if (std::find(field.begin(), field.end(), parent) == field.end()) {
      field.push_back(parent);
    } else {
      field.push_back(node_count + static_cast<std::int32_t>(parent_of_new.size()));
      parent_of_new.push_back(parent);
    }
  }
  split.field.swap(field);
  split.part.swap(parts);
}

std::vector<NodeFields::Cell> NodeFields::update(const std::vector<LatticeBody>& bodies,
                                                 const Points& points,
                                                 const std::vector<std::int32_t>& changed,
                                                 Nodes& nodes, Cpu& cpu) {
  const std::vector<Cell> cells = cells_around(bodies, points, changed);
  const auto node_of = [&](const Cell& c) { return bodies[c.body].node(c.x, c.y, c.z); };
  if (split_of_.empty()) split_of_.assign(lattice_node_count(bodies), -1);
  std::vector<std::vector<Planes>> parts(cells.size());  // none where they are what they were
  cpu.for_each(
      static_cast<int>(cells.size()),
      [&](int i) {
        const Cell& c = cells[i];
        Planes found[216];
        const int count = find_components({bodies[c.body], c.x, c.y, c.z}, points, found);
        const Split* before = split(node_of(c));
        // Components only come apart, so the same number means the same components.
        if (count == (before == nullptr ? 1 : static_cast<int>(before->field.size()))) return;
        parts[i].assign(found, found + count);
      },
      32);
  std::vector<Cell> apart;
  std::vector<std::int32_t> parent_of_new;  // the node that a new one was a part of
  const int node_count = static_cast<int>(nodes.size());
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (parts[i].empty()) continue;
    list_fields(node_of(cells[i]), parts[i], parent_of_new, node_count);
    apart.push_back(cells[i]);
  }
  nodes.resize(node_count + parent_of_new.size());
  for (std::size_t i = 0; i < parent_of_new.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      nodes.u[c][node_count + i] = nodes.u[c][parent_of_new[i]];
      nodes.v[c][node_count + i] = nodes.v[c][parent_of_new[i]];
    }
  }
  cpu.for_each(
      static_cast<int>(apart.size()),
      [&](int i) {
        const Cell& c = apart[i];
        const Split& s = *split(node_of(c));
        const NodeBox box(bodies[c.body], c.x, c.y, c.z);
        for (std::size_t k = 0; k < s.part.size(); ++k) {
          share_mass(bodies[c.body], points, box, s.part[k], s.field[k], nodes);
        }
      },
      32);
  return apart;
}

}  // namespace tissue_sim
