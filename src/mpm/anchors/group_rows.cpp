#include "mpm/anchors/group_rows.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

namespace tissue_sim {

void read_own(FaceRow& row) {
  const int own = static_cast<int>(std::max_element(row.share, row.share + kRowNodes) - row.share);
  for (int k = 0; k < kRowNodes; ++k) {
    if (row.weight[k] == 0) row.node[k] = row.node[own];
  }
}

namespace {

/// Divides rows, by their numbers in `all`, across the longest edge of their box until each part is
/// small enough.
void divide_rows(const std::vector<FaceRow>& all, std::vector<int> rows,
                 std::vector<std::vector<int>>& parts) {
  if (rows.size() <= kLargestGroup) {
    parts.push_back(std::move(rows));
    return;
  }
  Box box;
  for (const int i : rows) {
    const Vec3 x(all[i].place[0], all[i].place[1], all[i].place[2]);
    box.min = box.min.cwiseMin(x);
    box.max = box.max.cwiseMax(x);
  }
  int longest = 0;
  (box.max - box.min).maxCoeff(&longest);
  std::sort(rows.begin(), rows.end(), [&](int a, int b) {
    const float x = all[a].place[longest], y = all[b].place[longest];
    return x < y || (x == y && a < b);
  });
  const auto middle = rows.begin() + static_cast<std::ptrdiff_t>(rows.size() / 2);
  divide_rows(all, {rows.begin(), middle}, parts);
  divide_rows(all, {middle, rows.end()}, parts);
}

/// Rows with nodes in common, of which there are more than a group may have: parts of them, in each
/// of which rows do without the nodes that another part has more of. What is left of a row is held
/// at the face as a whole one is, but for a field that is linear it is off. A row of whose nodes
/// others have nearly all goes.
std::vector<std::vector<int>> divide_group(const std::vector<int>& members, const Nodes& nodes,
                                           std::vector<FaceRow>& all) {
  constexpr float kLeastLeft = 0.25f;
  std::vector<std::vector<int>> parts;
  divide_rows(all, members, parts);
  std::map<std::int32_t, std::map<std::size_t, float>> has;  // of each node, by part
  for (std::size_t p = 0; p < parts.size(); ++p) {
    for (const int i : parts[p]) {
      for (int k = 0; k < kRowNodes; ++k) {
        if (all[i].share[k] != 0) has[all[i].node[k]][p] += std::abs(all[i].weight[k]);
      }
    }
  }
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const auto falls_away = [&](int i) {
      FaceRow& row = all[i];
      float before = 0, left = 0;
      for (int k = 0; k < kRowNodes; ++k) {
        before += row.weight[k];
        if (row.share[k] != 0) {
          const std::map<std::size_t, float>& in = has[row.node[k]];
          const auto most =
              std::max_element(in.begin(), in.end(),
                               [](const auto& a, const auto& b) { return a.second < b.second; });
          if (most->first != p) row.weight[k] = row.share[k] = 0;
        }
        left += row.weight[k];
      }
      if (left < kLeastLeft * before) return true;
      for (int k = 0; k < kRowNodes; ++k) {
        row.weight[k] *= before / left;
        row.share[k] = row.share[k] == 0 ? 0 : row.weight[k] * nodes.inv_mass[row.node[k]];
      }
      read_own(row);
      return false;
    };
    parts[p].erase(std::remove_if(parts[p].begin(), parts[p].end(), falls_away), parts[p].end());
  }
  return parts;
}

}  // namespace

void group_rows(const Nodes& nodes, AnchorFaces& faces) {
  const int count = static_cast<int>(faces.rows.size());
  std::vector<int> parent(count);
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  std::map<std::int32_t, int> first_of;  // row of each node
  for (int i = 0; i < count; ++i) {
    for (int k = 0; k < kRowNodes; ++k) {
      if (faces.rows[i].share[k] == 0) continue;
      const auto [at, is_new] = first_of.emplace(faces.rows[i].node[k], i);
      if (is_new) continue;
      const int a = root(i), b = root(at->second);
      parent[std::max(a, b)] = std::min(a, b);
    }
  }
  std::vector<std::vector<int>> members(count);
  for (int i = 0; i < count; ++i) members[root(i)].push_back(i);
  for (int i = 0; i < count; ++i) {
    if (members[i].size() <= kLargestGroup) continue;
    const std::vector<std::vector<int>> parts = divide_group(members[i], nodes, faces.rows);
    members.insert(members.end(), parts.begin(), parts.end());
    members[i].clear();
  }
  std::vector<FaceRow> rows;
  faces.groups.clear();
  faces.inverse.clear();
  for (std::vector<int>& m : members) {
    if (m.empty()) continue;
    const int n = static_cast<int>(m.size());
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n, n);
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        const FaceRow &r = faces.rows[m[i]], &s = faces.rows[m[j]];
        for (int k = 0; k < kRowNodes * kRowNodes; ++k) {
          const int l = k / kRowNodes, m = k % kRowNodes;
          if (r.node[l] == s.node[m] && s.weight[m] != 0) {
            A(i, j) += static_cast<double>(r.share[l]) * s.weight[m];
          }
        }
      }
    }
    // Rows that say the same twice share what holds them.
    if (n > 1) A.diagonal() *= 1 + 1e-4;
    const Eigen::MatrixXd inverse = A.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
    faces.groups.push_back(
        {static_cast<int>(rows.size()), n, static_cast<int>(faces.inverse.size())});
    for (int i = 0; i < n * n; ++i)
      faces.inverse.push_back(static_cast<float>(inverse(i / n, i % n)));
    for (const int i : m) rows.push_back(faces.rows[i]);
  }
  faces.rows = std::move(rows);
}

}  // namespace tissue_sim
