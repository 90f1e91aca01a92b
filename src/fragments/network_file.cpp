#include "fragments/network_file.h"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <stdexcept>

#include "scene/load_yaml.h"
#include "scene/read_file.h"

namespace tissue_sim {
namespace {

/// FNV-1a, 64 bits, over the numbers' bytes, little endian.
class WeightsSum {
 public:
  void add(const std::vector<float>& numbers) {
    for (const float number : numbers) {
      std::uint32_t bits;
      std::memcpy(&bits, &number, sizeof bits);
      for (int i = 0; i < 4; ++i) sum_ = (sum_ ^ (bits >> 8 * i & 255)) * 0x100000001b3u;
    }
  }
  std::string text() const {
    char text[17];
    std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(sum_));
    return text;
  }

 private:
  std::uint64_t sum_ = 0xcbf29ce484222325u;
};

std::vector<float> numbers(const YAML::Node& node, const std::string& name, std::size_t count) {
  if (!node.IsSequence() || node.size() != count) {
    throw std::invalid_argument(name + " holds " +
                                (node.IsSequence() ? std::to_string(node.size()) : "no list of") +
                                " numbers: it must be " + std::to_string(count));
  }
  std::vector<float> result;
  result.reserve(count);
  for (const YAML::Node& item : node) {
    result.push_back(std::strtof(item.Scalar().c_str(), nullptr));
    if (!std::isfinite(result.back())) throw std::invalid_argument(name + " is not finite");
  }
  return result;
}

/// Rows of a matrix become its columns.
std::vector<float> transposed(const std::vector<float>& m, int rows, int columns) {
  std::vector<float> t(m.size());
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) t[c * rows + r] = m[r * columns + c];
  }
  return t;
}

}  // namespace

FragmentNetwork::FragmentNetwork(const std::string& path) {
  if (!std::filesystem::is_regular_file(path)) {
    throw std::invalid_argument(path +
                                ": no such file of a fragment network; "
                                "scripts/train_fragments writes them");
  }
  try {
    const YAML::Node file = load_yaml(read_file(path, kLargestScene));
    if (!file.IsMap() || !file["version"] || file["version"].as<std::string>() != "3") {
      throw std::invalid_argument("it must be a fragment network of version 3");
    }
    const YAML::Node node = file["classifier"];
    if (!node || !node.IsMap()) throw std::invalid_argument("classifier is missing");
    const std::vector<int> shape = {kPartingFeatureCount, kHiddenCount, kOutputs};
    if (node["shape"].as<std::vector<int>>() != shape) {
      throw std::invalid_argument("classifier has another shape than " +
                                  std::to_string(kPartingFeatureCount) + ", " +
                                  std::to_string(kHiddenCount) + ", " + std::to_string(kOutputs));
    }
    WeightsSum sum;
    const auto part = [&](const char* key, int rows, int columns) {
      const std::vector<float> values = numbers(node[key], std::string("classifier.") + key,
                                                static_cast<std::size_t>(rows) * columns);
      sum.add(values);
      return transposed(values, rows, columns);
    };
    hidden_weights_ = part("hidden_weights", kHiddenCount, kPartingFeatureCount);
    hidden_biases_ = part("hidden_biases", kHiddenCount, 1);
    output_weights_ = part("output_weights", kOutputs, kHiddenCount);
    output_biases_ = part("output_biases", kOutputs, 1);
    horizon_ = file["horizon"].as<double>();
    if (!(horizon_ > 0)) throw std::invalid_argument("horizon must be above 0");
    if (file["threshold"]) threshold_ = file["threshold"].as<double>();
    if (!(threshold_ > 0 && threshold_ < 1)) {
      throw std::invalid_argument("threshold must be above 0 and below 1");
    }
    const auto said = file["checksum"].as<std::string>();
    if (said != sum.text()) {
      throw std::invalid_argument("its numbers have the checksum " + sum.text() + ", not " + said +
                                  ": it was changed since it was written; get it anew");
    }
  } catch (const YAML::Exception& e) {
    throw std::invalid_argument(path + ": is no fragment network: " + yaml_problem(e));
  } catch (const std::invalid_argument& e) {
    throw std::invalid_argument(path + ": " + e.what());
  }
}

}  // namespace tissue_sim
