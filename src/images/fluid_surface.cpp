#include "images/fluid_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "fluid/fluid_laws.h"

namespace tissue_sim {
namespace fluid_surface {  // of its own: these names are common
namespace {

/// Of a spacing: edge of the grid's cells, and how far a particle is seen.
constexpr float kCell = 0.7f, kReach = 2.0f;
/// Where the surface is, of a sum that is 1 deep inside: a drop alone is 0.4 at its middle.
constexpr float kLevel = 0.3f;
constexpr int kBlock = 8;

using Index = std::array<int, 3>;

struct Node {
  float sum = 0, slope[3] = {};
  float most = 0;           ///< of what one particle adds ...
  std::uint32_t point = 0;  ///< ... which one
};
struct Block {
  Node node[kBlock * kBlock * kBlock];
};

/// Nodes where there is fluid, by blocks; in order.
class Field {
 public:
  Node& at(const Index& i) {
    const Index b = {block_of(i[0]), block_of(i[1]), block_of(i[2])};
    if (last_ == nullptr || b != key_) {
      last_ = &blocks_[b];
      key_ = b;
    }
    return last_->node[place(i)];
  }
  const Node* find(const Index& i) {
    const Index b = {block_of(i[0]), block_of(i[1]), block_of(i[2])};
    if (found_ == nullptr || b != found_key_) {
      const auto it = blocks_.find(b);
      if (it == blocks_.end()) return nullptr;
      found_ = &it->second;
      found_key_ = b;
    }
    return &found_->node[place(i)];
  }
  const std::map<Index, Block>& blocks() const { return blocks_; }

 private:
  static int block_of(int i) { return i >= 0 ? i / kBlock : -((kBlock - 1 - i) / kBlock); }
  static int place(const Index& i) {
    const auto in = [](int k) { return k - kBlock * block_of(k); };
    return (in(i[2]) * kBlock + in(i[1])) * kBlock + in(i[0]);
  }
  std::map<Index, Block> blocks_;
  Block* last_ = nullptr;
  const Block* found_ = nullptr;
  Index key_ = {}, found_key_ = {};
};

struct Corner {
  float x[3], slope[3], sum;
  std::uint32_t point;
};

Corner between(const Corner& a, const Corner& b) {
  Corner c = a.sum > b.sum ? a : b;
  const float share = (kLevel - a.sum) / (b.sum - a.sum);
  for (int k = 0; k < 3; ++k) {
    c.x[k] = a.x[k] + share * (b.x[k] - a.x[k]);
    c.slope[k] = a.slope[k] + share * (b.slope[k] - a.slope[k]);
  }
  return c;
}

}  // namespace
}  // namespace fluid_surface

void make_fluid_surface(Span<const FluidPoint> points, double spacing, SceneView& view) {
  using namespace fluid_surface;  // NOLINT
  view.fluid.clear();
  view.fluid_normals.clear();
  view.fluid_kind.clear();
  view.fluid_colour.clear();
  if (points.size() == 0) return;
  const auto apart = static_cast<float>(spacing);
  const float cell = kCell * apart;
  const FluidKernel kernel{kReach * apart};
  const float volume = apart * apart * apart;
  Field field;
  for (std::size_t p = 0; p < points.size(); ++p) {
    const float x[3] = {points[p].x, points[p].y, points[p].z};
    Index low, high;
    for (int a = 0; a < 3; ++a) {
      // What flew so far off is not drawn.
      if (!(std::fabs(x[a]) < 1e6f * cell))
        low[a] = 1, high[a] = 0;
      else {
        low[a] = static_cast<int>(std::ceil((x[a] - kernel.reach) / cell));
        high[a] = static_cast<int>(std::floor((x[a] + kernel.reach) / cell));
      }
    }
    for (int k = low[2]; k <= high[2]; ++k) {
      for (int j = low[1]; j <= high[1]; ++j) {
        for (int i = low[0]; i <= high[0]; ++i) {
          const float d[3] = {i * cell - x[0], j * cell - x[1], k * cell - x[2]};
          const float r2 = dot3(d, d);
          if (r2 >= kernel.reach * kernel.reach) continue;
          const float r = std::sqrt(r2), add = volume * kernel.value(r);
          Node& node = field.at({i, j, k});
          node.sum += add;
          const float slope = volume * kernel.slope_by_r(r);
          for (int a = 0; a < 3; ++a) node.slope[a] += slope * d[a];
          if (add > node.most) node.most = add, node.point = static_cast<std::uint32_t>(p);
        }
      }
    }
  }
  // Each cube as six tetrahedra about its diagonal: no case is ambiguous.
  constexpr int kTets[6][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7},
                               {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
  const auto triangle = [&](const Corner& a, const Corner& b, const Corner& c) {
    for (const Corner* of : {&a, &b, &c}) {
      for (int k = 0; k < 3; ++k) {
        view.fluid.push_back(of->x[k]);
        view.fluid_normals.push_back(-of->slope[k]);
      }
    }
    view.fluid_kind.push_back(points[a.point].fluid);
    view.fluid_colour.push_back(points[a.point].rgb);
  };
  for (const auto& [key, block] : field.blocks()) {
    for (int n = 0; n < kBlock * kBlock * kBlock; ++n) {
      const Index first = {key[0] * kBlock + n % kBlock, key[1] * kBlock + n / kBlock % kBlock,
                           key[2] * kBlock + n / (kBlock * kBlock)};
      Corner cube[8];
      int inside = 0;
      for (int c = 0; c < 8; ++c) {
        const Index i = {first[0] + (c & 1), first[1] + (c >> 1 & 1), first[2] + (c >> 2)};
        static const Node none;
        const Node* node = field.find(i);
        if (node == nullptr) node = &none;
        for (int a = 0; a < 3; ++a) {
          cube[c].x[a] = i[a] * cell;
          cube[c].slope[a] = node->slope[a];
        }
        cube[c].sum = node->sum;
        cube[c].point = node->point;
        inside += node->sum > kLevel ? 1 : 0;
      }
      if (inside == 0 || inside == 8) continue;
      for (const auto& tet : kTets) {
        const Corner *in[4], *out[4];
        int ins = 0, outs = 0;
        for (const int c : tet) {
          if (cube[c].sum > kLevel)
            in[ins++] = &cube[c];
          else
            out[outs++] = &cube[c];
        }
        if (ins == 1) {
          triangle(between(*in[0], *out[0]), between(*in[0], *out[1]), between(*in[0], *out[2]));
        } else if (ins == 3) {
          triangle(between(*in[0], *out[0]), between(*in[1], *out[0]), between(*in[2], *out[0]));
        } else if (ins == 2) {
          const Corner a = between(*in[0], *out[0]), b = between(*in[0], *out[1]);
          const Corner c = between(*in[1], *out[0]), d = between(*in[1], *out[1]);
          triangle(a, b, c);
          triangle(c, b, d);
        }
      }
    }
  }
}

}  // namespace tissue_sim
