// A fragment network of made-up weights, as the file that it is read from: trained on nothing.
#pragma once

#include <cstdint>
#include <cstdio>
#include <string>

#include "fragments/network.h"

namespace tissue_sim {

/// The k-th number of the file is ((7919 k) mod 1000 - 500) / 5000.
inline std::string network_text() {
  std::string text =
      "version: 3\nhorizon: 0.0083333333\nchecksum: 752283bd9b2867c7\n"  // NumPy's, of the same
      "classifier:\n  shape: [" +
      std::to_string(kPartingFeatureCount) + ", " + std::to_string(kHiddenCount) + ", " +
      std::to_string(kOutputs) + "]\n";
  std::int64_t k = 0;
  const auto numbers = [&](const char* name, int count) {
    text += std::string("  ") + name + ": [\n    ";
    for (int i = 0; i < count; ++i, ++k) {
      char number[32];
      std::snprintf(number, sizeof number, "%.9g",
                    static_cast<double>(static_cast<float>(k * 7919 % 1000 - 500) / 5000.0f));
      text += std::string(i == 0 ? "" : i % 12 == 0 ? ",\n    " : ", ") + number;
    }
    text += "]\n";
  };
  numbers("hidden_weights", kHiddenCount * kPartingFeatureCount);
  numbers("hidden_biases", kHiddenCount);
  numbers("output_weights", kOutputs * kHiddenCount);
  numbers("output_biases", kOutputs);
  return text;
}

}  // namespace tissue_sim
