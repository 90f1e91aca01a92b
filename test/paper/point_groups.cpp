#include "paper/point_groups.h"

#include <algorithm>

namespace tissue_sim {

PointGroups groups_of_links(UnionFind& linked) {
  PointGroups groups;
  groups.of_point.resize(linked.size());
  for (std::size_t p = 0; p < linked.size(); ++p) {
    const std::int32_t lowest = linked.root(static_cast<std::int32_t>(p));
    if (lowest == static_cast<std::int32_t>(p)) {  // comes before all others of its group
      groups.of_point[p] = static_cast<std::int32_t>(groups.count.size());
      groups.count.push_back(0);
    } else {
      groups.of_point[p] = groups.of_point[lowest];
    }
    ++groups.count[groups.of_point[p]];
  }
  return groups;
}

std::vector<std::int32_t> fragments_among(const PointGroups& groups, std::int32_t least,
                                          std::int32_t most) {
  std::vector<std::int32_t> fragments;
  for (std::size_t g = 0; g < groups.count.size(); ++g) {
    if (groups.count[g] >= least && groups.count[g] < most) {
      fragments.push_back(static_cast<std::int32_t>(g));
    }
  }
  return fragments;
}

void GroupReader::read(const std::int32_t* cell, const std::int32_t* label, std::int32_t labels,
                       std::int32_t* group_of, Part& part) {
  part.number.assign(labels, -1);
  part.labels.clear();
  part.count.clear();
  for (std::int32_t p = part.begin; p < part.end;) {
    const std::int32_t own = label[cell[p]], since = p;
    if (part.number[own] < 0) {
      part.number[own] = static_cast<std::int32_t>(part.labels.size());
      part.labels.push_back(own);
      part.count.push_back(0);
    }
    const std::int32_t group = part.number[own];
    group_of[p++] = group;
    for (; p + 4 <= part.end; p += 4) {  // mostly the next ones are of the same group
      const std::int32_t other = (label[cell[p]] ^ own) | (label[cell[p + 1]] ^ own) |
                                 (label[cell[p + 2]] ^ own) | (label[cell[p + 3]] ^ own);
      if (other != 0) break;
      for (int i = 0; i < 4; ++i) group_of[p + i] = group;
    }
    part.count[group] += p - since;
  }
}

void GroupReader::read(const std::vector<std::int32_t>& cell_of_point,
                       const std::vector<std::int32_t>& label_of_cell, std::int32_t labels,
                       Cpu& cpu, PointGroups& groups) {
  constexpr std::int32_t kLeast = 8192;  // points that are worth a thread
  const auto count = static_cast<std::int32_t>(cell_of_point.size());
  const int parts = std::min(cpu.threads(), 1 + count / kLeast);
  parts_.resize(parts);
  groups.of_point.resize(count);
  cpu.for_each(parts, [&](int i) {
    parts_[i].begin = static_cast<std::int32_t>(static_cast<std::int64_t>(count) * i / parts);
    parts_[i].end = static_cast<std::int32_t>(static_cast<std::int64_t>(count) * (i + 1) / parts);
    read(cell_of_point.data(), label_of_cell.data(), labels, groups.of_point.data(), parts_[i]);
  });
  // The first part's groups are numbered as all are; those of the others follow.
  groups.count = parts_[0].count;
  for (int i = 1; i < parts; ++i) {
    parts_[i].group.clear();
    for (std::size_t k = 0; k < parts_[i].labels.size(); ++k) {
      std::int32_t& number = parts_[0].number[parts_[i].labels[k]];
      if (number < 0) {
        number = static_cast<std::int32_t>(groups.count.size());
        groups.count.push_back(0);
      }
      groups.count[number] += parts_[i].count[k];
      parts_[i].group.push_back(number);
    }
  }
  cpu.for_each(parts - 1, [&](int i) {
    const Part& part = parts_[i + 1];
    std::int32_t* const group_of = groups.of_point.data();
    for (std::int32_t p = part.begin; p < part.end; ++p) group_of[p] = part.group[group_of[p]];
  });
}

}  // namespace tissue_sim
