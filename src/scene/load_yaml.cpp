#include "scene/load_yaml.h"

#include <algorithm>
#include <stdexcept>
#include <vector>

namespace tissue_sim {
namespace {

constexpr int kDeepestNesting = 64;

/// How deep a text may nest, at most: brackets that are open, indicators of lists in one line, and
/// lines that are each indented more than the one before.
int depth_of(const std::string& text) {
  int open = 0, deepest = 0;
  std::vector<std::size_t> indents;
  std::size_t at = 0;
  while (at < text.size()) {
    std::size_t end = text.find('\n', at);
    if (end == std::string::npos) end = text.size();
    const std::size_t first = text.find_first_not_of(' ', at);
    if (first < end && text[first] != '#') {
      while (!indents.empty() && indents.back() >= first - at) indents.pop_back();
      indents.push_back(first - at);
    }
    int in_line = 0;
    for (std::size_t i = at; i < end; ++i) {
      const char c = text[i];
      open += c == '[' || c == '{' ? 1 : (c == ']' || c == '}') && open > 0 ? -1 : 0;
      const bool alone = i + 1 == end || text[i + 1] == ' ';
      in_line += (c == '-' || c == '?' || c == ':') && alone ? 1 : 0;
      deepest = std::max(deepest, open);
    }
    // Within brackets each line may have many pairs.
    const int nested = open == 0 && deepest == 0 ? in_line : 0;
    deepest = std::max({deepest, nested, static_cast<int>(indents.size())});
    at = end + 1;
  }
  return deepest;
}

/// Whether anything follows the first document. YAML::LoadAll would tell, but it has no end for
/// ",]-]z\n\n,]--ab" and its like (yaml-cpp 0.7).
bool has_more_documents(const std::string& text) {
  bool content = false, ended = false;
  for (std::size_t at = 0; at < text.size();) {
    std::size_t end = text.find('\n', at);
    if (end == std::string::npos) end = text.size();
    const std::string line = text.substr(at, std::min<std::size_t>(end - at, 4));
    at = end + 1;
    const auto is_mark = [&line](const char* mark) {
      return line.compare(0, 3, mark) == 0 &&
             (line.size() == 3 || line[3] == ' ' || line[3] == '\t' || line[3] == '\r');
    };
    if (is_mark("---")) {
      if (content) return true;
      content = true;
    } else if (is_mark("...")) {
      ended = content;
    } else if (const std::size_t first = line.find_first_not_of(" \t\r");
               first != std::string::npos && line[first] != '#' && line[0] != '%') {
      if (ended) return true;
      content = true;
    }
  }
  return false;
}

}  // namespace

YAML::Node load_yaml(const std::string& text) {
  if (depth_of(text) > kDeepestNesting) {
    throw std::invalid_argument("it nests more than " + std::to_string(kDeepestNesting) + " deep");
  }
  if (has_more_documents(text)) {
    throw std::invalid_argument(
        "it holds several documents (parted by ---), of which all but the first would be lost");
  }
  return YAML::Load(text);
}

std::string yaml_problem(const YAML::Exception& e) {
  if (e.mark.is_null()) return "it cannot be read as YAML";
  return "line " + std::to_string(e.mark.line + 1) + ", column " +
         std::to_string(e.mark.column + 1) + " cannot be read";
}

}  // namespace tissue_sim
