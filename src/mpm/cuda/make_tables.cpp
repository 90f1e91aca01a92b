#include "mpm/cuda/make_tables.h"

#include <algorithm>
#include <unordered_map>
#include <utility>

#include "mpm/tear/tear.h"

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
  body.density = static_cast<float>(m.density);
  body.neo_hookean = m.law == Law::kNeoHookean ? 1 : 0;
  return body;
}

/// The column of cells of a lane of the host's: the GPU's lanes are all cells of the box, the CPU's
/// those that hold points.
int column_of_lane(const Block& from, int lane) {
  return from.cell[lane] / from.pitch * from.nx + from.cell[lane] % from.pitch;
}

/// A layer of the block's points in the GPU's order, into the tables; `first_lane` is the block's.
/// Returns whether all of them are there, each of `whole_volume`.
bool fill_layer(const Block& from, int z, float whole_volume, int first_lane, HostTables& t) {
  const int columns = from.nx * from.ny, first = first_lane + z * 8 * columns;
  std::int32_t* point = t.made.point.data() + first;
  float* volume = t.made.volume.data() + first;
  std::fill_n(point, 8 * columns, -1);
  std::fill_n(volume, 8 * columns, 0.0f);
  const std::size_t layer = static_cast<std::size_t>(z) * 8 * from.stride;
  for (int lane = 0; lane < from.stride; ++lane) {
    const int column = column_of_lane(from, lane);
    for (int s = 0; s < 8; ++s) {
      const std::size_t i = layer + static_cast<std::size_t>(s) * from.stride + lane;
      if (from.point[i] < 0) continue;
      point[s * columns + column] = from.point[i];
      volume[s * columns + column] = from.volume[i];
    }
  }
  bool whole = true;
  for (int i = 0; i < 8 * columns; ++i) {
    whole = whole && point[i] >= 0 && volume[i] == whole_volume;
  }
  return whole;
}

void fill_partial(const Block& from, int first_lane, HostTables& t) {
  const int columns = from.nx * from.ny;
  float* partial = t.made.partial.data() + first_lane / 8;
  std::fill_n(partial, from.nz * columns, 0.0f);
  for (const Block::PartialCell& cell : from.partial) {
    partial[cell.lane / from.stride * columns + column_of_lane(from, cell.lane % from.stride)] =
        cell.mu;
  }
}

/// The volume that most points have: that of a whole one, as the lattice rounded it.
float common_volume(const MpmState& state, int body) {
  const LatticeBody& b = state.bodies[body];
  return b.point_count == 0 ? 0.0f : state.points.volume[b.first_point + b.point_count / 2];
}

/// The columns of a block that hold points.
std::vector<int> filled_columns(const Block& from) {
  std::vector<std::uint8_t> holds(from.nx * from.ny, 0);
  for (int lane = 0; lane < from.stride; ++lane) {
    if (from.filled_columns[lane] != 0) holds[column_of_lane(from, lane)] = 1;
  }
  std::vector<int> columns;
  for (int i = 0; i < from.nx * from.ny; ++i) {
    if (holds[i] != 0) columns.push_back(i);
  }
  return columns;
}

/// The block without what its points tell.
CudaBlock block_at(const MpmState& state, const Block& from, int first_slot, int first_lane,
                   const HostTables& t) {
  CudaBlock block = {};
  block.body = t.first_material[from.body] + from.material;
  block.nx = from.nx;
  block.ny = from.ny;
  block.nz = from.nz;
  block.first_slot = first_slot;
  block.first_lane = first_lane;
  block.partial = from.partial.empty() ? 0 : 1;
  const Vec3 origin = state.bodies[from.body].node_position(from.x - 1, from.y - 1, from.z - 1);
  for (int a = 0; a < 3; ++a) block.origin[a] = static_cast<float>(origin[a]);
  return block;
}

void fill_slots(const Block& from, const CudaBlock& block, std::int32_t* to) {
  for (int z = 0; z < block.nz + 2; ++z) {
    for (int y = 0; y < block.ny + 2; ++y) {
      const int* row = from.node.data() + z * from.plane + y * from.pitch;
      to = std::copy_n(row, block.nx + 2, to);
    }
  }
}

/// Where each block has its slots and lanes, the bundles' one after the other.
void lay_out(const MpmState& state, const std::vector<std::vector<int>>& bundles, HostTables& t) {
  std::unordered_map<int, int> before;  // place of each block in `t`, by its number
  for (std::size_t i = 0; i < t.number.size(); ++i) before[t.number[i]] = static_cast<int>(i);
  const std::vector<CudaBlock> blocks = std::move(t.blocks);
  t.blocks.clear();
  t.of_host.clear();
  t.number.clear();
  t.origin.clear();
  t.first_slot.resize(state.blocks.all.size());
  int slots = 0, lanes = 0, new_slots = 0, new_lanes = 0;
  for (const std::vector<int>& bundle : bundles) {
    for (const int index : bundle) {
      const Block& from = *state.blocks.all[index];
      CudaBlock b = block_at(state, from, slots, lanes, t);
      const int block_lanes = 8 * b.nx * b.ny * b.nz;
      t.first_slot[index] = slots;
      slots += b.slots();
      lanes += block_lanes;
      const auto known = before.find(from.number);
      if (known != before.end()) {
        const CudaBlock& same = blocks[known->second];
        b.whole = same.whole;
        t.origin.push_back({same.first_slot, same.first_lane, 0});
      } else {
        t.origin.push_back({new_slots, new_lanes, 1});
        new_slots += b.slots();
        new_lanes += block_lanes;
      }
      t.blocks.push_back(b);
      t.of_host.push_back(index);
      t.number.push_back(from.number);
    }
  }
  t.slots = slots;
  t.lanes = lanes;
  t.all_new = new_slots == slots;
  t.made.resize(new_slots, new_lanes);
}

