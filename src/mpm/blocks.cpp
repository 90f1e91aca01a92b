#include "mpm/blocks.h"

#include <algorithm>

#include "contact/known_facets.h"
#include "mpm/block_materials.h"
#include "mpm/block_sheets.h"

namespace tissue_sim {
namespace {

constexpr int kGap = 2;  ///< cells: a new run costs about as much as so many

void find_partial_cells(Block& block, const LatticeBody& b, const Points& points) {
  for (int i = 0; i < block.nz * block.stride; ++i) {
    const int z = i / block.stride, column = i % block.stride;
    int count = 0;
    double mu = 0;
    for (int s = 0; s < 8; ++s) {
      const std::size_t lane = (static_cast<std::size_t>(z) * 8 + s) * block.stride + column;
      const std::int32_t p = block.point[lane];
      if (p < 0) continue;
      ++count;
      mu += lame_mu(b.material_of(points, p)) * block.volume[lane];
    }
    if (count == 0 || count == 8) continue;
    block.partial.push_back({i, z * block.plane + block.cell[column], static_cast<float>(mu)});
  }
}

/// Runs of the cells that hold points in any z-plane, gaps of up to kGap cells bridged.
/// `holds` is [ny][nx].
std::vector<Block::Run> runs_of(const std::vector<bool>& holds, int nx, int ny) {
  std::vector<Block::Run> runs;
  int lane = 0;
  for (int y = 0; y < ny; ++y) {
    for (int x = 0; x < nx; ++x) {
      if (!holds[y * nx + x]) continue;
      Block::Run* last = runs.empty() || runs.back().y != y ? nullptr : &runs.back();
      if (last == nullptr || x - (last->x + last->count) > kGap) {
        runs.push_back({x, y, 0, lane});
        last = &runs.back();
      }
      lane += x + 1 - (last->x + last->count);
      last->count = x + 1 - last->x;
    }
  }
  return runs;
}

/// The block of a sheet, no larger than its points need.
Block make_block(const BlockRegion& r, const LatticeBody& b, const Points& points,
                 const Sheet& sheet) {
  int lo[3] = {1 << 30, 1 << 30, 1 << 30}, hi[3] = {-1, -1, -1};
  for (const CellShare& c : sheet.cells) {
    const int at[3] = {c.x, c.y, c.z};
    for (int a = 0; a < 3; ++a) {
      lo[a] = std::min(lo[a], at[a]);
      hi[a] = std::max(hi[a], at[a]);
    }
  }
  Block block;
  block.body = r.body;
  block.x = r.x + lo[0];
  block.y = r.y + lo[1];
  block.z = r.z + lo[2];
  block.nx = hi[0] - lo[0] + 1;
  block.ny = hi[1] - lo[1] + 1;
  block.nz = hi[2] - lo[2] + 1;
  std::vector<bool> holds(block.nx * block.ny, false);
  for (const CellShare& c : sheet.cells) holds[(c.y - lo[1]) * block.nx + c.x - lo[0]] = true;
  block.runs = runs_of(holds, block.nx, block.ny);
  lay_out(block);
  std::vector<int> lane_of(block.nx * block.ny, -1);
  for (const Block::Run& run : block.runs) {
    for (int i = 0; i < run.count; ++i) lane_of[run.y * block.nx + run.x + i] = run.lane + i;
  }
  for (const CellShare& c : sheet.cells) {
    const int column = lane_of[(c.y - lo[1]) * block.nx + c.x - lo[0]];
    for (int s = 0; s < 8; ++s) {
      if (c.point[s] < 0) continue;
      const std::size_t lane =
          (static_cast<std::size_t>(c.z - lo[2]) * 8 + s) * block.stride + column;
      block.volume[lane] = points.volume[c.point[s]];
      block.point[lane] = c.point[s];
    }
  }
  find_partial_cells(block, b, points);
  find_materials(block, b, points);
  block.node.assign(block.node_count(), b.node(block.x - 1, block.y - 1, block.z - 1));
  for (int z = 0; z < block.nz + 2; ++z) {
    for (int y = 0; y < block.ny + 2; ++y) {
      for (int x = 0; x < block.pitch; ++x) {
        const int local = z * block.plane + y * block.pitch + x;
        const int lattice_node = b.node(block.x + x - 1, block.y + y - 1, block.z + z - 1);
        block.node[local] = lattice_node;
        if (sheet.node.empty()) continue;
        const int n = ((lo[2] + z) * (r.ny + 2) + lo[1] + y) * (r.nx + 2) + lo[0] + x;
        if (sheet.node[n] == -1 || sheet.node[n] == lattice_node) continue;
        block.node[local] = sheet.node[n];
        block.split_nodes.push_back({local, sheet.node[n]});
      }
    }
  }
  return block;
}

/// Fills the region's blocks. `known` are the facets that it had, where they did not change.
void fill_region(BlockRegion& r, const std::vector<LatticeBody>& bodies, const Points& points,
                 const NodeFields& fields, const KnownFacets& known) {
  r.blocks.clear();
  const LatticeBody& b = bodies[r.body];
  for (const Sheet& sheet : sheets_of(r, b, points, fields)) {
    if (sheet.cells.empty()) continue;
    r.blocks.push_back(make_block(r, b, points, sheet));
    r.blocks.back().facets = facets_of(b, points, r.blocks.back(), known);
  }
}

/// Runs of columns that hold points, gaps of up to kGap bridged, long runs halved.
std::vector<std::pair<int, int>> x_runs(const LatticeBody& b, int y0, int ny, int z0, int nz,
                                        int longest) {
  std::vector<std::pair<int, int>> runs;
  for (int x = 0; x < b.nx; ++x) {
    bool any = false;
    for (int z = 2 * z0; z < 2 * (z0 + nz) && !any; ++z) {
      for (int y = 2 * y0; y < 2 * (y0 + ny) && !any; ++y) {
        any = b.point(2 * x, y, z) >= 0 || b.point(2 * x + 1, y, z) >= 0;
      }
    }
    if (!any) continue;
    if (!runs.empty() && x - runs.back().second <= 2 * kGap) {
      runs.back().second = x + 1;
    } else {
      runs.emplace_back(x, x + 1);
    }
  }
  std::vector<std::pair<int, int>> parts;
  for (const auto& [begin, end] : runs) {
    const int n = (end - begin + longest - 1) / longest;
    for (int i = 0; i < n; ++i) {
      parts.emplace_back(begin + (end - begin) * i / n, begin + (end - begin) * (i + 1) / n);
    }
  }
  return parts;
}

void connect_forces(Blocks& blocks, const std::vector<LatticeBody>& bodies, int node_count) {
  blocks.all.clear();
  blocks.force_size = 0;
  for (BlockRegion& r : blocks.regions) {
    for (Block& b : r.blocks) {
      b.force_offset = blocks.force_size;
      blocks.force_size += static_cast<std::size_t>(3) * b.node_count();
      blocks.all.push_back(&b);
    }
  }
  struct Entry {
    int row_node;  // first node of the lattice row
    RowPart part;
  };
  std::vector<Entry> entries;
  blocks.first_split_node = lattice_node_count(bodies);
  std::vector<std::pair<int, SplitNodePart>> split;
  for (const Block* block : blocks.all) {
    const LatticeBody& b = bodies[block->body];
    const std::size_t component = block->node_count();
    std::size_t next_split = 0;
    for (int z = 0; z < block->nz + 2; ++z) {
      for (int y = 0; y < block->ny + 2; ++y) {
        const int local = z * block->plane + y * block->pitch;
        const int row = b.node(-1, block->y + y - 1, block->z + z - 1);
        // A row without the nodes that this block sees split: parts between them.
        const Block::NodeSpan seen = block->node_rows[y];
        int begin = seen.begin;
        const auto add = [&](int end) {
          if (end > begin) {
            entries.push_back(
                {row,
                 {block->force_offset + local + begin, component, block->x + begin, end - begin}});
          }
        };
        while (next_split < block->split_nodes.size() &&
               block->split_nodes[next_split].local < local + block->pitch) {
          const Block::SplitNode& s = block->split_nodes[next_split++];
          if (s.local < local + seen.begin || s.local >= local + seen.end) continue;
          add(s.local - local);
          begin = s.local - local + 1;
          split.push_back({s.node, {block->force_offset + s.local, component}});
        }
        add(seen.end);
      }
    }
  }
  std::stable_sort(entries.begin(), entries.end(),
                   [](const Entry& a, const Entry& b) { return a.row_node < b.row_node; });
  blocks.rows.clear();
  blocks.row_parts.clear();
  for (std::size_t i = 0; i < entries.size();) {
    std::size_t end = i;
    int lo = 1 << 30, hi = 0;
    for (; end < entries.size() && entries[end].row_node == entries[i].row_node; ++end) {
      lo = std::min(lo, entries[end].part.begin);
      hi = std::max(hi, entries[end].part.begin + entries[end].part.count);
    }
    blocks.rows.push_back({entries[i].row_node + lo, hi - lo,
                           static_cast<int>(blocks.row_parts.size()), static_cast<int>(end - i)});
    for (; i < end; ++i) {
      blocks.row_parts.push_back(entries[i].part);
      blocks.row_parts.back().begin -= lo;
    }
  }
  std::stable_sort(split.begin(), split.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  blocks.split_node_parts.assign(node_count - blocks.first_split_node + 1, 0);
  blocks.split_parts.clear();
  for (const auto& [node, part] : split) {
    if (node < blocks.first_split_node) continue;
    ++blocks.split_node_parts[node - blocks.first_split_node + 1];
  }
  for (std::size_t i = 1; i < blocks.split_node_parts.size(); ++i) {
    blocks.split_node_parts[i] += blocks.split_node_parts[i - 1];
  }
  for (const auto& entry : split) blocks.split_parts.push_back(entry.second);
}

}  // namespace

Blocks make_blocks(const std::vector<LatticeBody>& bodies, const Points& points,
                   const NodeFields& fields, const BlockShape& shape) {
  Blocks blocks;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const LatticeBody& b = bodies[i];
    for (int z = 0; z < b.nz; z += shape.z) {
      for (int y = 0; y < b.ny; y += shape.y) {
        const int ny = std::min(shape.y, b.ny - y), nz = std::min(shape.z, b.nz - z);
        for (const auto& [begin, end] : x_runs(b, y, ny, z, nz, shape.x)) {
          BlockRegion r{static_cast<int>(i), begin, y, z, end - begin, ny, nz, {}};
          fill_region(r, bodies, points, fields, {});
          blocks.regions.push_back(std::move(r));
        }
      }
    }
  }
  connect_forces(blocks, bodies, lattice_node_count(bodies));
  return blocks;
}

void update_blocks(Blocks& blocks, const std::vector<LatticeBody>& bodies, const Points& points,
                   const NodeFields& fields, const std::vector<NodeFields::Cell>& cells,
                   int node_count, Cpu& cpu) {
  std::vector<bool> split(lattice_node_count(bodies), false);
  for (const NodeFields::Cell& c : cells) split[bodies[c.body].node(c.x, c.y, c.z)] = true;
  const auto touched = [&](const BlockRegion& r) {
    for (int z = r.z - 1; z <= r.z + r.nz; ++z) {
      for (int y = r.y - 1; y <= r.y + r.ny; ++y) {
        const int row = bodies[r.body].node(0, y, z);
        for (int x = r.x - 1; x <= r.x + r.nx; ++x) {
          if (split[row + x]) return true;
        }
      }
    }
    return false;
  };
  std::vector<Blocks::Origin> before;  // blocks of each region
  for (const BlockRegion& r : blocks.regions) {
    const int first = before.empty() ? 0 : before.back().end;
    before.push_back({first, first + static_cast<int>(r.blocks.size())});
  }
  std::vector<std::uint8_t> is_new(blocks.regions.size(), 0);
  cpu.for_each(static_cast<int>(blocks.regions.size()), [&](int i) {
    BlockRegion& r = blocks.regions[i];
    if (!touched(r)) return;
    is_new[i] = 1;
    const LatticeBody& b = bodies[r.body];
    fill_region(r, bodies, points, fields, {b, r, blocks.stale_facets});
    for (int z = r.z; z < r.z + r.nz; ++z) {
      for (int y = r.y; y < r.y + r.ny; ++y) {
        std::fill_n(blocks.stale_facets.begin() + b.node(r.x, y, z), r.nx, std::uint8_t{0});
      }
    }
  });
  blocks.origin.clear();
  for (std::size_t i = 0; i < blocks.regions.size(); ++i) {
    for (int b = 0; b < static_cast<int>(blocks.regions[i].blocks.size()); ++b) {
      const int same = before[i].begin + b;
      blocks.origin.push_back(is_new[i] != 0 ? before[i] : Blocks::Origin{same, same + 1});
    }
  }
  connect_forces(blocks, bodies, node_count);
}

}  // namespace tissue_sim
