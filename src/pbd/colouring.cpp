#include "pbd/colouring.h"

#include <algorithm>
#include <stdexcept>

namespace tissue_sim {
namespace pbd {
namespace {

/// Which colours each vertex has: rows of bits that grow together.
class Taken {
 public:
  explicit Taken(int vertices) : count_(vertices), bits_(vertices) {}
  void take(std::int32_t vertex, int colour) {
    while (colour >= 64 * words_) grow();
    bits_[static_cast<std::size_t>(vertex) * words_ + colour / 64] |= std::uint64_t{1}
                                                                      << colour % 64;
  }
  int first_free(const std::int32_t* vertices, int n) const {
    for (int w = 0; w < words_; ++w) {
      std::uint64_t taken = 0;
      for (int i = 0; i < n; ++i) {
        if (vertices[i] >= 0) taken |= bits_[static_cast<std::size_t>(vertices[i]) * words_ + w];
      }
      if (~taken != 0) return 64 * w + __builtin_ctzll(~taken);
    }
    return 64 * words_;
  }

 private:
  void grow() {
    std::vector<std::uint64_t> wider(static_cast<std::size_t>(count_) * (words_ + 1));
    for (int v = 0; v < count_; ++v) {
      std::copy_n(bits_.begin() + static_cast<std::ptrdiff_t>(v) * words_, words_,
                  wider.begin() + static_cast<std::ptrdiff_t>(v) * (words_ + 1));
    }
    bits_.swap(wider);
    ++words_;
  }
  int count_, words_ = 1;
  std::vector<std::uint64_t> bits_;
};

/// Gives those that have none the first colour that is free, in the order given. Returns the number
/// of colours.
int first_fit(Span<const std::int32_t> vertices, int per_constraint,
              const std::vector<std::int32_t>& order, Taken& taken,
              std::vector<std::int16_t>& colour) {
  int count = 0;
  for (const std::int32_t c : order) {
    const std::int32_t* of = &vertices[static_cast<std::size_t>(c) * per_constraint];
    const int free = taken.first_free(of, per_constraint);
    if (free > 30000) {
      throw std::invalid_argument(
          "a vertex has more than 30000 constraints: the mesh has a fan that no solver can share "
          "out, remesh it");
    }
    colour[c] = static_cast<std::int16_t>(free);
    for (int i = 0; i < per_constraint; ++i) {
      if (of[i] >= 0) taken.take(of[i], free);
    }
    count = std::max(count, free + 1);
  }
  return count;
}

}  // namespace

int find_colours(Span<const std::int32_t> vertices, int per_constraint, int vertex_count,
                 std::vector<std::int16_t>& colour, int most_rounds) {
  Taken taken(vertex_count);
  int count = 0;
  std::vector<std::int32_t> order;
  std::vector<std::uint8_t> is_asked(vertex_count, 0);  // of vertices
  for (std::size_t c = 0; c < colour.size(); ++c) {
    count = std::max<int>(count, colour[c] + 1);
    if (colour[c] >= 0) continue;
    order.push_back(static_cast<std::int32_t>(c));
    for (int i = 0; i < per_constraint; ++i) {
      const std::int32_t v = vertices[c * per_constraint + i];
      if (v >= 0) is_asked[v] = 1;
    }
  }
  const bool is_new = order.size() == colour.size();
  for (std::size_t c = 0; c < colour.size() && !is_new && !order.empty(); ++c) {
    if (colour[c] < 0) continue;
    for (int i = 0; i < per_constraint; ++i) {
      const std::int32_t v = vertices[c * per_constraint + i];
      if (v >= 0 && is_asked[v] != 0) taken.take(v, colour[c]);
    }
  }
  count = std::max(count, first_fit(vertices, per_constraint, order, taken, colour));
  if (!is_new || order.empty()) return count;
  // Colours taken in another order, those of one class together, need no more than before, and
  // often fewer (Culberson 1992).
  const auto rounds = std::min(most_rounds, static_cast<int>(2 + 1000000 / order.size()));
  for (int round = 0; round < rounds; ++round) {
    std::vector<int> size(count, 0), rank(count);
    for (const std::int16_t c : colour) ++size[c];
    for (int c = 0; c < count; ++c) rank[c] = c;
    std::stable_sort(rank.begin(), rank.end(),
                     [&](int a, int b) { return round % 3 == 2 ? size[a] > size[b] : a > b; });
    std::vector<int> place(count);
    for (int k = 0; k < count; ++k) place[rank[k]] = k;
    std::stable_sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
      return place[colour[a]] < place[colour[b]];
    });
    Taken none(vertex_count);
    count = first_fit(vertices, per_constraint, order, none, colour);
  }
  return count;
}

}  // namespace pbd
}  // namespace tissue_sim
