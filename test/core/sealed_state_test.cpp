// What a state is of is told where it is refused.
#include "frame/sealed_state.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace tissue_sim {
namespace {

std::string refusal(const StateOrigin& of, const StateOrigin& here) {
  const std::vector<std::uint8_t> sealed = seal_state(of, {1, 2, 3});
  try {
    const Span<const std::uint8_t> state = open_state({sealed.data(), sealed.size()}, here);
    return state.size() == 3 && state[2] == 3 ? "" : "another state";
  } catch (const std::runtime_error& e) {
    return e.what();
  }
}

TEST(SealedState, SaysWhatItIsOf) {
  const StateOrigin of{"name: a\ncell_size: 0.002\n", "cuda (NVIDIA H100)"};
  EXPECT_EQ(refusal(of, of), "");
  EXPECT_EQ(refusal(of, {of.scene, "cuda (NVIDIA A100)"}),
            "the state cannot be restored: it is of the device cuda (NVIDIA H100), this is cuda "
            "(NVIDIA A100)");
  EXPECT_EQ(refusal(of, {"name: a\ncell_size: 0.003\n", of.device}),
            "the state cannot be restored: it is of another scene, whose 'cell_size: 0.002' is "
            "'cell_size: 0.003' here: load that scene first");
}

}  // namespace
}  // namespace tissue_sim
