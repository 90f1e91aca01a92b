#include "scene/load_yaml.h"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/parser.h>

#include <algorithm>
#include <sstream>
#include <stdexcept>

namespace tissue_sim {
namespace {

constexpr int kDeepestNesting = 64;

/// Ends a document that nests too deep before the parser, which calls itself for each level, gets
/// there.
class NestingGuard : public YAML::EventHandler {
 public:
  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t,
                const std::string&) override {}
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t,
                       YAML::EmitterStyle::value) override {
    go_deeper();
  }
  void OnSequenceEnd() override { --depth_; }
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t,
                  YAML::EmitterStyle::value) override {
    go_deeper();
  }
  void OnMapEnd() override { --depth_; }

 private:
  void go_deeper() {
    if (++depth_ <= kDeepestNesting) return;
    throw std::invalid_argument("it nests more than " + std::to_string(kDeepestNesting) + " deep");
  }
  int depth_ = 0;
};

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
  std::istringstream stream(text);
  NestingGuard guard;
  YAML::Parser(stream).HandleNextDocument(guard);
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
