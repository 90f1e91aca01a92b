#include "mpm/split/node_fields.h"

#include <algorithm>
#include <utility>

#include "math/bspline.h"
#include "mpm/lattice/bonds.h"

namespace tissue_sim {
namespace {

/// Weights of the box's centre node at the places of one axis of the box, and their sum for each
/// choice of the six points of a row.
struct Tables {
  double weight[6] = {}, chosen[64] = {};
  constexpr Tables() {
    for (int i = 0; i < 6; ++i) weight[i] = lattice_weight(i & 1, 2 - i / 2);
    for (int i = 0; i < 64 * 6; ++i) chosen[i / 6] += (i / 6 >> i % 6 & 1) * weight[i % 6];
  }
};
constexpr Tables kTables;

/// The volume whose mass a point gives its nodes [m^3]. What an anchor has of a cell at its face
/// keeps a hundredth of its stiffness (keep_held()), and so much of its mass: nodes that little
/// else gives mass to would swing faster than any tissue.
double volume_with_mass(const LatticeBody& body, const Points& points, std::int32_t p) {
  const float volume = points.free_volume_of(p);
  if (volume != 0) return volume;
  const Points::Site& s = points.site[p];
  for (int k = 0; k < 8; ++k) {
    const std::int32_t other =
        body.point((s.x & ~1) + (k & 1), (s.y & ~1) + (k >> 1 & 1), (s.z & ~1) + (k >> 2));
    if (other >= 0 && points.free_volume_of(other) != 0) return kStabilisation * points.volume[p];
  }
  return 0;
}

/// Gives a node the mass of those points that are in the places `part` of a box.
void share_mass(const LatticeBody& body, const Points& points, const NodeFields::Cell& cell,
                double mass_of_point, const Planes& part, int node, Nodes& nodes) {
  double sum = 0;
  const auto for_each_row = [&](const auto& f) {
    for (int plane = 0, row = 0; plane < 6; ++plane) {
      for (std::uint64_t bits = part[plane], y = 0; y < 6; bits >>= 8, ++y, ++row) {
        f(row, static_cast<unsigned>(bits & 0x3f), kTables.weight[plane] * kTables.weight[y]);
      }
    }
  };
  if (mass_of_point > 0) {
    for_each_row([&](int, unsigned bits, double w) { sum += w * kTables.chosen[bits]; });
    sum *= mass_of_point;
  } else {
    std::int32_t around[216];
    points_around(body, cell.x, cell.y, cell.z, around);
    for_each_row([&](int row, unsigned bits, double w) {
      for (; bits != 0; bits &= bits - 1) {
        const int x = __builtin_ctz(bits);
        const std::int32_t p = around[6 * row + x];
        const double density = body.material_of(points, p).density;
        sum += w * kTables.weight[x] * density * volume_with_mass(body, points, p);
      }
    });
  }
  nodes.mass[node] = static_cast<float>(sum);
  nodes.inv_mass[node] = sum > 0 ? 1.0f / nodes.mass[node] : 0.0f;
  if (sum > 0) return;
  for (int c = 0; c < 3; ++c) nodes.v[c][node] = 0;
}

/// The mass of each point around the node of a cell if it is the same for all and none is anchored,
/// else 0.
double mass_of_point(const LatticeBody& body, const Points& points, const NodeFields::Cell& c) {
  double mass = 0;
  std::int32_t around[216];
  points_around(body, c.x, c.y, c.z, around);
  for (const std::int32_t p : around) {
    if (p < 0) continue;
    const double m = body.material_of(points, p).density * volume_with_mass(body, points, p);
    if (points.anchored[p] == Points::kInAnchor || (mass != 0 && m != mass)) return 0;
    mass = m;
  }
  return mass;
}

/// A cell and its lattice node.
struct CellNode {
  NodeFields::Cell cell;
  int node;
};
/// The cells whose nodes one of the points belongs to, in the order of their nodes: so the new
/// nodes of a row follow one another.
std::vector<CellNode> cells_around(const std::vector<LatticeBody>& bodies, const Points& points,
                                   const std::vector<std::int32_t>& some) {
  std::vector<CellNode> cells;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const CellsAround around(bodies[i], 1, points, some);
    around.for_each_row([&](int x, int y, int z, int node, const std::uint8_t* near, int count) {
      for (int n = 0; n < count; ++n) {
        if (near[n] != 0) cells.push_back({{static_cast<int>(i), x + n, y, z}, node + n});
      }
    });
  }
  return cells;
}

}  // namespace

