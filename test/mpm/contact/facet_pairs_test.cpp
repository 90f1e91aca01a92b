// Facets that may meet: the search by patches finds the pairs that a look at all of them finds.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "mpm/contact/face_contact.h"
#include "mpm/contact/face_search.h"

namespace tissue_sim {
namespace {

std::vector<FacetPair> by_looking_at_all(const std::vector<FacetMotion>& facets,
                                         const std::vector<float>& reach,
                                         const std::vector<std::uint8_t>& is_debris) {
  std::vector<FacetPair> pairs;
  for (std::size_t i = 0; i < facets.size(); ++i) {
    for (std::size_t j = i + 1; j < facets.size(); ++j) {
      float cosine = 0;
      bool near = reach[i] > 0 && reach[j] > 0 && (is_debris[i] == 0 || is_debris[j] == 0);
      for (int a = 0; a < 3; ++a) {
        cosine += facets[i].normal[a] * facets[j].normal[a];
        near = near && std::fabs(facets[i].x[a] - facets[j].x[a]) < reach[i] + reach[j];
      }
      if (near && cosine <= kFacing) pairs.emplace_back(i, j);
    }
  }
  return pairs;
}

/// Facets all over a box; some take no part; some, of debris that whirled off, are far away.
std::vector<FacetMotion> scattered_facets(std::vector<float>& reach) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> place(-0.02f, 0.02f), direction(-1, 1),
      size(0.0005f, 0.004f);
  std::vector<FacetMotion> facets(600);
  reach.resize(facets.size());
  for (std::size_t i = 0; i < facets.size(); ++i) {
    FacetMotion& f = facets[i];
    float length = 0;
    for (int a = 0; a < 3; ++a) {
      f.x[a] = place(random);
      f.normal[a] = direction(random);
      length += f.normal[a] * f.normal[a];
    }
    for (float& n : f.normal) n /= std::sqrt(length);
    reach[i] = i % 7 == 0 ? 0 : size(random);
    if (i % 50 == 1) f.x[i / 50 % 3] = (i % 100 == 1 ? 1 : -1) * std::pow(10.0f, 4.0f + i / 25.0f);
    if (i % 100 == 1) reach[i] = 0;
  }
  return facets;
}

TEST(FacetPairs, AreThoseThatALookAtAllOfThemFinds) {
  std::vector<float> reach;
  const auto facets = scattered_facets(reach);
  std::vector<std::uint8_t> is_debris(facets.size());
  for (std::size_t f = 0; f < facets.size(); ++f) is_debris[f] = f % 5 < 2 ? 1 : 0;
  std::vector<std::int32_t> first_of_block;
  for (int f = 0; f <= 600; f += 40) first_of_block.push_back(f);
  first_of_block.push_back(600);  // one block has none
  Cpu cpu(2);
  for (const float patch : {0.001f, 0.012f, 0.1f}) {
    const auto pairs = facing_pairs(facets, reach, is_debris, first_of_block, patch, cpu);
    EXPECT_EQ(pairs, by_looking_at_all(facets, reach, is_debris));
    EXPECT_GT(pairs.size(), 100u);
  }
}

/// Two rough sheets over one another, as the faces of a cut, in blocks of their own: patches are
/// full, and most of them face one other patch alone.
TEST(FacetPairs, AreFoundBetweenTheFacesOfACut) {
  std::mt19937 random(7);
  std::normal_distribution<float> normal(0, 1);
  constexpr int kAcross = 24;
  constexpr float kCell = 0.003f;
  std::vector<FacetMotion> facets;
  std::vector<float> reach;
  std::vector<std::int32_t> first_of_block = {0};
  for (int i = 0; i < 2 * kAcross * kAcross; ++i) {
    const int x = i % kAcross, y = i / kAcross % kAcross, side = i / kAcross / kAcross;
    FacetMotion f = {};
    const float at[3] = {static_cast<float>(x), static_cast<float>(y),
                         side + 0.1f * x + std::sin(0.5f * y)};
    float length = 0;
    const float upward[3] = {-0.1f, -0.5f * std::cos(0.5f * y), 1};
    for (int a = 0; a < 3; ++a) {
      f.x[a] = kCell * (at[a] + 0.2f * normal(random));
      f.normal[a] = (side == 0 ? 1 : -1) * upward[a] + 0.2f * normal(random);
      length += f.normal[a] * f.normal[a];
    }
    for (float& n : f.normal) n /= std::sqrt(length);
    facets.push_back(f);
    reach.push_back(kCell * (0.9f + 0.5f * std::fabs(normal(random))));
    if ((i + 1) % 96 == 0) first_of_block.push_back(i + 1);
  }
  Cpu cpu(2);
  const std::vector<std::uint8_t> is_debris(facets.size(), 0);
  const auto pairs = facing_pairs(facets, reach, is_debris, first_of_block, 4 * kCell, cpu);
  EXPECT_EQ(pairs, by_looking_at_all(facets, reach, is_debris));
  EXPECT_GT(pairs.size(), 5000u);
}

}  // namespace
}  // namespace tissue_sim
