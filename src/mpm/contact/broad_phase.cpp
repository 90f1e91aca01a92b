#include <algorithm>
#include <cmath>

#include "compute/simd.h"
#include "mpm/contact/face_contact.h"
#include "mpm/contact/face_search.h"

namespace tissue_sim {
namespace {

constexpr int kWidth = 4;
using Lanes = Vec<kWidth>;

Lanes lesser(Lanes a, Lanes b) { return a < b ? a : b; }
Lanes greater(Lanes a, Lanes b) { return a < b ? b : a; }

/// A box, of places or of normals. The fourth lane is 0.
struct VectorBox {
  Lanes min = {1e30f, 1e30f, 1e30f, 0}, max = {-1e30f, -1e30f, -1e30f, 0};

  void take(const VectorBox& other) {
    min = lesser(min, other.min);
    max = greater(max, other.max);
  }
  void take(const float (&x)[3], float margin) {
    const Lanes place = {x[0], x[1], x[2], 0}, around = {margin, margin, margin, 0};
    take({place - around, place + around});
  }
  bool meets(const VectorBox& other) const {
    return !any_negative<kWidth>(bits<kWidth>(other.max - min) | bits<kWidth>(max - other.min));
  }
};

/// Whether two normals, of a box each, may face each other.
bool may_face(const VectorBox& a, const VectorBox& b) {
  constexpr float kRounding = 1e-4f;
  const Lanes least =
      lesser(lesser(a.min * b.min, a.min * b.max), lesser(a.max * b.min, a.max * b.max));
  return !(least[0] + least[1] + least[2] > kFacing + kRounding);
}

/// Facets of a block that lie near one another and face the same way, side by side.
class Patch {
 public:
  static constexpr int kMost = 2 * kWidth;
  VectorBox box, normals;  ///< of what its facets sweep; of their normals

  bool has_room(const FacetMotion& f, float size) const {
    bool near = count_ < kMost;
    for (int a = 0; a < 3; ++a) near = near && std::fabs(f.x[a] - value_[3 + a][0]) < size;
    return near;
  }
  void add(const FacetMotion& f, float reach, std::int32_t facet) {
    for (int a = 0; a < 3; ++a) {
      value_[a][count_] = f.normal[a];
      value_[3 + a][count_] = f.x[a];
    }
    value_[6][count_] = reach;
    facet_[count_++] = facet;
    normals.take(f.normal, 0);
    constexpr float kRounding = 1.001f;
    box.take(f.x, kRounding * reach);
  }

  /// Adds the pairs of its facets with another's that face one another and whose boxes overlap, of
  /// each lower facet once where it is the same.
  void add_pairs(const Patch& other, std::vector<FacetPair>& pairs) const {
    for (int i = 0; i < count_; ++i) {
      for (int j = 0; j < other.count_; j += kWidth) {
        const auto at = [&other, j](int k) { return load<kWidth>(other.value_[k] + j); };
        // What has no normal, behind the end, faces nothing.
        Mask<kWidth> meets = ~bits<kWidth>(
            kFacing - (value_[0][i] * at(0) + value_[1][i] * at(1) + value_[2][i] * at(2)));
        const Lanes far = value_[6][i] + at(6);
        for (int a = 3; a < 6; ++a) {
          const Mask<kWidth> apart = bits<kWidth>(value_[a][i] - at(a)) & 0x7fffffff;
          meets &= bits<kWidth>(reinterpret_cast<Lanes>(apart) - far);
        }
        if (!any_negative<kWidth>(meets)) continue;
        for (int k = 0; k < kWidth; ++k) {
          const std::int32_t f = facet_[i], g = other.facet_[j + k];
          if (meets[k] < 0 && (this != &other || f < g)) {
            pairs.emplace_back(std::min(f, g), std::max(f, g));
          }
        }
      }
    }
  }

 private:
  int count_ = 0;
  float value_[7][kMost] = {};  // normal, place, reach
  std::int32_t facet_[kMost] = {};
};

/// The facets of a block that face most along one axis, up or down; debris or none of them.
struct CandidateSide {
  bool is_debris = false;
  std::vector<Patch> patches;
  VectorBox box, normals;  ///< of them all