NodeFields::NodeFields(const std::vector<LatticeBody>& bodies, const Points& points, Nodes& nodes)
    : bonds_(bodies, points) {
  const int count = lattice_node_count(bodies);
  nodes.reserve(count + count / 4);  // so that a cut does not move them all
  nodes.resize(count);
  mass_of_point_.resize(nodes.size());
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const LatticeBody& b = bodies[i];
    b.for_each_node([&](int node, int x, int y, int z) {
      const Cell cell{static_cast<int>(i), x, y, z};
      mass_of_point_[node] = static_cast<float>(mass_of_point(b, points, cell));
      const Planes all = bonds_.points_in_box(cell.body, x, y, z);
      share_mass(b, points, cell, mass_of_point_[node], all, node, nodes);
    });
  }
}

int NodeFields::node(const LatticeBody& body, const Points::Site& p, int x, int y, int z) const {
  const int lattice_node = body.node(x, y, z);
  const Split* s = split(lattice_node);
  return s == nullptr ? lattice_node : s->seen_by(p, x, y, z);
}

int NodeFields::Split::seen_by(const Points::Site& p, int x, int y, int z) const {
  return field_at(p.z - 2 * z + 2, bit_in_plane(p.x - 2 * x + 2, p.y - 2 * y + 2));
}

int NodeFields::node(const LatticeBody& body, const Points::Site& p, int k) const {
  return node(body, p, p.x / 2 + k % 3 - 1, p.y / 2 + k / 3 % 3 - 1, p.z / 2 + k / 9 - 1);
}

NodeFields::Split NodeFields::taken_apart(const Cell& c, int lattice_node) const {
  const Split* before = split(lattice_node);
  Planes found[216];
  const int count = bonds_.find_components(c.body, c.x, c.y, c.z, found);
  Split now;
  // Components only come apart, so the same number means the same components.
  if (count == (before == nullptr ? 1 : static_cast<int>(before->fields.size()))) return now;
  now.fields.reserve(count);
  for (int i = 0; i < count; ++i) {
    const Planes& points = found[i];
    int z = 0;
    while (points[z] == 0) ++z;
    const std::int32_t parent =
        before == nullptr ? lattice_node : before->field_at(z, __builtin_ctzll(points[z]));
    const bool is_first =
        std::none_of(now.fields.begin(), now.fields.end(),
                     [parent](const Split::Field& f) { return f.node == parent; });
    now.fields.push_back({points, is_first ? parent : ~parent});
  }
  return now;
}

