#include "fragments/network_file.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
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
    const std::string version =
        file.IsMap() && file["version"] ? file["version"].as<std::string>() : "";
    if (version != "1" && version != "2") {
      throw std::invalid_argument("it must be a fragment network of version 1 or 2");
    }
    inputs_ = version == "1" ? kFeatureCount : kAllFeatureCount;
    const int inputs = inputs_, hidden = hidden_count(inputs);
    WeightsSum sum;
    const auto read = [&](const std::string& name, int outputs, Layers& layers) {
      const YAML::Node node = file[name];
      if (!node || !node.IsMap()) throw std::invalid_argument(name + " is missing");
      const auto shape = node["shape"].as<std::vector<int>>();
      if (shape != std::vector<int>{inputs, hidden, outputs}) {
        throw std::invalid_argument(name + " has another shape than " + std::to_string(inputs) +
                                    ", " + std::to_string(hidden) + ", " + std::to_string(outputs));
      }
      const auto part = [&](const char* key, int rows, int columns) {
        std::vector<float> values =
            numbers(node[key], name + "." + key, static_cast<std::size_t>(rows) * columns);
        sum.add(values);
        return transposed(values, rows, columns);
      };
      layers.hidden_weights = part("hidden_weights", hidden, inputs);
      const auto used = std::find_if(layers.hidden_weights.begin(), layers.hidden_weights.end(),
                                     [](float w) { return w != 0; });
      layers.first = static_cast<int>(used - layers.hidden_weights.begin()) / hidden;
      layers.hidden_biases = part("hidden_biases", hidden, 1);
      layers.output_weights = part("output_weights", outputs, hidden);
      layers.output_biases = part("output_biases", outputs, 1);
    };
    read("classifier", kClassifierOutputs, classifier_);
    read("modifier", kModifierOutputs, modifier_);
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
