#include "scene/yaml_fields.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <locale>
#include <sstream>
#include <stdexcept>

namespace tissue_sim {
namespace {

// Nodes below a node, as far as `most`: aliases may stand for more than there is memory.
int count_nodes(const YAML::Node& node, int most) {
  int count = 1;
  for (auto it = node.begin(); it != node.end() && count < most; ++it) {
    if (node.IsMap()) count += count_nodes(it->first, most - count);
    count += count_nodes(node.IsMap() ? it->second : YAML::Node(*it), most - count);
  }
  return count;
}

std::string kind_of(const YAML::Node& node) {
  return node.IsMap() ? "a map" : node.IsSequence() ? "a list" : node.IsNull() ? "empty" : "a text";
}

// The value as it stands in the file, on one line and cut short.
std::string shown(const YAML::Node& node) {
  constexpr int kMostShown = 50;
  if (node.IsNull()) return "empty";
  if (node.IsScalar() && node.Scalar().size() > 80) {
    return '"' + node.Scalar().substr(0, 77) + "...\"";
  }
  if (!node.IsScalar() && count_nodes(node, kMostShown) >= kMostShown) {
    return kind_of(node) + " of " + std::to_string(node.size());
  }
  if (node.IsScalar() && node.Tag() == "!") return '"' + node.Scalar() + '"';
  YAML::Node line = YAML::Clone(node);  // in yaml-cpp 0.6 its style goes before the emitter's
  line.SetStyle(YAML::EmitterStyle::Flow);
  YAML::Emitter out;
  out << line;
  std::string value = out.c_str();
  std::replace(value.begin(), value.end(), '\n', ' ');
  if (value.size() > 80) value = value.substr(0, 77) + "...";
  return value;
}

// " (line 3, column 7)"
std::string place(const YAML::Node& node) {
  const YAML::Mark mark = node.Mark();
  if (mark.is_null()) return "";
  return " (line " + std::to_string(mark.line + 1) + ", column " + std::to_string(mark.column + 1) +
         ")";
}

// All of the text as a T, without regard to the locale. Hexadecimal and a sign on unsigned numbers,
// which yaml-cpp lets pass and wraps around, are refused.
template <class T>
bool parse(const std::string& s, T& value) {
  if (!std::is_signed<T>::value && s.find('-') != std::string::npos) return false;
  std::istringstream in(s);
  in.imbue(std::locale::classic());
  T read;
  if (!(in >> std::noskipws >> read) || in.peek() != std::istringstream::traits_type::eof()) {
    return false;
  }
  value = read;
  return true;
}

bool is_word(const std::string& s, const char* lower) {
  std::string l = s;
  std::transform(l.begin(), l.end(), l.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? c + 32 : c; });
  return l == lower;
}

// Infinities and NaN are numbers here; validate() says that they are out of range.
bool parse_number(const YAML::Node& node, double& value) {
  if (!node.IsScalar() || node.Tag() == "!") return false;  // "!" marks a quoted string
  const std::string& s = node.Scalar();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  if (is_word(s, ".nan")) {
    value = std::numeric_limits<double>::quiet_NaN();
  } else if (is_word(s, ".inf") || is_word(s, "+.inf")) {
    value = kInf;
  } else if (is_word(s, "-.inf")) {
    value = -kInf;
  } else {
    return parse(s, value);
  }
  return true;
}

}  // namespace

std::string join(const std::vector<std::string>& words) {
  std::string list;
  for (const std::string& word : words) list += (list.empty() ? "" : ", ") + word;
  return list;
}

YamlFields::YamlFields(const YAML::Node& node, std::string path,
                       const std::vector<std::string>& known)
    : path_(std::move(path)) {
  if (!node.IsMap()) {
    const std::string allowed = ": must be a map of the fields " + join(known);
    const std::string name = path_.empty() ? "the scene" : path_, kind = kind_of(node);
    throw FieldError(name + " is " + (path_.empty() ? kind : shown(node)) + allowed,
                     name + " is " + kind + place(node) + allowed);
  }
  for (const auto& item : node) {
    const std::string name = item.first.IsScalar() ? item.first.Scalar() : kind_of(item.first);
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      const std::string word = name.size() > 40 ? name.substr(0, 37) + "..." : name;
      const std::string allowed = "unknown field, known here are " + join(known);
      throw FieldError(
          this->path(word) + ": " + allowed,
          (path_.empty() ? "the scene" : path_) + " has an " + allowed + place(item.first));
    }
    const bool twice = has(name);
    fields_.emplace_back(name, item.second);
    if (twice) throw std::invalid_argument(this->path(name) + " is given twice: give it once");
  }
}

const YAML::Node* YamlFields::find(const std::string& name) const {
  for (const auto& field : fields_) {
    if (field.first == name) return &field.second;
  }
  return nullptr;
}

bool YamlFields::has(const std::string& name) const { return find(name) != nullptr; }

