#include "mls/cut.h"

#include <algorithm>
#include <cstring>

#include "mls/crossing.h"
#include "mls/faces.h"
#include "mls/remake.h"

namespace tissue_sim {
namespace {

/// Touched nodes that a thread works on at a time.
constexpr int kNodesAtATime = 128;

/// The neighbours of a node, marked by number: to look at several of its pairs.
class Marked {
 public:
  explicit Marked(const MlsPairs& pairs)
      : pairs_(pairs), is_(pairs.nodes(), 0), is_whole_(pairs.nodes(), 0) {}
  void mark(std::int32_t i) {
    for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) {
      is_[pairs_.other[e]] = 1;
      is_whole_[pairs_.other[e]] = pairs_.crossed[e] == 0 ? 1 : 0;
    }
  }
  void clear(std::int32_t i) {
    for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) {
      is_[pairs_.other[e]] = is_whole_[pairs_.other[e]] = 0;
    }
  }
  /// What is left of a crossed pair of the marked node: see cross_pairs().
  float left(std::int32_t j) const {
    const std::uint8_t *is = is_.data(), *is_whole = is_whole_.data(),
                       *crossed = pairs_.crossed.data();
    const std::int32_t *other = pairs_.other.data(), end = pairs_.begin[j + 1];
    unsigned all = 0, whole = 0;
    for (std::int32_t e = pairs_.begin[j]; e < end; ++e) {
      all += is[other[e]];
      whole += crossed[e] < is_whole[other[e]] ? 1 : 0;  // of uncrossed ones, 0
    }
    return all > 0 ? std::min(1.0f, 2.0f * static_cast<float>(whole) / static_cast<float>(all))
                   : 0.0f;
  }

 private:
  const MlsPairs& pairs_;
  std::vector<std::uint8_t> is_, is_whole_;
};

/// Has a node's entries brought from memory, which is what cuts wait for.
void prefetch_row(const MlsState& s, std::int32_t node) {
  const MlsPairs& p = s.pairs;
  const std::int32_t first = p.begin[node], last = p.begin[node + 1] - 1;
  if (last < first) return;
  __builtin_prefetch(&p.crossed[first]);
  for (const std::int32_t e : {first, last}) {
    __builtin_prefetch(&p.other[e]);
    __builtin_prefetch(&p.whole[e]);
    __builtin_prefetch(&p.weight[e], 1);
    __builtin_prefetch(&s.lanes.at[e]);
  }
}

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
  // Pairs of a touched node: of any other, all common neighbours are as they were. Of two touched
  // ones each works out its own entry, so that all that a node is made of lies together.
  constexpr int kAhead = 8;  // whose entries are asked for from memory
  const int count = static_cast<int>(touched.size()),
            blocks = (count + kNodesAtATime - 1) / kNodesAtATime;
  std::vector<std::vector<std::int32_t>> fallen(blocks);  // untouched
  const auto put = [&](std::int32_t e, float weight) {
    p.weight[e] = weight;
    put_weight(p, e, s.lanes);
  };
  s.cpu->for_each(blocks, [&](int block) {
    Marked neighbours(p);
    std::vector<std::int32_t> crossed;
    for (int k = block * kNodesAtATime; k < std::min(count, (block + 1) * kNodesAtATime); ++k) {
      const std::int32_t i = touched[k];
      if (k + kAhead < count) prefetch_row(s, touched[k + kAhead]);
      neighbours.mark(i);
      // Listed without a branch, for nothing foretells which are.
      crossed.resize(p.begin[i + 1] - p.begin[i] + 1);
      int listed = 0;
      for (std::int32_t e = p.begin[i]; e < p.begin[i + 1]; ++e) {
        crossed[listed] = e;
        listed += p.crossed[e] != 0 ? 1 : 0;
      }
      for (int c = 0; c < listed; ++c) {
        const std::int32_t e = crossed[c], j = p.other[e];
        const float left = neighbours.left(j), weight = left > 0 ? left * p.whole[e] : 0.0f;
        if (weight == p.weight[e]) continue;
        put(e, weight);
        if (is_touched[j] != 0) continue;
        put(p.twin[e], weight);
        fallen[block].push_back(j);
      }
      neighbours.clear(i);
      if (touches_by_faces(s)) remake_face(s, i);
      remake_support(s, i);
    }
  });
  std::vector<std::int32_t> more;
  for (const auto& some : fallen) more.insert(more.end(), some.begin(), some.end());
  std::sort(more.begin(), more.end());
  more.erase(std::unique(more.begin(), more.end()), more.end());
  s.cpu->for_each(
      static_cast<int>(more.size()), [&](int k) { remake_support(s, more[k]); }, 64);
  std::vector<std::int32_t> remade(touched.size() + more.size());
  std::merge(touched.begin(), touched.end(), more.begin(), more.end(), remade.begin());
  remake_springs(s, remade);
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
