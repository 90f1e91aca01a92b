#include "mpm/fill_region.h"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "mpm/block_materials.h"
#include "mpm/block_sheets.h"
#include "mpm/crumbs.h"
#include "mpm/stabilisation.h"

namespace tissue_sim {
namespace {

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

/// Fills the block's nodes and rows of them.
void find_nodes(Block& block, const LatticeBody& b) {
  std::vector<Block::Span> seen(block.ny + 2, {block.pitch, 0});  // by the runs, in each row
  for (const Block::Run& run : block.runs) {
    for (int y = run.y; y < run.y + 3; ++y) {
      seen[y].begin = std::min(seen[y].begin, run.x);
      seen[y].end = std::max(seen[y].end, run.x + run.count + 2);
    }
  }
  block.node.assign(block.node_count(), -1);
  for (int z = 0; z < block.nz + 2; ++z) {
    for (int y = 0; y < block.ny + 2; ++y) {
      const int row = z * block.plane + y * block.pitch, x0 = block.x - 1;
      int next = seen[y].begin;
      const auto add = [&](int end, int node, int stretch) {
        if (end > next) block.node_rows.push_back({row + next, end - next, node, stretch});
        next = std::max(next, end);
      };
      b.for_each_node_in_row(x0, x0 + block.pitch, block.y + y - 1, block.z + z - 1,
                             [&](int x, int node, int count, int stretch) {
                               const int begin = x - x0, end = begin + count;
                               const auto to = block.node.begin() + row + begin;
                               std::iota(to, to + count, node);
                               add(std::min(begin, seen[y].end), -1, -1);
                               add(std::min(end, seen[y].end), node + next - begin, stretch);
                             });
      add(seen[y].end, -1, -1);
    }
  }
}

/// The block of a sheet, no larger than its points need.
Block make_block(const BlockRegion& r, const LatticeBody& b, const Points& points,
                 const Sheet& sheet) {
  int lo[3] = {1 << 30, 1 << 30, 1 << 30}, hi[3] = {-1, -1, -1};
  for (const CellShare& c : sheet.cells) {
    const int first[3] = {c.x, c.y, c.z}, last[3] = {c.x + c.cells - 1, c.y, c.z};
    for (int a = 0; a < 3; ++a) {
      lo[a] = std::min(lo[a], first[a]);
      hi[a] = std::max(hi[a], last[a]);
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
  for (const CellShare& c : sheet.cells) {
    std::fill_n(holds.begin() + (c.y - lo[1]) * block.nx + c.x - lo[0], c.cells, true);
  }
  block.runs = runs_of(holds, block.nx, block.ny);
  lay_out(block);
  std::vector<int> lane_of(block.nx * block.ny, -1);
  for (const Block::Run& run : block.runs) {
    for (int i = 0; i < run.count; ++i) lane_of[run.y * block.nx + run.x + i] = run.lane + i;
  }
  for (const CellShare& c : sheet.cells) {
    const int column = lane_of[(c.y - lo[1]) * block.nx + c.x - lo[0]], z = c.z - lo[2];
    double mu = 0;
    for (int s = 0; s < 8; ++s) {
      if (c.point[s] < 0) continue;
      const std::size_t lane = (static_cast<std::size_t>(z) * 8 + s) * block.stride + column;
      for (int i = 0; i < c.cells; ++i) {
        block.volume[lane + i] = elastic_volume(points, c.point[s] + 2 * i);
        block.point[lane + i] = c.point[s] + 2 * i;
      }
      if (c.count < kSteadyCount) {
        mu += lame_mu(b.material_of(points, c.point[s])) * block.volume[lane];
      }
    }
    if (c.count >= kSteadyCount) continue;
    block.partial.push_back(
        {z * block.stride + column, z * block.plane + block.cell[column], static_cast<float>(mu)});
  }
  find_filled(block);
  std::sort(block.partial.begin(), block.partial.end(),
            [](const auto& p, const auto& q) { return p.lane < q.lane; });
  find_materials(block, b, points);
  find_nodes(block, b);
  for (int z = 0; z < block.nz + 2 && !sheet.node.empty(); ++z) {
    for (int y = 0; y < block.ny + 2; ++y) {
      Block::SplitNodes* last = nullptr;  // of this row
      for (int x = 0; x < block.pitch; ++x) {
        const int local = z * block.plane + y * block.pitch + x;
        const int n = ((lo[2] + z) * (r.ny + 2) + lo[1] + y) * (r.nx + 2) + lo[0] + x;
        if (sheet.node[n] == -1 || sheet.node[n] == block.node[local]) continue;
        block.node[local] = sheet.node[n];
        if (last != nullptr && last->local + last->count == local &&
            last->node + last->count == sheet.node[n]) {
          ++last->count;
          continue;
        }
        block.split_nodes.push_back({local, sheet.node[n], 1});
        last = &block.split_nodes.back();
      }
    }
  }
  return block;
}

/// A sheet's points by their materials, in the order of these.
std::vector<Sheet> by_material(const Sheet& sheet, const LatticeBody& b, const Points& points) {
  std::vector<Sheet> parts(b.materials.size());
  for (const CellShare& of_run : sheet.cells) {
    for (int i = 0; i < of_run.cells; ++i) {
      CellShare c = of_run;
      c.cells = 1;
      c.x = static_cast<std::int16_t>(c.x + i);
      for (int s = 0; s < 8; ++s) {
        if (c.point[s] < 0) continue;
        const std::int32_t p = c.point[s] + 2 * i;
        std::vector<CellShare>& cells = parts[points.material_of(p)].cells;
        if (cells.empty() ||
            std::tie(cells.back().x, cells.back().y, cells.back().z) != std::tie(c.x, c.y, c.z)) {
          cells.push_back(c);
          std::fill_n(cells.back().point, 8, -1);
        }
        cells.back().point[s] = p;
      }
    }
  }
  for (Sheet& part : parts) part.node = sheet.node;
  return parts;
}

}  // namespace

void fill_region(BlockRegion& r, const std::vector<LatticeBody>& bodies, const Points& points,
                 const NodeFields& fields, bool one_material) {
  r.blocks.clear();
  const LatticeBody& b = bodies[r.body];
  const auto add = [&](const Sheet& sheet) {
    if (!sheet.cells.empty()) r.blocks.push_back(make_block(r, b, points, sheet));
  };
  for (const Sheet& sheet : sheets_of(r, b, points, fields)) {
    if (!one_material || b.materials.size() == 1) {
      add(sheet);
      continue;
    }
    for (const Sheet& part : by_material(sheet, b, points)) add(part);
  }
}

}  // namespace tissue_sim