  void add(const FacetMotion& f, float reach, std::int32_t facet, float size) {
    if (patches.empty() || !patches.back().has_room(f, size)) patches.emplace_back();
    patches.back().add(f, reach, facet);
  }
  void measure() {
    for (const Patch& p : patches) {
      box.take(p.box);
      normals.take(p.normals);
    }
  }
  void add_pairs(const CandidateSide& other, std::vector<FacetPair>& pairs) const {
    for (std::size_t i = 0; i < patches.size(); ++i) {
      const Patch& p = patches[i];
      if (!p.box.meets(other.box)) continue;
      for (std::size_t j = this == &other ? i : 0; j < other.patches.size(); ++j) {
        const Patch& q = other.patches[j];
        if (p.box.meets(q.box) && may_face(p.normals, q.normals)) p.add_pairs(q, pairs);
      }
    }
  }
};

constexpr int kSides = 6;  // of a block, for debris and for all else
constexpr int kOfBlock = 2 * kSides;

/// Which of a block's sides a facet is part of.
int side_of(const FacetMotion& f) {
  const float* n = f.normal;
  int axis = std::fabs(n[1]) > std::fabs(n[0]) ? 1 : 0;
  if (std::fabs(n[2]) > std::fabs(n[axis])) axis = 2;
  return 2 * axis + (n[axis] < 0 ? 1 : 0);
}

/// Sorts pairs by one of their two facets, of so many, by counting; what is equal stays in order.
template <class Key>
std::vector<FacetPair> sorted(const std::vector<FacetPair>& pairs, int count, const Key& key) {
  std::vector<std::int32_t> next(count + 1, 0);
  for (const FacetPair& pair : pairs) ++next[key(pair) + 1];
  for (int f = 0; f < count; ++f) next[f + 1] += next[f];
  std::vector<FacetPair> result(pairs.size());
  for (const FacetPair& pair : pairs) result[next[key(pair)]++] = pair;
  return result;
}

}  // namespace

std::vector<FacetPair> facing_pairs(const std::vector<FacetMotion>& facets,
                                    const std::vector<float>& reach,
                                    const std::vector<std::uint8_t>& is_debris,
                                    const std::vector<std::int32_t>& first_of_block, float patch,
                                    Cpu& cpu) {
  const int count = static_cast<int>(first_of_block.size()) - 1;
  std::vector<CandidateSide> sides(static_cast<std::size_t>(kOfBlock) * count);
  cpu.for_each(count, [&](int b) {
    CandidateSide* of_block = &sides[static_cast<std::size_t>(kOfBlock) * b];
    for (std::int32_t f = first_of_block[b]; f < first_of_block[b + 1]; ++f) {
      if (reach[f] == 0) continue;
      const int side = side_of(facets[f]) + (is_debris[f] != 0 ? kSides : 0);
      of_block[side].add(facets[f], reach[f], f, patch);
    }
    for (int i = 0; i < kOfBlock; ++i) {
      of_block[i].measure();
      of_block[i].is_debris = i >= kSides;
    }
  });
  std::vector<const CandidateSide*> order;  // of those that have any, along x
  for (const CandidateSide& side : sides) {
    if (!side.patches.empty()) order.push_back(&side);
  }
  std::sort(order.begin(), order.end(), [](const CandidateSide* a, const CandidateSide* b) {
    return a->box.min[0] < b->box.min[0];
  });
  std::vector<std::vector<FacetPair>> chunks(order.size());
  cpu.for_each(static_cast<int>(order.size()), [&](int i) {
    const CandidateSide& side = *order[i];
    for (std::size_t j = i; j < order.size(); ++j) {
      const CandidateSide& other = *order[j];
      if (other.box.min[0] > side.box.max[0]) break;
      if (side.is_debris && other.is_debris) continue;
      if (side.box.meets(other.box) && may_face(side.normals, other.normals)) {
        side.add_pairs(other, chunks[i]);
      }
    }
  });
  std::vector<FacetPair> pairs;
  for (const auto& chunk : chunks) pairs.insert(pairs.end(), chunk.begin(), chunk.end());
  const auto facet_count = static_cast<int>(facets.size());
  pairs = sorted(pairs, facet_count, [](const FacetPair& pair) { return pair.second; });
  return sorted(pairs, facet_count, [](const FacetPair& pair) { return pair.first; });
}

}  // namespace tissue_sim
