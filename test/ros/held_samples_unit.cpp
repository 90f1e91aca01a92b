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
  for (int i = 0; i < 5; ++i) held.add(10 * i, static_cast<char>('a' + i), kNow);
  EXPECT_EQ(*held.first(kNow), 0);
  EXPECT_EQ(taken(held, 20), "abc");
  EXPECT_EQ(taken(held, 29), "");
  EXPECT_EQ(taken(held, 1000), "de");
  EXPECT_FALSE(held.first(kNow));
}

TEST(HeldSamples, WhatCameAfterItsFrameIsLate) {
  HeldSamples<char> held;
  held.add(10, 'a', kNow);
  EXPECT_EQ(taken(held, 20), "a");
  held.add(20, 'b', kNow);
  held.add(21, 'c', kNow);
  EXPECT_EQ(taken(held, 30), "b!c");
  held.begin();  // a reset
  held.add(25, 'd', kNow);
  EXPECT_EQ(taken(held, 30), "d");
}

TEST(HeldSamples, OneByOne) {
  HeldSamples<char> held;
  held.add(30, 'a', kNow);
  held.add(10, 'b', kNow);
  EXPECT_EQ(held.next(kNow)->second, 'a');
  EXPECT_EQ(held.next(kNow)->second, 'b');
  EXPECT_FALSE(held.next(kNow));
}

// A bag that loops: its poses may come before the clock says so.
TEST(HeldSamples, WhatComesOfTheNextLoopWaitsForIt) {
  HeldSamples<char> held;
  held.add(98 * kSecond, 'a', kNow);
  EXPECT_EQ(taken(held, 98 * kSecond), "a");
  held.add(99 * kSecond, 'b', kNow);
  held.add(10 * kSecond, 'c', kNow);
  held.add(11 * kSecond, 'd', kNow);
  EXPECT_EQ(taken(held, 100 * kSecond), "b");
  EXPECT_FALSE(held.first(kNow));
  held.restart(10 * kSecond);
  EXPECT_EQ(*held.first(kNow), 10 * kSecond);
  EXPECT_EQ(taken(held, 11 * kSecond), "cd");
}

TEST(HeldSamples, OfALoopThatBreaksOffNothingStays) {
  HeldSamples<char> held;
  held.add(98 * kSecond, 'a', kNow);
  held.add(99 * kSecond, 'b', kNow);
  held.restart(10 * kSecond);  // nothing of the next one has come yet
  EXPECT_FALSE(held.first(kNow));
  held.add(10 * kSecond, 'c', kNow);
  EXPECT_EQ(taken(held, 10 * kSecond), "c");
}

TEST(HeldSamples, AnArmWhoseOwnClockWasSetBackIsHeardAgain) {
  HeldSamples<char> held;
  held.add(98 * kSecond, 'a', kNow);
  EXPECT_EQ(taken(held, 98 * kSecond), "a");
  held.add(10 * kSecond, 'b', kNow);
  EXPECT_EQ(taken(held, 99 * kSecond, kNow + std::chrono::seconds(1)), "");
  EXPECT_EQ(taken(held, 99 * kSecond, kNow + std::chrono::seconds(4)), "b!");
}

TEST(HeldSamples, TheOldestIsDroppedWhereNobodyTakesAny) {
  HeldSamples<char> held;
  for (std::size_t i = 0; i < held.kMost; ++i) EXPECT_FALSE(held.add(i, 'a', kNow));
  EXPECT_TRUE(held.add(held.kMost, 'a', kNow));
  EXPECT_EQ(*held.first(kNow), 1);
}

}  // namespace
}  // namespace tissue_sim
