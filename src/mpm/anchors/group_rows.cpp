#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "math/union_find.h"
#include "mpm/anchors/anchor_faces.h"

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

/// Of an impulse in row j to the velocity that row i holds [1/kg].
double response(const FaceRow& r, const FaceRow& s) {
  double sum = 0;
  for (int k = 0; k < kRowNodes * kRowNodes; ++k) {
    const int l = k / kRowNodes, m = k % kRowNodes;
    if (r.node[l] == s.node[m] && s.weight[m] != 0) {
      sum += static_cast<double>(r.share[l]) * s.weight[m];
    }
  }
  return sum;
}

/// Adds a group of rows, `members` of `all`, behind those that are in `rows`.
void add_group(const std::vector<FaceRow>& all, const std::vector<int>& members,
               std::vector<FaceRow>& rows, AnchorFaces& faces) {
  const int n = static_cast<int>(members.size());
  faces.groups.push_back(
      {static_cast<int>(rows.size()), n, static_cast<int>(faces.inverse.size())});
  for (const int i : members) rows.push_back(all[i]);
  if (n == 1) {  // most are
    const double own = response(rows.back(), rows.back());
    faces.inverse.push_back(static_cast<float>(own > 0 ? 1 / own : 0));
    return;
  }
  Eigen::MatrixXd A(n, n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) A(i, j) = response(all[members[i]], all[members[j]]);
  }
  // Rows that say the same twice share what holds them.
  A.diagonal() *= 1 + 1e-4;
  const Eigen::MatrixXd inverse = A.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
  for (int i = 0; i < n * n; ++i) {
    faces.inverse.push_back(static_cast<float>(inverse(i / n, i % n)));
  }
}

}  // namespace

void group_rows(const Nodes& nodes, AnchorFaces& faces) {
  const int count = static_cast<int>(faces.rows.size());
  UnionFind linked(count);
  const auto root = [&](int i) { return linked.root(i); };
  std::vector<std::pair<std::int32_t, int>> rows_of;  // of each node
  for (int i = 0; i < count; ++i) {
    for (int k = 0; k < kRowNodes; ++k) {
      if (faces.rows[i].share[k] != 0) rows_of.emplace_back(faces.rows[i].node[k], i);
    }
  }
  std::sort(rows_of.begin(), rows_of.end());
  for (std::size_t i = 1; i < rows_of.size(); ++i) {
    if (rows_of[i].first == rows_of[i - 1].first) {
      linked.join(rows_of[i - 1].second, rows_of[i].second);
    }
  }
  std::vector<int> size(count, 0);
  for (int i = 0; i < count; ++i) ++size[root(i)];
  std::map<int, std::vector<int>> members;  // of groups of several rows, by the first
  for (int i = 0; i < count; ++i) {
    if (size[root(i)] > 1) members[root(i)].push_back(i);
  }
  std::vector<FaceRow> rows;
  faces.groups.clear();
  faces.inverse.clear();
  std::vector<std::vector<int>> parts;  // of groups that were too large
  for (int i = 0; i < count; ++i) {
    if (root(i) != i) continue;
    if (size[i] > kLargestGroup) {
      for (auto& part : divide_group(members[i], nodes, faces.rows)) parts.push_back(part);
    } else {
      add_group(faces.rows, size[i] > 1 ? members[i] : std::vector<int>{i}, rows, faces);
    }
  }
  for (const std::vector<int>& part : parts) {
    if (!part.empty()) add_group(faces.rows, part, rows, faces);
  }
  faces.rows = std::move(rows);
}

}  // namespace tissue_sim
