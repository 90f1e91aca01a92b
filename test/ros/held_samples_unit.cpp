#include <gtest/gtest.h>

#include <string>

#include "ros/held_samples.h"

namespace tissue_sim {
namespace {

constexpr std::int64_t kSecond = 1000000000;
const WallTime kNow{std::chrono::hours(1)};

std::string taken(HeldSamples<char>& held, std::int64_t until, WallTime now = kNow) {
  std::string all;
  held.take(until, now, [&](std::int64_t, char sample, bool late) {
    all += sample;
    if (late) all += '!';
  });
  return all;
}

TEST(HeldSamples, AreTakenByTheirStamps) {
  HeldSamples<char> held;
  for (int i = 0; i < 5; ++i) held.add(10 * i, static_cast<char>('a' + i), kNow, 10 * i);
  EXPECT_EQ(*held.first(kNow), 0);
  EXPECT_EQ(taken(held, 20), "abc");
  EXPECT_EQ(taken(held, 29), "");
  EXPECT_EQ(taken(held, 1000), "de");
  EXPECT_FALSE(held.first(kNow));
}

TEST(HeldSamples, WhatCameAfterItsFrameIsLate) {
  HeldSamples<char> held;
  held.add(10, 'a', kNow, 10);
  EXPECT_EQ(taken(held, 20), "a");
  held.add(20, 'b', kNow, 20);
  held.add(21, 'c', kNow, 21);
  EXPECT_EQ(taken(held, 30), "b!c");
  held.begin();  // a reset
  held.add(25, 'd', kNow, 25);
  EXPECT_EQ(taken(held, 30), "d");
}

TEST(HeldSamples, OneByOne) {
  HeldSamples<char> held;
  held.add(30, 'a', kNow, 30);
  held.add(10, 'b', kNow, 10);
  std::string taken;
  const auto use = [&](std::int64_t, char sample, bool) { taken += sample; };
  for (const char* so_far : {"a", "ab", "ab"}) {
    held.take(kTakeNext, kNow, use);
    EXPECT_EQ(taken, so_far);
  }
}

// A bag that loops: its poses may come before the clock says so.
TEST(HeldSamples, WhatComesOfTheNextLoopWaitsForIt) {
  HeldSamples<char> held;
  held.add(98 * kSecond, 'a', kNow, 98 * kSecond);
  EXPECT_EQ(taken(held, 98 * kSecond), "a");
  held.add(99 * kSecond, 'b', kNow, 99 * kSecond);
  held.add(10 * kSecond, 'c', kNow, 10 * kSecond);
  held.add(11 * kSecond, 'd', kNow, 11 * kSecond);
  EXPECT_EQ(taken(held, 100 * kSecond), "b");
  EXPECT_FALSE(held.first(kNow));
  held.restart(100 * kSecond, 10 * kSecond);
  EXPECT_EQ(*held.first(kNow), 10 * kSecond);
  EXPECT_EQ(taken(held, 11 * kSecond), "cd");
}

TEST(HeldSamples, OfALoopThatBreaksOffNothingStays) {
  HeldSamples<char> held;
  held.add(98 * kSecond, 'a', kNow, 98 * kSecond);
  held.add(99 * kSecond, 'b', kNow, 99 * kSecond);
  held.restart(100 * kSecond, 10 * kSecond);  // nothing of the next one has come yet
  EXPECT_FALSE(held.first(kNow));
  held.add(10 * kSecond, 'c', kNow, 10 * kSecond);
  EXPECT_EQ(taken(held, 10 * kSecond), "c");
}

// Poses wait for their frames (pose_delay): those of the last second before a jump of 1.3 s are
// stamped within a second of the new time, but are of the old one.
TEST(HeldSamples, WhatWaitedAsTheClockJumpedBackIsForgotten) {
  const std::int64_t tenth = kSecond / 10;
  HeldSamples<char> held;
  for (int i = 0; i < 5; ++i) held.add((108 + i) * tenth, 'a', kNow, (108 + i) * tenth);
  held.restart(113 * tenth, 100 * tenth);
  EXPECT_FALSE(held.first(kNow));
  held.add(101 * tenth, 'b', kNow, 101 * tenth);
  EXPECT_EQ(taken(held, 101 * tenth), "b");
}

// roscpp's clock and the simulation's are heard by two threads.
TEST(HeldSamples, WhatCameAfterTheClockJumpedBackStays) {
  HeldSamples<char> held;
  held.add(112 * kSecond, 'a', kNow, 112 * kSecond);
  EXPECT_EQ(taken(held, 112 * kSecond), "a");
  held.add(kSecond * 1111 / 10, 'b', kNow, kSecond * 1111 / 10 + 5);
  held.restart(113 * kSecond, kSecond * 1111 / 10);
  EXPECT_EQ(taken(held, 112 * kSecond), "b");
}

TEST(HeldSamples, AnArmWhoseOwnClockWasSetBackIsHeardAgain) {
  HeldSamples<char> held;
  held.add(98 * kSecond, 'a', kNow, 98 * kSecond);
  EXPECT_EQ(taken(held, 98 * kSecond), "a");
  held.add(10 * kSecond, 'b', kNow, 10 * kSecond);
  EXPECT_EQ(taken(held, 99 * kSecond, kNow + std::chrono::seconds(1)), "");
  EXPECT_EQ(taken(held, 99 * kSecond, kNow + std::chrono::seconds(4)), "b!");
}

TEST(HeldSamples, TheOldestIsDroppedWhereNobodyTakesAny) {
  HeldSamples<char> held;
  for (std::size_t i = 0; i < held.kMost; ++i) EXPECT_FALSE(held.add(i, 'a', kNow, i));
  EXPECT_TRUE(held.add(held.kMost, 'a', kNow, held.kMost));
  EXPECT_EQ(*held.first(kNow), 1);
}

}  // namespace
}  // namespace tissue_sim
