#include "mls/cut.h"

#include <algorithm>
#include <cstring>

#include "mls/crossing.h"
#include "mls/faces.h"

namespace tissue_sim {
namespace {

/// Touched nodes that a thread works on at a time.
constexpr int kNodesAtATime = 256;

/// How many common neighbours a pair has, and how many to which both have an uncrossed pair.
struct Common {
  int all = 0, whole = 0;
};

/// The neighbours of a node, marked by number: to look at several of its pairs.
class Marked {
 public:
  explicit Marked(const MlsPairs& pairs) : pairs_(pairs), is_(pairs.nodes(), 0) {}
  void mark(std::int32_t i) {
    for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) {
      is_[pairs_.other[e]] = pairs_.crossed[e] == 0 ? kWhole | kIs : kIs;
    }
  }
  void clear(std::int32_t i) {
    for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) is_[pairs_.other[e]] = 0;
  }
  /// With the marked node.
  Common common_neighbours(std::int32_t j) const {
    Common common;
    for (std::int32_t e = pairs_.begin[j]; e < pairs_.begin[j + 1]; ++e) {
      const unsigned is = is_[pairs_.other[e]];
      common.all += static_cast<int>(is & kIs);
      common.whole += static_cast<int>(is >> 1 & (pairs_.crossed[e] == 0 ? 1u : 0u));
    }
    return common;
  }

 private:
  static constexpr unsigned kIs = 1, kWhole = 2;
  const MlsPairs& pairs_;
  std::vector<std::uint8_t> is_;
};

/// The numbers at which marks are set, in order.
std::vector<std::int32_t> marked(const std::vector<std::uint8_t>& marks) {
  std::vector<std::int32_t> at;
  for (std::size_t first = 0; first < marks.size(); first += 8) {
    const std::size_t last = std::min(marks.size(), first + 8);
    std::uint64_t any = 0;
    std::memcpy(&any, &marks[first], last - first);
    for (std::size_t i = first; i < last && any != 0; ++i) {
      if (marks[i] != 0) at.push_back(static_cast<std::int32_t>(i));
    }
  }
  return at;
}

}  // namespace

std::vector<std::int32_t> mark_crossed(MlsState& s, const std::vector<std::int32_t>& entries,
                                       const std::vector<float>& places, CutReport& report) {
  MlsPairs& p = s.pairs;
  std::vector<std::uint8_t> is_touched(s.count(), 0);
  std::vector<std::int32_t> twins(entries.size());
  for (std::size_t k = 0; k < entries.size(); ++k) {
    twins[k] = p.twin[entries[k]];
    __builtin_prefetch(&p.crossed[twins[k]], 1);
    __builtin_prefetch(&p.other[twins[k]]);
  }
  for (std::size_t k = 0; k < entries.size(); ++k) {
    const std::int32_t e = entries[k], twin = twins[k];
    if (p.crossed[e] != 0) continue;
    const float place = places.empty() ? 0.5f : places[k];
    p.crossed[e] = mark_of_crossing(place);
    p.crossed[twin] = mark_of_crossing(1 - place);
    ++report.bonds_broken;
    is_touched[p.other[e]] = is_touched[p.other[twin]] = 1;
  }
  std::vector<std::int32_t> touched = marked(is_touched);
  report.points_separated += static_cast<int>(touched.size());
  for (const std::int32_t i : touched) expose(s, i);
  return touched;
}

std::vector<std::int32_t> weaken(MlsState& s, const std::vector<std::int32_t>& touched) {
  if (touched.empty()) return {};
  MlsPairs& p = s.pairs;
  std::vector<std::uint8_t> is_touched(s.count(), 0);
  for (const std::int32_t i : touched) is_touched[i] = 1;
  // Pairs of a touched node: of any other, all common neighbours are as they were.
  const int count = static_cast<int>(touched.size()),
            blocks = (count + kNodesAtATime - 1) / kNodesAtATime;
  std::vector<std::vector<std::int32_t>> fallen(blocks);
  s.cpu->for_each(blocks, [&](int block) {
    Marked neighbours(p);
    for (int k = block * kNodesAtATime; k < std::min(count, (block + 1) * kNodesAtATime); ++k) {
      const std::int32_t i = touched[k];
      neighbours.mark(i);
      for (std::int32_t e = p.begin[i]; e < p.begin[i + 1]; ++e) {
        if (p.crossed[e] == 0) continue;
        const std::int32_t j = p.other[e];
        if (j < i && is_touched[j] != 0) continue;  // its turn comes with j
        const Common common = neighbours.common_neighbours(j);
        const float left = common.all > 0 ? std::min(1.0f, 2.0f * common.whole / common.all) : 0.0f;
        const float weight = left * p.whole[e];
        if (weight == p.weight[e]) continue;
        p.weight[e] = p.weight[p.twin[e]] = weight;
        put_weight(p, e, s.lanes);
        put_weight(p, p.twin[e], s.lanes);
        fallen[block].push_back(i);
        fallen[block].push_back(j);
      }
      neighbours.clear(i);
      if (touches_by_faces(s)) remake_face(s, i);
    }
  });
  // Those beside a cut have less that bears strain, even where all weights are left.
  std::vector<std::uint8_t> has_fallen = is_touched;
  for (const auto& some : fallen) {
    for (const std::int32_t i : some) has_fallen[i] = 1;
  }
  std::vector<std::int32_t> remade = marked(has_fallen);
  remake(s, remade);
  return remade;
}

void cross_entries(MlsState& s, const std::vector<std::int32_t>& entries,
                   const std::vector<float>& places, std::vector<std::int32_t>& changed,
                   CutReport& report) {
  const std::vector<std::int32_t> touched = mark_crossed(s, entries, places, report);
  changed.insert(changed.end(), touched.begin(), touched.end());
  weaken(s, touched);
}

void cross_pairs(MlsState& s, const BladePath& path, const float* u_begin, const float* u_end,
                 std::vector<std::int32_t>& changed, CutReport& report) {
  std::vector<float> places;
  const std::vector<std::int32_t> crossed = find_crossed(s, path, u_begin, u_end, &places);
  cross_entries(s, crossed, places, changed, report);
}

}  // namespace tissue_sim
