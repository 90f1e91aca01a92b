// The cells that see parted nodes, and what they push.
#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "compute/simd.h"
#include "mpm/blocks/block_tissue.h"
#include "mpm/lattice/bonds.h"
#include "mpm/split/front.h"

namespace tissue_sim {
namespace {

/// The points of a cell that see the same fields, and of which material they are.
struct CellView {
  std::array<std::int32_t, 27> node;
  std::vector<FrontPart> parts;
  Law law;
  std::array<std::int32_t, 8> point;
  double volume = 0;     ///< of these [m^3]
  double viscosity = 0;  ///< times volumes [J s]
  double of_block = 0;   ///< the same times the volume that the block damps them with [J s m^3]
  int count = 0;
};

bool same_parts(const std::vector<FrontPart>& a, const std::vector<FrontPart>& b) {
  return a.size() == b.size() &&
         std::equal(a.begin(), a.end(), b.begin(), [](const FrontPart& x, const FrontPart& y) {
           return x.node == y.node && x.k == y.k && x.side == y.side;
         });
}

/// The nodes around a cell that has points.
struct NodesOfCell {
  std::int32_t lattice[27];
  const NodeFields::Split* split[27];
  bool any_parted = false;

  NodesOfCell(const LatticeTissue& s, const std::vector<std::int32_t>& parted,
              const LatticeBody& body, int x, int y, int z) {
    for (int k = 0; k < 27; ++k) {
      lattice[k] = body.node(x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1);
      split[k] = s.fields->split(lattice[k]);
      if (split[k] == nullptr) {
        any_parted = any_parted || parted[lattice[k]] >= 0;
        continue;
      }
      for (const NodeFields::Split::Field& f : split[k]->fields) {
        any_parted = any_parted || parted[f.node] >= 0;
      }
    }
  }
};

/// The share of the energy of volume. k was measured as c of parted_share() (nu = 0.3, 0.45, 0.49:
/// 0.8, 3.3, 16).
float volume_share(const FrontNode& n) {
  const float k = n.lambda_over_mu / 3;
  return (1 + k) * n.share / (1 + k * n.share);
}

/// The views of the points of a cell; `parted` has the number of each node among the parted ones,
/// -1 for others.
std::vector<CellView> views_of(const BlockTissue& s, const std::vector<std::int32_t>& parted,
                               const LatticeBody& body, int x, int y, int z) {
  std::vector<CellView> views;
  std::array<std::int32_t, 8> points;
  for (int p = 0; p < 8; ++p) {
    points[p] = body.point(2 * x + (p & 1), 2 * y + (p >> 1 & 1), 2 * z + (p >> 2));
  }
  if (*std::max_element(points.begin(), points.end()) < 0) return views;
  const NodesOfCell around(s, parted, body, x, y, z);
  if (!around.any_parted) return views;
  // A block damps its points in a cell together; a GPU has one for each material.
  struct Damped {
    std::array<std::int32_t, 27> node;
    int material;
    double volume;
  };
  std::vector<Damped> damped;
  const auto in_block = [&](const CellView& view, std::int32_t point) -> double& {
    const int material = s.blocks.uniform ? s.points.material_of(point) : 0;
    for (Damped& d : damped) {
      if (d.node == view.node && d.material == material) return d.volume;
    }
    damped.push_back({view.node, material, 0});
    return damped.back().volume;
  };
  for (int p = 0; p < 8; ++p) {
    const std::int32_t point = points[p];
    if (point < 0) continue;
    const double volume = elastic_volume(s.points, point);
    if (!(volume > 0)) continue;
    const Points::Site& site = s.points.site[point];
    CellView view;
    for (int k = 0; k < 27; ++k) {
      view.node[k] =
          around.split[k] == nullptr
              ? around.lattice[k]
              : around.split[k]->seen_by(site, x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1);
      const std::int32_t number = parted[view.node[k]];
      if (number < 0) continue;
      const FrontNode& n = s.front.nodes[number];
      const int plane = site.z - 2 * n.z + 2;
      const int bit = bit_in_plane(site.x - 2 * n.x + 2, site.y - 2 * n.y + 2);
      const bool first = (n.first_side[plane] >> bit & 1) != 0;
      view.parts.push_back({number, k, first ? -n.other : n.first, n.share, 0, volume_share(n), 0});
    }
    in_block(view, point) += volume;
    if (view.parts.empty()) continue;
    const Material& material = body.material_of(s.points, point);
    view.law = material.law;
    auto same = std::find_if(views.begin(), views.end(), [&view](const CellView& v) {
      return v.node == view.node && v.law == view.law && same_parts(v.parts, view.parts);
    });
    if (same == views.end()) {
      view.point.fill(-1);
      same = views.insert(same, std::move(view));
    }
    same->point[p] = point;
    same->volume += volume;
    same->viscosity += material.viscosity * volume;
    ++same->count;
  }
  for (CellView& view : views) {
    for (const std::int32_t point : view.point) {
      if (point < 0) continue;
      view.of_block += body.material_of(s.points, point).viscosity *
                       elastic_volume(s.points, point) * in_block(view, point);
    }
  }
  return views;
}

void add_front_cell(LatticeTissue& s, const LatticeBody& body, std::int32_t number,
                    CellView& view) {
  Front& front = s.front;
  std::stable_sort(view.parts.begin(), view.parts.end(),
                   [](const FrontPart& a, const FrontPart& b) { return a.share > b.share; });
  FrontPart next{};
  for (auto part = view.parts.rbegin(); part != view.parts.rend(); ++part) {
    part->step = part->share - next.share;
    part->volume_share = std::max(part->volume_share, next.volume_share);
    part->volume_step = part->volume_share - next.volume_share;
    next = *part;
  }
  FrontCell cell{};
  std::copy(view.node.begin(), view.node.end(), cell.node);
  double mu_sum = 0;
  for (int p = 0; p < 8; ++p) {
    if (view.point[p] < 0) continue;
    const Material& material = body.material_of(s.points, view.point[p]);
    const double volume = elastic_volume(s.points, view.point[p]);
    cell.mu[p] = static_cast<float>(lame_mu(material) * volume);
    cell.lambda[p] = static_cast<float>(lame_lambda(material) * volume);
    mu_sum += cell.mu[p];
  }
  const double size = body.cell_size * body.cell_size * body.cell_size;
  cell.viscosity[0] = static_cast<float>(view.of_block / size);
  cell.viscosity[1] = static_cast<float>(view.viscosity * view.volume / size);
  cell.stabilised = view.count < kSteadyCount ? static_cast<float>(kStabilisation * mu_sum) : 0.0f;
  cell.inverse_size = static_cast<float>(1 / body.cell_size);
  cell.law = view.law;
  cell.body = number;
  cell.first = static_cast<std::int32_t>(front.parts.size());
  cell.count = static_cast<std::int32_t>(view.parts.size());
  front.cells.push_back(cell);
  front.parts.insert(front.parts.end(), view.parts.begin(), view.parts.end());
}

/// Where the forces on nodes, or parted ones, are to be found: place i is that of node_of(i), of so
/// many places. `sum_of` is 0 for all of them, before and after.
template <class NodeOf, class PlaceOf>
void list_sums(std::size_t places, const NodeOf& node_of, const PlaceOf& place_of,
               std::vector<std::int32_t>& sum_of, std::vector<Front::Sum>& sums,
               std::vector<std::int32_t>& to) {
  sums.clear();
  for (std::size_t i = 0; i < places; ++i) {
    std::int32_t& sum = sum_of[node_of(i)];
    if (sum == 0) {
      sums.push_back({node_of(i), 0, 0});
      sum = static_cast<std::int32_t>(sums.size());  // one more than its place
    }
    ++sums[sum - 1].first;  // how many it has, for now
  }
  std::int32_t first = 0;
  for (Front::Sum& sum : sums) {
    const std::int32_t count = sum.first;
    sum.first = first;
    first += count;
  }
  to.resize(places);
  for (std::size_t i = 0; i < places; ++i) {
    Front::Sum& sum = sums[sum_of[node_of(i)] - 1];
    to[sum.first + sum.count++] = static_cast<std::int32_t>(place_of(i));
  }
  for (const Front::Sum& sum : sums) sum_of[sum.node] = 0;
}

constexpr int kSumsTogether = 64;  // sums that are gone through at a time

}  // namespace

void list_front_cells(BlockTissue& s) {
  Front& front = s.front;
  front.cells.clear();
  front.parts.clear();
  front.number.resize(s.nodes.size(), -1);
  front.counted.resize(s.nodes.size(), 0);
  std::vector<std::array<std::int32_t, 4>> cells;  // body, z, y, x
  cells.reserve(27 * front.nodes.size());
  for (std::size_t i = 0; i < front.nodes.size(); ++i) {
    const FrontNode& n = front.nodes[i];
    front.number[n.node] = static_cast<std::int32_t>(i);
    for (int k = 0; k < 27; ++k) {
      cells.push_back({n.body, n.z + k / 9 - 1, n.y + k / 3 % 3 - 1, n.x + k % 3 - 1});
    }
  }
  std::sort(cells.begin(), cells.end());
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
  std::vector<std::vector<CellView>> views(cells.size());
  s.cpu->for_each(
      static_cast<int>(cells.size()),
      [&](int i) {
        const auto& [body, z, y, x] = cells[i];
        views[i] = views_of(s, front.number, s.bodies[body], x, y, z);
      },
      16);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    for (CellView& view : views[i]) add_front_cell(s, s.bodies[cells[i][0]], cells[i][0], view);
  }
  for (const FrontNode& n : front.nodes) front.number[n.node] = -1;
  list_sums(
      27 * front.cells.size(), [&](std::size_t i) { return front.cells[i / 27].node[i % 27]; },
      [](std::size_t i) { return kFrontForce * (i / 27) + 4 * (i % 27); }, front.counted,
      front.node_sums, front.node_places);
  list_sums(
      front.parts.size(), [&](std::size_t i) { return front.parts[i].node; },
      [](std::size_t i) { return 4 * i; }, front.counted, front.part_sums, front.part_places);
  front.force.assign(kFrontForce * front.cells.size(), 0.0f);
  front.pull.assign(4 * front.parts.size(), 0.0f);
}

