// What a state of a GPU says beside the host's is checked before a kernel believes it. Needs none.
#include "mpm/cuda/state_on_host.h"

#include <gtest/gtest.h>

#include <functional>

namespace tissue_sim {
namespace {

constexpr KnownToDevice kKnown = {7, 4, 50, 8, 2};

/// Two contacts of four facets.
StateOnHost good() {
  StateOnHost s;
  s.held = {{7, 2, {}}};
  s.marks.resize(50);
  FacesOnHost& f = s.faces;
  f.version = 7;
  f.is_current = f.lists_hold = f.has_figures = true;
  f.spring_room = 4;
  f.near_room = 16;
  f.contacts_count = f.figures.contacts = 2;
  f.involved_count = f.figures.involved = 3;
  f.figures.near = 5;
  f.motion.resize(4);
  f.listed.resize(4);
  f.springs.resize(4);
  for (int i = 0; i < 4; ++i) f.springs[i].facet = i;
  f.springs[1].other = 3;
  f.contacts = {1, 3};
  f.involved = {0, 1, 3};
  f.near_count = {0, 2, 0, 1};
  f.near = {0, 3, 1};
  f.nodes.resize(2);
  for (CudaContactNodes& n : f.nodes) n = {};
  f.nodes[1].other[26] = 49;
  return s;
}

bool is_taken(const std::function<void(StateOnHost&)>& change) {
  StateOnHost s = good();
  change(s);
  try {
    check_state_on_host(s, kKnown);
  } catch (const std::runtime_error&) {
    return false;
  }
  return true;
}

TEST(StateOfAGpu, IsTakenAsItIsSaved) {
  EXPECT_TRUE(is_taken([](StateOnHost&) {}));
  EXPECT_TRUE(is_taken([](StateOnHost& s) {
    s.faces.searched = true;  // nodes are found by the next look
    s.faces.nodes.clear();
  })) << "searched";
  EXPECT_TRUE(is_taken([](StateOnHost& s) {
    const bool has_sites = s.faces.has_sites;
    s.faces = {};
    s.faces.has_sites = has_sites;
  })) << "before the first search";
}

TEST(StateOfAGpu, IsRefusedWhereAKernelWouldReadOrWriteBeyondAnArray) {
  const std::function<void(StateOnHost&)> changes[] = {
      [](StateOnHost& s) { s.held[0].entry = 8; },
      [](StateOnHost& s) { s.held[0].entry = -1; },
      [](StateOnHost& s) { s.held[0].with = 3; },
      [](StateOnHost& s) { s.marks.pop_back(); },
      [](StateOnHost& s) { s.faces.is_current = false; },
      [](StateOnHost& s) { s.faces.version = 6; },
      [](StateOnHost& s) { s.faces.spring_room = 5; },
      [](StateOnHost& s) { s.faces.near_room = std::uint64_t{1} << 40; },
      [](StateOnHost& s) { s.faces.near_room = 2; },
      [](StateOnHost& s) { s.faces.contacts_count = 3; },
      [](StateOnHost& s) { s.faces.contacts_count = -1; },
      [](StateOnHost& s) { s.faces.involved_count = 1000; },
      [](StateOnHost& s) { s.faces.figures.contacts = 1000; },
      [](StateOnHost& s) { s.faces.figures.involved = 4; },
      [](StateOnHost& s) { s.faces.figures.near = 2; },
      [](StateOnHost& s) { s.faces.figures.next_pair = 2; },
      [](StateOnHost& s) { s.faces.motion.pop_back(); },
      [](StateOnHost& s) { s.faces.listed.pop_back(); },
      [](StateOnHost& s) { s.faces.springs.pop_back(); },
      [](StateOnHost& s) { s.faces.springs[2].facet = 4; },
      [](StateOnHost& s) { s.faces.springs[1].other = 4; },
      [](StateOnHost& s) { s.faces.springs[1].other = -2; },
      [](StateOnHost& s) { s.faces.contacts[1] = 4; },
      [](StateOnHost& s) { s.faces.contacts[1] = 1; },
      [](StateOnHost& s) { s.faces.involved[0] = -1; },
      [](StateOnHost& s) { s.faces.near_count[0] = -1; },
      [](StateOnHost& s) { s.faces.near_count[0] = 1; },
      [](StateOnHost& s) { s.faces.near_count.pop_back(); },
      [](StateOnHost& s) { s.faces.near[1] = 4; },
      [](StateOnHost& s) { s.faces.near[1] = -1; },
      [](StateOnHost& s) { s.faces.nodes.pop_back(); },
      [](StateOnHost& s) { s.faces.nodes[0].own[3] = 50; },
      [](StateOnHost& s) { s.faces.nodes[0].other[3] = -1; },
  };
  for (std::size_t i = 0; i < std::size(changes); ++i) EXPECT_FALSE(is_taken(changes[i])) << i;
}

}  // namespace
}  // namespace tissue_sim
