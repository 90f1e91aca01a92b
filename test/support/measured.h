// What a test measures, held to its bound and kept beside it: a row of docs/validation.md.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <utility>

namespace tissue_sim {

/// Keeps the value in the running test's result, where scripts/measured_tables finds it
/// (--gtest_output=json); of several of one name the least and the most. `unit` "%" is of a ratio.
inline testing::AssertionResult keep(bool holds, const std::string& what, double value,
                                     const char* kind, double bound, const char* unit) {
  static std::map<std::pair<const testing::TestInfo*, std::string>, std::pair<double, double>> kept;
  const auto* const test = testing::UnitTest::GetInstance()->current_test_info();
  auto& [least, most] = kept.emplace(std::pair(test, what), std::pair(value, value)).first->second;
  least = std::min(least, value);
  most = std::max(most, value);
  char text[128];
  std::snprintf(text, sizeof text, "%.5g %.5g %s %.5g %s", least, most, kind, bound, unit);
  testing::Test::RecordProperty(what, text);
  if (holds) return testing::AssertionSuccess();
  return testing::AssertionFailure()
         << what << ": " << value << ", which is not " << kind << ' ' << bound;
}

/// EXPECT_TRUE(is_within("sag, 8 cells", error, 0.03)): no further from 0.
inline testing::AssertionResult is_within(const std::string& what, double value, double bound,
                                          const char* unit = "%") {
  return keep(std::fabs(value) <= bound, what, value, "within", bound, unit);
}
inline testing::AssertionResult is_at_most(const std::string& what, double value, double bound,
                                           const char* unit = "") {
  return keep(value <= bound, what, value, "<=", bound, unit);
}
inline testing::AssertionResult is_at_least(const std::string& what, double value, double bound,
                                            const char* unit = "") {
  return keep(value >= bound, what, value, ">=", bound, unit);
}

}  // namespace tissue_sim
