// Files of the fragment network's weights, as scripts/train_fragments writes them.
#pragma once

#include <string>
#include <vector>

#include "fragments/network.h"

namespace tissue_sim {

/// Both networks, as read from a file.
class FragmentNetwork {
 public:
  /// Reads a file (YAML). Throws std::invalid_argument with the path in front: no such file, no
  /// version 1 (the 70 features of the paper) or 2 (all features), a shape that is not that of
  /// the version (70 x 105 x 2 and 18, 101 x 151 x 2 and 18), numbers missing or not finite, a
  /// checksum that is not theirs.
  explicit FragmentNetwork(const std::string& path);

  NetworkWeights classifier() const { return classifier_.view(inputs_); }
  NetworkWeights modifier() const { return modifier_.view(inputs_); }
  /// Features that it takes: kFeatureCount or kAllFeatureCount.
  int inputs() const { return inputs_; }
  /// How far ahead it looks [s].
  double horizon() const { return horizon_; }
  /// Probability from which on a point is expected to be part of a fragment; half unless the file
  /// says so, for fragments are rare.
  double threshold() const { return threshold_; }

 private:
  struct Layers {
    std::vector<float> hidden_weights, hidden_biases, output_weights, output_biases;
    int first = 0;
    NetworkWeights view(int inputs) const {
      return {inputs,
              first,
              hidden_weights.data(),
              hidden_biases.data(),
              output_weights.data(),
              output_biases.data()};
    }
  };

  Layers classifier_, modifier_;
  int inputs_ = kFeatureCount;
  double horizon_ = 0, threshold_ = 0.5;
};

}  // namespace tissue_sim
