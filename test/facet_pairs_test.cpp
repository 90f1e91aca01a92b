// Facets that may meet: the grid finds the pairs that a look at all of them finds.
#include "contact/facet_pairs.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "contact/face_search.h"

namespace tissue_sim {
namespace {

std::vector<FacetPair> by_looking_at_all(const std::vector<FacetMotion>& facets,
                                         const std::vector<float>& reach) {
  std::vector<FacetPair> pairs;
  for (std::size_t i = 0; i < facets.size(); ++i) {
    for (std::size_t j = i + 1; j < facets.size(); ++j) {
      float cosine = 0;
      bool near = reach[i] > 0 && reach[j] > 0;
      for (int a = 0; a < 3; ++a) {
        cosine += facets[i].normal[a] * facets[j].normal[a];
        near = near && std::fabs(facets[i].x[a] - facets[j].x[a]) < reach[i] + reach[j];
      }
      if (near && cosine <= kFacing) pairs.emplace_back(i, j);
    }
  }
  return pairs;
}

/// Facets all over a box; some take no part; some, of crumbs that whirled off, are farther away
/// than there are cells of the grid.
TEST(FacetPairs, AreThoseThatALookAtAllOfThemFinds) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> place(-0.02f, 0.02f), direction(-1, 1),
      size(0.0005f, 0.004f);
  std::vector<FacetMotion> facets(600);
  std::vector<float> reach(facets.size());
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
  Cpu cpu(2);
  const auto pairs = facing_pairs(facets, reach, 0.006f, cpu);
  EXPECT_EQ(pairs, by_looking_at_all(facets, reach));
  EXPECT_GT(pairs.size(), 100u);
}

}  // namespace
}  // namespace tissue_sim