FrontField front_field(const LatticeTissue& s) {
  FrontField f;
  for (int a = 0; a < 3; ++a) {
    f.u[a] = s.nodes.u[a].data();
    f.v[a] = s.nodes.v[a].data();
    f.d[a] = s.front.d[a].data();
    f.rate[a] = s.front.rate[a].data();
  }
  f.parts = s.front.parts.data();
  return f;
}

void work_on_front_cell(BlockTissue& s, int i) {
  const FrontCell& cell = s.front.cells[i];
  s.kernels->front(cell, front_field(s),
                   s.front.force.data() + static_cast<std::size_t>(kFrontForce) * i,
                   s.front.pull.data() + 4 * static_cast<std::size_t>(cell.first));
}

int front_moves(const Front& front) {
  const std::size_t sums = front.node_sums.size() + front.part_sums.size();
  return static_cast<int>((sums + kSumsTogether - 1) / kSumsTogether);
}

void move_front(LatticeTissue& s, const NodeStep& step, int i) {
  Front& front = s.front;
  const std::size_t nodes = front.node_sums.size(), sums = nodes + front.part_sums.size();
  const std::size_t begin = static_cast<std::size_t>(kSumsTogether) * i;
  for (std::size_t n = begin; n < std::min(sums, begin + kSumsTogether); ++n) {
    const bool of_node = n < nodes;
    const Front::Sum& sum = of_node ? front.node_sums[n] : front.part_sums[n - nodes];
    const std::int32_t* place =
        (of_node ? front.node_places.data() : front.part_places.data()) + sum.first;
    const float* from = of_node ? front.force.data() : front.pull.data();
    Vec<4> force = {};
    for (int k = 0; k < sum.count; ++k) force += load<4>(from + place[k]);
    for (int c = 0; c < 3; ++c) {
      if (of_node) {
        // The node was moved on as if this force were not: the step is linear in it.
        const float more = step.kick * s.nodes.inv_mass[sum.node] * force[c];
        s.nodes.v[c][sum.node] += more;
        s.nodes.u[c][sum.node] += step.dt * more;
      } else {
        float& rate = front.rate[c][sum.node];
        rate = step.keep * rate + step.kick / front.nodes[sum.node].mass * force[c];
        front.d[c][sum.node] += step.dt * rate;
      }
    }
  }
}

double front_elastic_energy(const BlockTissue& s) {
  double sum = 0;
  const FrontField field = front_field(s);
  for (const FrontCell& cell : s.front.cells) sum += s.kernels->front_energy(cell, field);
  return sum;
}

double front_kinetic_energy(const Front& front) {
  double sum = 0;
  for (std::size_t i = 0; i < front.nodes.size(); ++i) {
    for (int a = 0; a < 3; ++a) {
      sum += 0.5 * front.nodes[i].mass * front.rate[a][i] * front.rate[a][i];
    }
  }
  return sum;
}

}  // namespace tissue_sim
