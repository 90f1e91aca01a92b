// Pieces are told apart by their colours, whatever their ids.
#include "fragments/piece_colour.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tissue_sim {
namespace {

std::uint32_t colour_of(int id) {
  Fragment f;
  f.id = id;
  f.loose = true;
  return piece_colour(f);
}

double apart(std::uint32_t a, std::uint32_t b) {
  double sum = 0;
  for (int shift = 0; shift < 24; shift += 8) {
    const double d = static_cast<double>((a >> shift) & 0xff) - ((b >> shift) & 0xff);
    sum += d * d;
  }
  return std::sqrt(sum);
}

TEST(PieceColour, LoosePiecesDifferFromOneAnotherAndFromTissueThatIsHeld) {
  for (int a = 0; a < 300; ++a) {
    EXPECT_GT(apart(colour_of(a), kTissueColour), 40) << a;
    for (int b = 0; b < a; ++b) {
      EXPECT_NE(colour_of(a), colour_of(b)) << a << ", " << b;
      if (a - b < 14) {
        EXPECT_GT(apart(colour_of(a), colour_of(b)), 60) << a << ", " << b;
      }
    }
  }
  EXPECT_EQ(colour_of(6), 0xcc79a7u) << "the first seven are as published";
  Fragment held;
  held.id = 9;
  EXPECT_EQ(piece_colour(held), kTissueColour);
}

TEST(PieceColour, HuesAreThoseOfHsv) {
  EXPECT_EQ(colour_of_hue(0, 1, 1), 0xff0000u);
  EXPECT_EQ(colour_of_hue(1.0 / 6, 1, 1), 0xffff00u);
  EXPECT_EQ(colour_of_hue(1.0 / 3, 1, 0.6), 0x009900u);
  EXPECT_EQ(colour_of_hue(2.0 / 3, 0.5, 1), 0x8080ffu);
  EXPECT_EQ(colour_of_hue(0.3, 0, 0.2), 0x333333u);
}

TEST(PieceColour, TintsGoToWhiteAndBlack) {
  EXPECT_EQ(tinted(0x123456, 0), 0x123456u);
  EXPECT_EQ(tinted(0x123456, 1), 0xffffffu);
  EXPECT_EQ(tinted(0x123456, -1), 0u);
  EXPECT_EQ(tinted(0x806040, 0.5), 0xc0b0a0u);
}

}  // namespace
}  // namespace tissue_sim
