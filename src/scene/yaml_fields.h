// Reads the fields of one YAML map, with errors that name the field, its value and what is allowed.
#pragma once

#include <yaml-cpp/yaml.h>

#include <functional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "scene/scene_text.h"

namespace tissue_sim {

/// Of a field of a YAML text, which what() quotes.
class FieldError : public std::invalid_argument {
 public:
  FieldError(const std::string& quoted, std::string unquoted)
      : std::invalid_argument(quoted), unquoted_(std::move(unquoted)) {}
  /// The same without a word of the text, but with the line and the column: the text may be of a
  /// file that is nobody's business.
  const std::string& unquoted() const { return unquoted_; }

 private:
  std::string unquoted_;
};

/// The fields of a YAML map. Made from a node, it refuses what is no map, fields that are not among
/// the known ones, and fields that are given twice. All members throw FieldError, or, where nothing
/// of the text is in the message, std::invalid_argument.
class YamlFields {
 public:
  /// `path` is where the map stands, "" for the whole document.
  YamlFields(const YAML::Node& node, std::string path, const std::vector<std::string>& known);

  bool has(const std::string& name) const;
  /// "bodies[0].size" for "size"
  std::string path(const std::string& name) const;
  /// Throws "<path> is <value>: <allowed>".
  [[noreturn]] void refuse(const std::string& name, const std::string& allowed) const;
  /// Throws "<path> is missing: <allowed>" unless the field is there.
  void require(const std::string& name, const std::string& allowed) const;

  /// Whether it is there and is that word.
  bool says(const std::string& name, const std::string& word) const;

  // Each leaves the value as it is where the field is left out.
  void read(const std::string& name, double& value) const;
  void read(const std::string& name, int& value) const;
  void read(const std::string& name, std::uint64_t& value) const;
  void read(const std::string& name, bool& value) const;
  void read(const std::string& name, std::string& value) const;
  void read(const std::string& name, Vec3& value) const;
  /// A list of so many numbers, or an empty one.
  void read(const std::string& name, std::vector<double>& value, std::size_t count) const;
  /// [x, y, z, w] as ROS has it; its norm must be 1 within 0.001 and is made 1.
  void read(const std::string& name, Quat& value) const;
  /// One of the words, by its place among them.
  void read(const std::string& name, int& at, const std::vector<std::string>& words) const;
  template <class Enum, std::size_t N>
  void read(const std::string& name, Enum& value, const Spelling<Enum> (&names)[N]) const;
  /// Calls `read_map` with the map's node and path.
  void read_map(const std::string& name,
                const std::function<void(const YAML::Node&, const std::string&)>& read_map) const;
  /// Calls `read_item` with the node and path of each item of a list.
  void read_list(const std::string& name,
                 const std::function<void(const YAML::Node&, const std::string&)>& read_item) const;

 private:
  const YAML::Node* find(const std::string& name) const;
  std::vector<double> numbers(const std::string& name, std::size_t count,
                              const char* allowed) const;

  std::string path_;
  std::vector<std::pair<std::string, YAML::Node>> fields_;
};

/// "a, b, c"
std::string join(const std::vector<std::string>& words);

template <class Enum, std::size_t N>
void YamlFields::read(const std::string& name, Enum& value,
                      const Spelling<Enum> (&names)[N]) const {
  std::vector<std::string> words;
  for (const Spelling<Enum>& s : names) words.emplace_back(s.name);
  int at = -1;
  read(name, at, words);
  if (at >= 0) value = names[at].value;
}

}  // namespace tissue_sim
