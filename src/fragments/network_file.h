// Files of the fragment network's weights, as scripts/train_fragments writes them.
#pragma once

#include <string>
#include <vector>

#include "fragments/network.h"

namespace tissue_sim {

/// The network, as read from a file.
class FragmentNetwork {
 public:
  /// Reads a file (YAML). Throws std::invalid_argument with the path in front: no such file, not
  /// version 3 (versions 1 and 2 foresaw points of fragments, not bonds), a shape that is not
  /// [kPartingFeatureCount, kHiddenCount, kOutputs], numbers missing or not finite, a checksum that
  /// is not theirs.
  explicit FragmentNetwork(const std::string& path);

  NetworkWeights weights() const {
    return {hidden_weights_.data(), hidden_biases_.data(), output_weights_.data(),
            output_biases_.data()};
  }
  /// How far ahead it looks [s].
  double horizon() const { return horizon_; }
  /// Probability from which on a cell is expected to part; half unless the file says so.
  double threshold() const { return threshold_; }

 private:
  std::vector<float> hidden_weights_, hidden_biases_, output_weights_, output_biases_;
  double horizon_ = 0, threshold_ = 0.5;
};

}  // namespace tissue_sim