/// Appends a bundle of `count` blocks from `first_block` on; `columns` of each block hold points.
void add_bundle(int first_block, int count, const std::vector<std::vector<int>>& columns,
                HostTables& t) {
  const CudaBlock& first = t.blocks[first_block];
  CudaBundle bundle = {};
  bundle.first_block = first_block;
  bundle.blocks = count;
  bundle.first_slot = first.first_slot;
  bundle.body = first.body;
  bundle.first_column = static_cast<int>(t.columns.size());
  for (int i = first_block; i < first_block + count; ++i) {
    const CudaBlock& b = t.blocks[i];
    bundle.columns += static_cast<int>(columns[i].size());
    // What a kernel knows by itself: column_of().
    const bool all = count == 1 && bundle.columns == b.nx * b.ny;
    for (const int column : all ? std::vector<int>() : columns[i]) {
      CudaColumn c = column_of(b, column);
      c.slot += b.first_slot - bundle.first_slot;
      c.plane_slot += bundle.plane_slots;
      t.columns.push_back(c);
    }
    bundle.slots += b.slots();
    bundle.plane_slots += (b.nx + 2) * (b.ny + 2);
    bundle.nz = std::max(bundle.nz, b.nz);
    bundle.partial = bundle.partial | b.partial;
  }
  t.max_columns = std::max(t.max_columns, count == 1 ? first.nx * first.ny : bundle.columns);
  t.max_slots = std::max(t.max_slots, bundle.slots);
  t.max_plane_slots = std::max(t.max_plane_slots, bundle.plane_slots);
  t.bundles.push_back(bundle);
}

}  // namespace

void make_tables(const MpmState& state, const std::vector<std::vector<int>>& bundles,
                 HostTables& t) {
  t.bodies.clear();
  t.first_material.clear();
  for (std::size_t i = 0; i < state.bodies.size(); ++i) {
    t.first_material.push_back(static_cast<int>(t.bodies.size()));
    for (const Material& m : state.bodies[i].materials) {
      t.bodies.push_back(body_of(state.bodies[i], m));
      t.bodies.back().point_volume = common_volume(state, static_cast<int>(i));
    }
  }
  lay_out(state, bundles, t);
  std::vector<std::vector<int>> columns(t.blocks.size());
  struct Layer {
    int block, z;
  };
  std::vector<Layer> layers;  // of new blocks
  for (std::size_t i = 0; i < t.blocks.size(); ++i) {
    CudaBlock& block = t.blocks[i];
    if (t.origin[i].is_new == 0) continue;
    block.whole = 1;
    for (int z = 0; z < block.nz; ++z) layers.push_back({static_cast<int>(i), z});
  }
  std::vector<std::uint8_t> whole(layers.size());
  state.cpu->for_each(static_cast<int>(layers.size()), [&](int i) {
    const auto& [index, z] = layers[i];
    const float volume = t.bodies[t.blocks[index].body].point_volume;
    whole[i] =
        fill_layer(*state.blocks.all[t.of_host[index]], z, volume, t.origin[index].first_lane, t)
            ? 1
            : 0;
  });
  for (std::size_t i = 0; i < layers.size(); ++i) t.blocks[layers[i].block].whole &= whole[i];
  state.cpu->for_each(static_cast<int>(t.blocks.size()), [&](int i) {
    const Block& from = *state.blocks.all[t.of_host[i]];
    const CudaBlockOrigin& origin = t.origin[i];
    columns[i] = filled_columns(from);
    if (origin.is_new == 0) return;
    fill_partial(from, origin.first_lane, t);
    fill_slots(from, t.blocks[i], t.made.slot_node.data() + origin.first_slot);
  });
  t.bundles.clear();
  t.columns.clear();
  t.max_slots = t.max_plane_slots = t.max_columns = 0;
  int first = 0, partial = 0, rank = 0;
  for (const std::vector<int>& blocks : bundles) {
    add_bundle(first, static_cast<int>(blocks.size()), columns, t);
    partial += t.bundles.back().partial != 0 ? 1 : 0;
    first += static_cast<int>(blocks.size());
  }
  // Those with partial cells take longer, and others push contacts for them; but of a body that
  // does not fill its box most have some.
  const bool most = 2 * partial > static_cast<int>(bundles.size());
  for (CudaBundle& bundle : t.bundles) bundle.rank = bundle.partial != 0 && !most ? -1 : rank++;
}

}  // namespace tissue_sim