std::string YamlFields::path(const std::string& name) const {
  return path_.empty() ? name : path_ + "." + name;
}

void YamlFields::refuse(const std::string& name, const std::string& allowed) const {
  const YAML::Node& node = *find(name);
  throw FieldError(path(name) + " is " + shown(node) + ": " + allowed,
                   path(name) + place(node) + ": " + allowed);
}

void YamlFields::require(const std::string& name, const std::string& allowed) const {
  if (!has(name)) throw std::invalid_argument(path(name) + " is missing: " + allowed);
}

bool YamlFields::says(const std::string& name, const std::string& word) const {
  const YAML::Node* node = find(name);
  return node != nullptr && node->IsScalar() && node->Scalar() == word;
}

void YamlFields::read(const std::string& name, double& value) const {
  const YAML::Node* node = find(name);
  if (node && !parse_number(*node, value)) refuse(name, "must be a number");
}

void YamlFields::read(const std::string& name, int& value) const {
  const YAML::Node* node = find(name);
  if (!node) return;
  if (!node->IsScalar() || node->Tag() == "!" || !parse(node->Scalar(), value)) {
    refuse(name, "must be a whole number");
  }
}

void YamlFields::read(const std::string& name, std::uint64_t& value) const {
  const YAML::Node* node = find(name);
  if (!node) return;
  if (!node->IsScalar() || node->Tag() == "!" || !parse(node->Scalar(), value)) {
    refuse(name, "must be a whole number between 0 and 18446744073709551615");
  }
}

void YamlFields::read(const std::string& name, bool& value) const {
  const YAML::Node* node = find(name);
  if (!node) return;
  const bool plain = node->IsScalar() && node->Tag() != "!";
  if (plain && is_word(node->Scalar(), "true")) {
    value = true;
  } else if (plain && is_word(node->Scalar(), "false")) {
    value = false;
  } else {
    refuse(name, "must be true or false");
  }
}

void YamlFields::read(const std::string& name, std::string& value) const {
  const YAML::Node* node = find(name);
  if (!node) return;
  if (!node->IsScalar()) refuse(name, "must be a text");
  value = node->Scalar();
}

std::vector<double> YamlFields::numbers(const std::string& name, std::size_t count,
                                        const char* allowed) const {
  const YAML::Node& node = *find(name);
  if (!node.IsSequence() || node.size() != count) refuse(name, allowed);
  std::vector<double> values(count);
  for (std::size_t i = 0; i < count; ++i) {
    if (!parse_number(node[i], values[i])) refuse(name, allowed);
  }
  return values;
}

void YamlFields::read(const std::string& name, int& at,
                      const std::vector<std::string>& words) const {
  if (!has(name)) return;
  std::string word;
  read(name, word);
  const auto found = std::find(words.begin(), words.end(), word);
  if (found == words.end()) refuse(name, "must be one of " + join(words));
  at = static_cast<int>(found - words.begin());
}

void YamlFields::read(const std::string& name, Vec3& value) const {
  if (!has(name)) return;
  const std::vector<double> v = numbers(name, 3, "must be three numbers, [x, y, z]");
  value = Vec3(v[0], v[1], v[2]);
}

void YamlFields::read(const std::string& name, std::vector<double>& value,
                      std::size_t count) const {
  if (!has(name)) return;
  const YAML::Node& node = *find(name);
  if (node.IsSequence() && node.size() == 0) return value.clear();
  const std::string allowed = "must be " + std::to_string(count) + " numbers, or none: []";
  value = numbers(name, count, allowed.c_str());
}

void YamlFields::read(const std::string& name, Quat& value) const {
  if (!has(name)) return;
  const std::vector<double> v = numbers(name, 4, "must be four numbers, [x, y, z, w]");
  const Quat q(v[3], v[0], v[1], v[2]);
  if (!(std::abs(q.norm() - 1) <= 1e-3)) {
    refuse(name, "must be a unit quaternion [x, y, z, w], its norm within 0.001 of 1");
  }
  // One that is a unit already keeps its bits, so that a scene comes back as it was written.
  value = std::abs(q.squaredNorm() - 1) < 1e-14 ? q : q.normalized();
}

void YamlFields::read_map(
    const std::string& name,
    const std::function<void(const YAML::Node&, const std::string&)>& read_map) const {
  if (const YAML::Node* node = find(name)) read_map(*node, path(name));
}

void YamlFields::read_list(
    const std::string& name,
    const std::function<void(const YAML::Node&, const std::string&)>& read_item) const {
  const YAML::Node* node = find(name);
  if (!node) return;
  if (!node->IsSequence()) refuse(name, "must be a list ([] for none)");
  for (std::size_t i = 0; i < node->size(); ++i) {
    read_item((*node)[i], path(name) + "[" + std::to_string(i) + "]");
  }
}

}  // namespace tissue_sim
