#include "compute/for_each.h"

#include <gtest/gtest.h>

#include <new>
#include <vector>

namespace tissue_sim {
namespace {

class SharedWorkOn : public ::testing::TestWithParam<int> {};

TEST_P(SharedWorkOn, IsDoneOnceAndBeforeWhatWaitsForIt) {
  Cpu cpu(GetParam());
  for (int n = 0; n < 200; n = 2 * n + 1) {
    for (const int grain : {1, 3, 32, 500}) {
      std::vector<int> first(n, 0), second(n, 0);
      SharedWork one(n, grain), other(n, 1);
      cpu.on_each_thread([&] {
        one.help([&](int i) { ++first[i]; });
        one.wait();
        other.help([&](int i) { second[i] += first[n - 1 - i]; });
      });
      EXPECT_EQ(first, std::vector<int>(n, 1)) << n << " by " << grain;
      EXPECT_EQ(second, std::vector<int>(n, 1)) << n << " by " << grain;
    }
  }
}

TEST_P(SharedWorkOn, LeavesNobodyWaitingForWhatThrew) {
  Cpu cpu(GetParam());
  SharedWork one(100, 1), other(100, 1);
  const auto run = [&] {
    cpu.on_each_thread([&] {
      one.help([](int i) {
        if (i == 50) throw std::bad_alloc();
      });
      one.wait();
      other.help([](int) {});
    });
  };
  EXPECT_THROW(run(), std::bad_alloc);
}

INSTANTIATE_TEST_SUITE_P(Threads, SharedWorkOn, ::testing::Values(1, 2, 5));

}  // namespace
}  // namespace tissue_sim
