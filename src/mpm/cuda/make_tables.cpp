#include "mpm/cuda/make_tables.h"

#include <algorithm>
#include <stdexcept>

#include "cutting/tear.h"

namespace tissue_sim {
namespace {

CudaBody body_of(const LatticeBody& b, const Material& m) {
  CudaBody body;
  body.cell_size = static_cast<float>(b.cell_size);
  body.inv_cell_size = 1.0f / body.cell_size;
  body.mu = static_cast<float>(lame_mu(m));
  body.lambda = static_cast<float>(lame_lambda(m));
  body.viscosity = static_cast<float>(m.viscosity);
  body.tear_stretch = least_tear_limit(m);
  body.point_volume = static_cast<float>(b.cell_size * b.cell_size * b.cell_size / 8);
  // Contact is in proportion to the volume, but a cubic millimetre is a better measure than a
  // metre.
  const float unit = body.point_volume;
  const ContactSpring spring =
      contact_spring(static_cast<float>(lame_lambda(m) + 2 * lame_mu(m)),
                     static_cast<float>(m.density), 0.5f * body.cell_size, unit);
  body.spring = {spring.stiffness / unit, spring.damping / unit};
  body.neo_hookean = m.law == Law::kNeoHookean ? 1 : 0;
  return body;
}

/// The block's points in the GPU's order.
void add_points(const Block& from, float whole_volume, CudaBlock& block, HostTables& t) {
  block.first_lane = static_cast<int>(t.point.size());
  // The GPU's lanes are all cells of the box, the CPU's those that hold points.
  const int columns = block.nx * block.ny;
  const std::size_t cells = static_cast<std::size_t>(block.nz) * columns;
  t.point.resize(t.point.size() + 8 * cells, -1);
  t.volume.resize(t.volume.size() + 8 * cells, 0.0f);
  t.partial.resize(t.partial.size() + cells, 0.0f);
  const auto cell_of = [&](int z, int lane) {
    const int y = from.cell[lane] / from.pitch, x = from.cell[lane] % from.pitch;
    return static_cast<std::size_t>(z) * columns + y * block.nx + x;
  };
  for (std::size_t lane = 0; lane < from.lane_count(); ++lane) {
    if (from.point[lane] < 0) continue;
    const int z = static_cast<int>(lane / from.stride / 8),
              s = static_cast<int>(lane / from.stride % 8);
    const std::size_t cell = cell_of(z, static_cast<int>(lane % from.stride)) % columns;
    const std::size_t to =
        block.first_lane + (static_cast<std::size_t>(z) * 8 + s) * columns + cell;
    t.point[to] = from.point[lane];
    t.volume[to] = from.volume[lane];
  }
  bool whole = true;
  for (std::size_t i = 0; i < 8 * cells; ++i) {
    whole = whole && t.point[block.first_lane + i] >= 0 &&
            t.volume[block.first_lane + i] == whole_volume;
  }
  block.whole = whole ? 1 : 0;
  block.partial = from.partial.empty() ? 0 : 1;
  for (const Block::PartialCell& cell : from.partial) {
    t.partial[block.first_lane / 8 + cell_of(cell.lane / from.stride, cell.lane % from.stride)] =
        cell.mu;
  }
}

/// The volume that most points have: that of a whole one, as the lattice rounded it.
float common_volume(const MpmState& state, int body) {
  const LatticeBody& b = state.bodies[body];
  return b.point_count == 0 ? 0.0f : state.points.volume[b.first_point + b.point_count / 2];
}

/// Which slots share a node, and which of them owns it.
void connect(std::size_t node_count, HostTables& t) {
  std::vector<std::uint32_t> begin(node_count + 1, 0);
  for (const std::int32_t n : t.slot_node) ++begin[n + 1];
  for (std::size_t n = 0; n < node_count; ++n) {
    if (begin[n + 1] > 63) {
      throw std::runtime_error("a node is shared by " + std::to_string(begin[n + 1]) +
                               " blocks, more than the GPU's tables hold: set device to cpu");
    }
    if (begin[n + 1] == 1) begin[n + 1] = 0;  // needs no list
    begin[n + 1] += begin[n];
  }
  if (begin.back() >= 1u << 25) {
    throw std::runtime_error(
        "the tissue has more shared nodes than the GPU's tables hold: raise "
        "cell_size");
  }
  t.parts.resize(begin.back());
  t.slot_parts.assign(t.slot_node.size(), 0);
  std::vector<std::uint8_t> filled(node_count, 0);
  for (std::size_t slot = 0; slot < t.slot_node.size(); ++slot) {
    const std::int32_t n = t.slot_node[slot];
    const std::uint32_t count = begin[n + 1] - begin[n];
    const bool first = filled[n] == 0;
    if (count > 0) {
      t.parts[begin[n] + filled[n]] = static_cast<std::uint32_t>(slot);
      t.slot_parts[slot] = begin[n] << 6 | count;
    }
    ++filled[n];
    if (!first) t.slot_node[slot] = ~n;
  }
}

/// The columns of the block that hold points, `first_slot` and `first_place` from the bundle's on.
void add_columns(const CudaBlock& b, float cell_size, int first_slot, int first_place,
                 HostTables& t) {
  const int step = b.nx * b.ny;
  for (int i = 0; i < step; ++i) {
    CudaColumn c = {};
    for (int k = 0; k < 8 * b.nz && c.nz == 0; ++k) {
      if (t.point[b.first_lane + k * step + i] >= 0) c.nz = b.nz;
    }
    if (c.nz == 0) continue;
    const int x = i % b.nx, y = i / b.nx;
    c.pitch = b.nx + 2;
    c.plane = c.pitch * (b.ny + 2);
    c.slot = first_slot + y * c.pitch + x;
    c.lane = b.first_lane + i;
    c.step = step;
    c.cell = b.first_lane / 8 + i;
    c.place = first_place + i;
    c.middle[0] = b.origin[0] + cell_size * static_cast<float>(x + 1);
    c.middle[1] = b.origin[1] + cell_size * static_cast<float>(y + 1);
    c.middle[2] = b.origin[2] + cell_size;
    c.whole = b.whole;
    t.columns.push_back(c);
  }
}

void add_block(const MpmState& state, int index, HostTables& t) {
  const Block& from = *state.blocks.all[index];
  CudaBlock block;
  block.body = t.first_material[from.body] + from.material;
  block.nx = from.nx;
  block.ny = from.ny;
  block.nz = from.nz;
  block.first_slot = static_cast<int>(t.slot_node.size());
  const Vec3 origin = state.bodies[from.body].node_position(from.x - 1, from.y - 1, from.z - 1);
  for (int a = 0; a < 3; ++a) block.origin[a] = static_cast<float>(origin[a]);
  add_points(from, t.bodies[block.body].point_volume, block, t);
  for (int z = 0; z < block.nz + 2; ++z) {
    for (int y = 0; y < block.ny + 2; ++y) {
      const int* row = from.node.data() + z * from.plane + y * from.pitch;
      t.slot_node.insert(t.slot_node.end(), row, row + block.nx + 2);
    }
  }
  t.blocks.push_back(block);
  t.of_host.push_back(index);
}

void add_bundle(const MpmState& state, const std::vector<int>& blocks, HostTables& t) {
  CudaBundle bundle = {};
  bundle.first_block = static_cast<int>(t.blocks.size());
  bundle.blocks = static_cast<int>(blocks.size());
  bundle.first_slot = static_cast<int>(t.slot_node.size());
  bundle.first_column = static_cast<int>(t.columns.size());
  for (const int index : blocks) {
    add_block(state, index, t);
    const CudaBlock& b = t.blocks.back();
    add_columns(b, t.bodies[b.body].cell_size, b.first_slot - bundle.first_slot, bundle.places, t);
    bundle.places += b.nx * b.ny;
    bundle.nz = std::max(bundle.nz, b.nz);
    bundle.partial = bundle.partial | b.partial;
  }
  bundle.body = t.blocks[bundle.first_block].body;
  bundle.slots = static_cast<int>(t.slot_node.size()) - bundle.first_slot;
  bundle.columns = static_cast<int>(t.columns.size()) - bundle.first_column;
  t.max_slots = std::max(t.max_slots, bundle.slots);
  t.max_halves = std::max(t.max_halves, 2 * bundle.columns * bundle.nz);
  t.bundles.push_back(bundle);
}

}  // namespace

HostTables make_tables(const MpmState& state, const std::vector<std::vector<int>>& bundles) {
  HostTables t;
  for (std::size_t i = 0; i < state.bodies.size(); ++i) {
    t.first_material.push_back(static_cast<int>(t.bodies.size()));
    for (const Material& m : state.bodies[i].materials) {
      t.bodies.push_back(body_of(state.bodies[i], m));
      t.bodies.back().point_volume = common_volume(state, static_cast<int>(i));
    }
  }
  for (const std::vector<int>& blocks : bundles) add_bundle(state, blocks, t);
  connect(state.nodes.size(), t);
  return t;
}

void pack_nodes(const Nodes& n, float4* u, float4* v) {
  for (std::size_t i = 0; i < n.size(); ++i) {
    u[i] = {n.u[0][i], n.u[1][i], n.u[2][i], n.mass[i]};
    v[i] = {n.v[0][i], n.v[1][i], n.v[2][i], n.inv_mass[i]};
  }
}

void unpack_nodes(const float4* u, const float4* v, Nodes& n) {
  for (std::size_t i = 0; i < n.size(); ++i) {
    n.u[0][i] = u[i].x, n.u[1][i] = u[i].y, n.u[2][i] = u[i].z;
    n.v[0][i] = v[i].x, n.v[1][i] = v[i].y, n.v[2][i] = v[i].z;
  }
}

}  // namespace tissue_sim
