#include "mpm/blocks.h"

#include <algorithm>

#include "contact/known_facets.h"
#include "mpm/fill_region.h"

namespace tissue_sim {
namespace {

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
  blocks.first_split_node = lattice_node_count(bodies);
  if (!blocks.has_rows) return;
  struct Entry {
    int row_node;  // first node of the lattice row
    RowPart part;
  };
  std::vector<Entry> entries;
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
        const Block::Span seen = block->node_rows[y];
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
                   const NodeFields& fields, const BlockShape& shape, Cpu& cpu) {
  Blocks blocks;
  blocks.one_material = shape.one_material;
  blocks.has_rows = shape.has_rows;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const LatticeBody& b = bodies[i];
    for (int z = 0; z < b.nz; z += shape.z) {
      for (int y = 0; y < b.ny; y += shape.y) {
        const int ny = std::min(shape.y, b.ny - y), nz = std::min(shape.z, b.nz - z);
        for (const auto& [begin, end] : x_runs(b, y, ny, z, nz, shape.x)) {
          blocks.regions.push_back({static_cast<int>(i), begin, y, z, end - begin, ny, nz, {}});
        }
      }
    }
  }
  cpu.for_each(static_cast<int>(blocks.regions.size()), [&](int i) {
    fill_region(blocks.regions[i], bodies, points, fields, shape.one_material, {});
  });
  connect_forces(blocks, bodies, lattice_node_count(bodies));
  return blocks;
}

void update_blocks(Blocks& blocks, const std::vector<LatticeBody>& bodies, const Points& points,
                   const NodeFields& fields, const std::vector<NodeFields::Cell>& cells,
                   int node_count, Cpu& cpu) {
  const auto touched = [&cells](const BlockRegion& r) {
    return std::any_of(cells.begin(), cells.end(), [&r](const NodeFields::Cell& c) {
      return c.body == r.body && c.x >= r.x - 1 && c.x <= r.x + r.nx && c.y >= r.y - 1 &&
             c.y <= r.y + r.ny && c.z >= r.z - 1 && c.z <= r.z + r.nz;
    });
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
    fill_region(r, bodies, points, fields, blocks.one_material, {b, r, blocks.stale_facets});
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
