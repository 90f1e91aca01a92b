// Union-find: the connected components of a graph, edge by edge (Tarjan 1975).
#pragma once

#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

namespace tissue_sim {

/// The root of a component is its lowest node, whatever the order of the edges.
class UnionFind {
 public:
  explicit UnionFind(std::size_t nodes) : parent_(nodes) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  /// Each node with a node of its component that is no higher, from which the same leads to the
  /// lowest; itself at the lowest.
  explicit UnionFind(std::vector<std::int32_t> parent) : parent_(std::move(parent)) {}
  std::int32_t root(std::int32_t node) {
    while (parent_[node] != node) {
      parent_[node] = parent_[parent_[node]];
      node = parent_[node];
    }
    return node;
  }
  void join(std::int32_t a, std::int32_t b) {
    a = root(a), b = root(b);
    if (a < b) {
      parent_[b] = a;
    } else {
      parent_[a] = b;
    }
  }
  std::size_t size() const { return parent_.size(); }

 private:
  std::vector<std::int32_t> parent_;
};

}  // namespace tissue_sim
