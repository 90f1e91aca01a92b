#include "mls/lanes.h"

#include <algorithm>
#include <array>

namespace tissue_sim {
namespace {

/// Lanes in use of all that a slot has, below which entries are faster.
constexpr double kFullEnough = 0.2;

constexpr int kHalf = kMlsChunk / 2;

struct Slot {
  int order;            // 0: for the first half of the lanes only, 1: for both, 2: for the second
  std::int32_t offset;  // of the neighbour from the node
};

}  // namespace

MlsLanes make_lanes(const MlsPairs& pairs, const Array<float>& place) {
  MlsLanes lanes;
  const std::int32_t n = pairs.nodes(), chunks = (n + kMlsChunk - 1) / kMlsChunk;
  lanes.at.assign(pairs.other.size(), -1);
  lanes.of_chunk.resize(chunks);
  std::vector<std::array<std::int32_t, 2>> in_halves;  // offset, half
  std::vector<Slot> slots;
  for (std::int32_t chunk = 0; chunk < chunks; ++chunk) {
    const std::int32_t begin = chunk * kMlsChunk, end = std::min(n, begin + kMlsChunk);
    in_halves.clear();
    for (std::int32_t i = begin; i < end; ++i) {
      for (std::int32_t e = pairs.begin[i]; e < pairs.begin[i + 1]; ++e) {
        in_halves.push_back({pairs.other[e] - i, (i - begin) / kHalf});
      }
    }
    const std::size_t entries = in_halves.size();
    std::sort(in_halves.begin(), in_halves.end());
    in_halves.erase(std::unique(in_halves.begin(), in_halves.end()), in_halves.end());
    slots.clear();
    for (std::size_t k = 0; k < in_halves.size(); ++k) {
      const bool both = k + 1 < in_halves.size() && in_halves[k + 1][0] == in_halves[k][0];
      slots.push_back({both ? 1 : 2 * in_halves[k][1], in_halves[k][0]});
      k += both ? 1 : 0;
    }
    MlsSlots& of = lanes.of_chunk[chunk];
    const auto first = static_cast<std::int32_t>(lanes.first.size());
    of = {first, first, first, first};
    // Halves are what is worked through.
    if (entries < kFullEnough * kHalf * static_cast<double>(in_halves.size())) {
      lanes.any_entries = true;
      continue;
    }
    if (slots.empty()) continue;
    lanes.any_slots = true;
    std::stable_sort(slots.begin(), slots.end(),
                     [](const Slot& a, const Slot& b) { return a.order < b.order; });
    for (const Slot& s : slots) {
      lanes.first.push_back(begin + s.offset);
      of.both += s.order < 1 ? 1 : 0;
      of.both_end += s.order < 2 ? 1 : 0;
      ++of.end;
    }
    for (std::int32_t i = begin; i < end; ++i) {
      for (std::int32_t e = pairs.begin[i]; e < pairs.begin[i + 1]; ++e) {
        const std::int32_t offset = pairs.other[e] - i;
        const auto is_it = [offset](const Slot& s) { return s.offset == offset; };
        const auto slot = std::find_if(slots.begin(), slots.end(), is_it) - slots.begin();
        lanes.at[e] = (first + static_cast<std::int32_t>(slot)) * kMlsChunk + (i - begin);
      }
    }
  }
  lanes.weight.assign(lanes.first.size() * kMlsChunk, 0.0f);
  put_weights(pairs, lanes);

  constexpr std::size_t kPage = 1024, kApart = 64;  // [floats]
  const std::size_t room = static_cast<std::size_t>(chunks + 2) * kMlsChunk;
  lanes.stride = (room + kPage - 1) / kPage * kPage + kApart;
  lanes.rows.assign(kMlsRows * lanes.stride, 0.0f);
  for (int a = 0; a < 3; ++a) {
    float* row = lanes.row(kMlsPlaceRow + a);
    for (std::int32_t i = 0; i < n; ++i) row[i] = place[4 * i + a];
  }
  return lanes;
}

void put_weights(const MlsPairs& pairs, MlsLanes& lanes) {
  const auto entries = static_cast<std::int32_t>(pairs.weight.size());
  for (std::int32_t e = 0; e < entries; ++e) put_weight(pairs, e, lanes);
}

}  // namespace tissue_sim
