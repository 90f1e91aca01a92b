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

}  // namespace

int find_colours(const std::vector<std::int32_t>& vertices, int per_constraint, int vertex_count,
                 std::vector<std::int16_t>& colour) {
  Taken taken(vertex_count);
  int count = 0;
  for (std::size_t c = 0; c < colour.size(); ++c) {
    if (colour[c] < 0) continue;
    const std::int32_t* of = &vertices[c * per_constraint];
    for (int i = 0; i < per_constraint; ++i) {
      if (of[i] >= 0) taken.take(of[i], colour[c]);
    }
    count = std::max<int>(count, colour[c] + 1);
  }
  for (std::size_t c = 0; c < colour.size(); ++c) {
    if (colour[c] >= 0) continue;
    const std::int32_t* of = &vertices[c * per_constraint];
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

}  // namespace pbd
}  // namespace tissue_sim
