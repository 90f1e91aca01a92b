// A surface in sections one behind the other: several workers project the constraints of a section
// each, and wait for one another three times a sweep instead of after each colour.
#pragma once

#include <cstdint>
#include <vector>

#include "pbd/pbd_state.h"

namespace tissue_sim {
namespace pbd {

/// What a worker has in its hands. kHome: a section. kAcross: what internal links join that lead
/// far from one section to another. kSeam: from the middle of a section to that of the next.
enum class Phase { kHome, kAcross, kSeam };
constexpr int kPhases = 3;

/// A sweep takes links, then bends, as any does: links at home, links across, links and bends of
/// seams, bends at home. In a phase a worker's constraints share no vertex with another's.
struct Sections {
  int count = 0;                             ///< of workers; 0 where a surface has no two sections
  std::vector<std::int16_t> owner[kPhases];  ///< of each vertex, in each phase
  /// Of each constraint: when. Constraints of a worker's pass share no vertex. Bends go on counting
  /// where links end.
  std::vector<std::int16_t> link_pass, bend_pass;
  /// First pass of links at home, across, of seams, of seams' bends, of bends at home; their
  /// number.
  int first[6] = {};

  Phase phase_of(int pass) const {
    if (pass < first[1] || pass >= first[4]) return Phase::kHome;
    return pass < first[2] ? Phase::kAcross : Phase::kSeam;
  }
};

/// `most` sections at most, of about as many vertices each. None where a surface is shorter than
/// eight edges, or a vertex has so many constraints that 32 passes of a phase do not suffice.
Sections find_sections(const State& s, int most);

}  // namespace pbd
}  // namespace tissue_sim
