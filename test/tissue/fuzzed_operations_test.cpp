// Seeds of the fuzzer's operations that blew up once: light nodes of debris, whose substeps were
// accepted although their energy grew, or although a block that was not measured yet had no number,
// or that an anchor's face holds at one place, about which they whirled.
#include <gtest/gtest.h>

#include <cstdint>
#include <cstdlib>

#include "fuzz/operations_fuzz.cpp"

namespace tissue_sim {
namespace {

TEST(FuzzedOperations, DoNotBlowUp) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  for (const std::uint64_t seed : {332, 397, 458}) {
    const auto run = [&] {
      LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(&seed), sizeof(seed));
      std::exit(0);  // it aborts where it finds something
    };
    EXPECT_EXIT(run(), testing::ExitedWithCode(0), "") << seed;
  }
}

}  // namespace
}  // namespace tissue_sim
