// What each block of threads of section_steps.cu has to do, as one run of words that it copies to
// its shared memory.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <vector>

#include "pbd/cuda/device_state.h"
#include "pbd/cuda/spread_banks.h"
#include "pbd/sections.h"

namespace tissue_sim {
namespace pbd {

/// A constraint in 16 bytes, which a thread reads at once.
struct SectionItem {
  std::uint16_t vertex[4];
  float number[2];
};

struct SectionWords {
  std::vector<CudaPbdSection> of;
  std::vector<std::int32_t> words;
  int most_words = 0, most_own = 0;  ///< of a section
};

/// Vertices are fewer than 2^16, sections than 2^15.
inline SectionWords section_words(const State& s, const Sections& sections) {
  const int n = s.vertices.size(), passes = sections.first[5];
  const auto lists = static_cast<std::size_t>(sections.count) * passes;
  std::vector<std::vector<SectionItem>> items(lists);
  const auto add = [&](const auto& set, const std::vector<std::int16_t>& pass) {
    for (int c = 0; c < set.size(); ++c) {
      SectionItem item = {{0, 0, 0, 0}, {set.numbers[c][0], set.numbers[c][1]}};
      std::copy(set.vertices[c].begin(), set.vertices[c].end(), item.vertex);
      const int phase = static_cast<int>(sections.phase_of(pass[c]));
      const int block = sections.owner[phase][set.vertices[c][0]];
      items[static_cast<std::size_t>(block) * passes + pass[c]].push_back(item);
    }
  };
  add(s.links, sections.link_pass);
  add(s.bends, sections.bend_pass);
  SectionWords result;
  for (int b = 0; b < sections.count; ++b) {
    CudaPbdSection section = {};
    section.begin = static_cast<std::int32_t>(result.words.size());
    const auto here = [&] {
      return static_cast<std::int32_t>(result.words.size()) - section.begin;
    };
    std::int32_t count = 0;
    for (int p = 0; p <= passes; ++p) {
      result.words.push_back(count);
      if (p < passes) count += static_cast<std::int32_t>(items[b * passes + p].size());
    }
    section.own = here();
    for (int v = 0; v < n; ++v) {
      if (sections.owner[0][v] == b) result.words.push_back(v);
    }
    for (int phase = 0; phase < kPhases; ++phase) {
      section.moves[phase] = here();
      for (int v = 0; v < n; ++v) {
        const int to = sections.owner[(phase + 1) % kPhases][v];
        if (sections.owner[phase][v] == b && to != b) result.words.push_back(v | to << 16);
        section.incoming[phase] += sections.owner[phase][v] != b && to == b ? 1 : 0;
      }
    }
    section.moves[kPhases] = here();
    result.words.resize((result.words.size() + 3) / 4 * 4, 0);
    section.items = here();
    for (int p = 0; p < passes; ++p) {
      const std::vector<SectionItem>& of = items[b * passes + p];
      const auto vertex = [&](int k, int i) { return of[k].vertex[i]; };
      const auto count_of = static_cast<std::int32_t>(of.size());
      for (const std::int32_t k : p < sections.first[3] ? spread_order<2>(count_of, vertex)
                                                        : spread_order<4>(count_of, vertex)) {
        std::int32_t four[4];
        std::memcpy(four, &of[k], sizeof four);
        result.words.insert(result.words.end(), four, four + 4);
      }
    }
    section.words = here();
    result.most_words = std::max<int>(result.most_words, section.words);
    result.most_own = std::max<int>(result.most_own, section.moves[0] - section.own);
    result.of.push_back(section);
  }
  return result;
}

}  // namespace pbd
}  // namespace tissue_sim
