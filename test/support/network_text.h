// A fragment network of made-up weights, as the file that it is read from: trained on nothing.
#pragma once

#include <cstdint>
#include <cstdio>
#include <string>

#include "fragments/network.h"

namespace tissue_sim {

/// The k-th number of the file is ((7919 k) mod 1000 - 500) / 5000. Version 2 takes all features.
inline std::string network_text(int version = 1) {
  const int inputs = version == 1 ? kFeatureCount : kAllFeatureCount, hidden = hidden_count(inputs);
  std::string text = "version: " + std::to_string(version) +
                     "\nhorizon: 0.0083333333\nchecksum: " +  // NumPy's, of the same
                     (version == 1 ? "8eece9c969fa1ab1" : "f4b25d4f627fae7d") + "\n";
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
  const auto network = [&](const char* name, int outputs) {
    text += std::string(name) + ":\n  shape: [" + std::to_string(inputs) + ", " +
            std::to_string(hidden) + ", " + std::to_string(outputs) + "]\n";
    numbers("hidden_weights", hidden * inputs);
    numbers("hidden_biases", hidden);
    numbers("output_weights", outputs * hidden);
    numbers("output_biases", outputs);
  };
  network("classifier", kClassifierOutputs);
  network("modifier", kModifierOutputs);
  return text;
}

}  // namespace tissue_sim