std::vector<NodeFields::Cell> NodeFields::update(const std::vector<LatticeBody>& bodies,
                                                 const Points& points,
                                                 const std::vector<std::int32_t>& changed,
                                                 Nodes& nodes, Cpu& cpu) {
  bonds_.update(points, changed);
  const std::vector<CellNode> cells = cells_around(bodies, points, changed);
  if (split_of_.empty()) split_of_.assign(lattice_node_count(bodies), -1);
  std::vector<Split> now(cells.size());
  cpu.for_each(
      static_cast<int>(cells.size()),
      [&](int i) { now[i] = taken_apart(cells[i].cell, cells[i].node); }, 32);
  struct Part {
    const CellNode* of;
    Split* now;
    int first_new;  // of its new nodes
  };
  std::vector<Part> apart;
  apart.reserve(cells.size());
  int node_count = static_cast<int>(nodes.size());
  auto split_count = static_cast<std::int32_t>(splits_.size());
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (now[i].fields.empty()) continue;
    apart.push_back({&cells[i], &now[i], node_count});
    std::int32_t& index = split_of_[cells[i].node];
    const std::size_t before = index < 0 ? 1 : splits_[index].fields.size();
    node_count += static_cast<int>(now[i].fields.size() - before);
    if (index < 0) index = split_count++;
  }
  splits_.resize(split_count);
  Array<float>* const fields[] = {&nodes.u[0], &nodes.u[1], &nodes.u[2], &nodes.v[0],
                                  &nodes.v[1], &nodes.v[2], &nodes.mass, &nodes.inv_mass};
  cpu.for_each(8, [&](int k) { fields[k]->resize(node_count); });
  cpu.for_each(
      static_cast<int>(apart.size()),
      [&](int i) {
        const auto& [cell, node] = *apart[i].of;
        Split& split = splits_[split_of_[node]];
        split = std::move(*apart[i].now);
        int next = apart[i].first_new;
        for (Split::Field& f : split.fields) {
          if (f.node >= 0) continue;
          const int parent = ~f.node;
          f.node = next++;
          for (int c = 0; c < 3; ++c) {
            nodes.u[c][f.node] = nodes.u[c][parent];
            nodes.v[c][f.node] = nodes.v[c][parent];
          }
        }
        for (const Split::Field& f : split.fields) {
          share_mass(bodies[cell.body], points, cell, mass_of_point_[node], f.points, f.node,
                     nodes);
        }
      },
      32);
  std::vector<Cell> result;
  result.reserve(apart.size());
  for (const Part& part : apart) result.push_back(part.of->cell);
  return result;
}

namespace {

/// to[i]: whether any from[i + k step] is set, with k from -reach to reach.
void spread(const std::vector<std::uint8_t>& from, int reach, std::size_t step,
            std::vector<std::uint8_t>& to) {
  const std::size_t edge = reach * step;
  to = from;
  for (std::size_t by = step; by <= edge; by += step) {
    const std::uint8_t* in = from.data();
    std::uint8_t* out = to.data();
    const std::size_t count = from.size() - by;
    for (std::size_t i = 0; i < count; ++i) out[i + by] |= in[i];
    for (std::size_t i = 0; i < count; ++i) out[i] |= in[i + by];
  }
}

}  // namespace

CellsAround::CellsAround(const LatticeBody& body, int reach, const Points& points,
                         const std::vector<std::int32_t>& some)
    : body_(body) {
  const auto is_here = [&body](std::int32_t p) {
    return p >= body.first_point && p < body.first_point + body.point_count;
  };
  int low[3] = {1 << 30, 1 << 30, 1 << 30}, high[3] = {-1, -1, -1};
  for (const std::int32_t p : some) {
    if (!is_here(p)) continue;
    const Points::Site& s = points.site[p];
    const int cell[3] = {s.x / 2, s.y / 2, s.z / 2};
    for (int a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], cell[a]);
      high[a] = std::max(high[a], cell[a]);
    }
  }
  if (high[0] < 0) return;
  for (int a = 0; a < 3; ++a) {
    low_[a] = low[a] - reach;
    n_[a] = high[a] - low[a] + 1 + 2 * reach;
  }
  const std::size_t row = n_[0], plane = row * n_[1];
  near_.assign(plane * n_[2], 0);
  for (const std::int32_t p : some) {
    if (!is_here(p)) continue;
    const Points::Site& s = points.site[p];
    near_[(s.z / 2 - low_[2]) * plane + (s.y / 2 - low_[1]) * row + s.x / 2 - low_[0]] = 1;
  }
  std::vector<std::uint8_t> spread_x, spread_y;
  spread(near_, reach, 1, spread_x);
  spread(spread_x, reach, row, spread_y);
  spread(spread_y, reach, plane, near_);
}

}  // namespace tissue_sim
