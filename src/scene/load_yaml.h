// YAML texts from outside.
#pragma once

#include <yaml-cpp/yaml.h>

#include <string>

namespace tissue_sim {

/// The only document of a text; empty for an empty text. Throws YAML::Exception for what is no YAML
/// and std::invalid_argument for several documents, or collections nested more than 64 deep, of
/// which yaml-cpp would run out of stack.
YAML::Node load_yaml(const std::string& text);

/// What is wrong, and where, without a word of the text: it may be a file that is nobody's
/// business.
std::string yaml_problem(const YAML::Exception& e);

}  // namespace tissue_sim
