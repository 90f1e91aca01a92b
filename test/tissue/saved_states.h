// A run that is saved now and then: saving changes nothing, the same run saves the same bytes, and
// each state goes on with the same bits in a new simulation. Where one does not, what differs is
// said by the names of a state's parts.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "compute/archive.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {

using Bytes = std::vector<std::uint8_t>;

inline Span<const std::uint8_t> view(const Bytes& bytes) { return {bytes.data(), bytes.size()}; }

/// The parts in which two states of tissue differ; empty where they do not.
inline std::string difference(const Bytes& a, const Bytes& b) {
  if (a == b) return "";
  std::string all;
  const std::vector<StatePart> parts = state_parts(view(a)), others = state_parts(view(b));
  for (std::size_t i = 0; i < std::min(parts.size(), others.size()); ++i) {
    const Span<const std::uint8_t> x = parts[i].bytes, y = others[i].bytes;
    const auto at = std::mismatch(x.begin(), x.begin() + std::min(x.size(), y.size()), y.begin());
    if (x.size() == y.size() && at.first == x.end()) continue;
    std::size_t bytes = 0;
    for (std::size_t k = 0; k < std::min(x.size(), y.size()); ++k) bytes += x[k] != y[k] ? 1 : 0;
    all += "'" + parts[i].name + "' from byte " + std::to_string(at.first - x.begin()) + " of " +
           std::to_string(x.size()) + " (" + std::to_string(y.size()) + "), " +
           std::to_string(bytes) + " in all; ";
  }
  return all.empty() ? "another number of parts" : all;
}

struct SavedRun {
  Scene scene;
  /// Gives the next frame its inputs.
  std::function<void(Simulation& simulation, std::int64_t frame)> inputs;
  int frames = 30, every = 6;  ///< saved before every so many
};

/// Runs it, and runs it again from each state. Returns the simulation that ran through.
inline std::unique_ptr<Simulation> go_on_from_states(const SavedRun& run) {
  const auto advance = [&run](Simulation& simulation) {
    run.inputs(simulation, simulation.frame());
    simulation.advance_frame();
  };
  std::vector<std::uint64_t> checksums;
  Simulation never_saved(run.scene);
  for (int i = 0; i < run.frames; ++i) {
    advance(never_saved);
    checksums.push_back(never_saved.tissue().checksum());
  }
  auto whole = std::make_unique<Simulation>(run.scene);
  Simulation same(run.scene);
  std::vector<Bytes> saved, states;  // of the simulation; of its tissue, before each frame
  for (int i = 0; i < run.frames; ++i) {
    if (i % run.every == 0) {
      saved.push_back(whole->save());
      EXPECT_TRUE(saved.back() == same.save()) << "the same run saves other bytes, frame " << i;
    }
    states.push_back(whole->tissue().save());
    EXPECT_EQ(difference(states.back(), same.tissue().save()), "")
        << "of two equal runs, frame " << i;
    advance(*whole);
    advance(same);
    EXPECT_EQ(whole->tissue().checksum(), checksums[i]) << "saving changed it, frame " << i;
    if (testing::Test::HasFailure()) return whole;
  }
  states.push_back(whole->tissue().save());
  for (const Bytes& bytes : saved) {
    Simulation again(run.scene);
    again.restore(view(bytes));
    const std::int64_t begun = again.frame();
    EXPECT_EQ(difference(states[begun], again.tissue().save()), "")
        << "just restored, frame " << begun;
    while (again.frame() < run.frames && !testing::Test::HasFailure()) {
      advance(again);
      if (again.tissue().checksum() != checksums[again.frame() - 1]) {
        ADD_FAILURE() << "other bits in frame " << again.frame() << ", from " << begun << ": "
                      << difference(states[again.frame()], again.tissue().save());
      }
    }
    if (testing::Test::HasFailure()) break;
    EXPECT_EQ(again.time(), whole->time());
    EXPECT_EQ(difference(states.back(), again.tissue().save()), "") << "at the end, from " << begun;
    const Span<const Fragment> pieces = whole->tissue().fragments(),
                               now = again.tissue().fragments();
    EXPECT_EQ(now.size(), pieces.size());
    for (std::size_t i = 0; i < std::min(now.size(), pieces.size()); ++i) {
      EXPECT_EQ(now[i].centroid, pieces[i].centroid);
      EXPECT_EQ(now[i].parent, pieces[i].parent);
    }
  }
  return whole;
}

}  // namespace tissue_sim
