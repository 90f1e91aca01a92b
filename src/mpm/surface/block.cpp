#include "mpm/surface/block.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tissue_sim {
namespace {

int padded(int n) { return (n + kLanes - 1) / kLanes * kLanes; }

}  // namespace

void lay_out(Block& block) {
  block.pitch = block.nx + 2;
  block.plane = padded((block.ny + 2) * block.pitch + 1);
  block.stride = padded(block.runs.back().lane + block.runs.back().count);
  block.cell.assign(block.stride, 0);
  for (const Block::Run& run : block.runs) {
    for (int i = 0; i < run.count; ++i) block.cell[run.lane + i] = run.y * block.pitch + run.x + i;
  }
}

void find_filled(Block& block) {
  block.filled.assign(block.nz, {});
  block.filled_columns.assign(block.stride, 0);
  for (int z = 0; z < block.nz; ++z) {
    const float* volume = block.volume.data() + static_cast<std::size_t>(z) * 8 * block.stride;
    for (int j = 0; j < block.stride; ++j) {
      int s = 0;
      while (s < 8 && volume[s * block.stride + j] <= 0) ++s;
      if (s == 8) continue;
      block.filled_columns[j] = 1;
      std::vector<Block::Span>& spans = block.filled[z];
      if (spans.empty() || spans.back().end < j) spans.push_back({j, j});
      spans.back().end = j + 1;
    }
  }
}

namespace {

/// The numbers of the materials that the block's points are of.
std::vector<int> materials_in(const Block& block, const Points& points, std::size_t count) {
  std::vector<bool> in(count, false);
  for (const std::int32_t p : block.point) {
    if (p >= 0) in[points.material_of(p)] = true;
  }
  std::vector<int> numbers;
  for (std::size_t i = 0; i < count; ++i) {
    if (in[i]) numbers.push_back(static_cast<int>(i));
  }
  return numbers;
}

}  // namespace

void find_materials(Block& block, const LatticeBody& body, const Points& points) {
  if (body.materials.size() == 1) return;  // block.material is 0
  const std::vector<int> numbers = materials_in(block, points, body.materials.size());
  block.material = numbers.size() == 1 ? numbers[0] : Block::kMixed;
  if (block.material != Block::kMixed) return;
  Block::Mixture& m = block.mixture;
  int of_law[2] = {};
  bool viscous = false;
  for (const int i : numbers) {
    ++of_law[body.materials[i].law == Law::kNeoHookean ? 1 : 0];
    viscous = viscous || body.materials[i].viscosity > 0;
  }
  m.law = of_law[1] > 0 ? Law::kNeoHookean : Law::kFixedCorotated;
  m.mu.assign(block.lane_count(), 0.0f);
  m.lambda.assign(block.lane_count(), 0.0f);
  if (of_law[0] > 0 && of_law[1] > 0) m.neo_hookean.assign(block.lane_count(), 0);
  if (viscous) m.viscosity.assign(static_cast<std::size_t>(block.nz) * block.stride, 0.0f);
  std::vector<double> filled(m.viscosity.size(), 0);  // share of each cell
  for (std::size_t lane = 0; lane < block.lane_count(); ++lane) {
    if (block.point[lane] < 0) continue;
    const Material& material = body.material_of(points, block.point[lane]);
    const double volume = block.volume[lane];
    m.mu[lane] = static_cast<float>(lame_mu(material) * volume);
    m.lambda[lane] = static_cast<float>(lame_lambda(material) * volume);
    if (!m.neo_hookean.empty() && material.law == Law::kNeoHookean) m.neo_hookean[lane] = -1;
    if (!viscous) continue;
    const std::size_t cell = lane / block.stride / 8 * block.stride + lane % block.stride;
    m.viscosity[cell] += static_cast<float>(material.viscosity * volume);
    filled[cell] += volume / std::pow(body.cell_size, 3);
  }
  for (std::size_t i = 0; i < m.viscosity.size(); ++i) {
    m.viscosity[i] *= static_cast<float>(filled[i]);
  }
}

}  // namespace tissue_sim
