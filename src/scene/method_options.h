// What belongs to one method alone, said once: a method lists its options
// (src/<method>/options.cpp), and who reads, writes, checks or documents them goes through that
// list.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "scene/scene_text.h"
#include "tissue_sim/scene.h"

namespace tissue_sim {

/// One option of some OptionSets, which must outlive it: a number, a count or one of some words.
struct Option {
  const char* name;
  const char* meaning;       ///< a line of the method's page in docs/
  double* number = nullptr;  ///< from low to high
  int* count = nullptr;      ///< the same
  double low = 0, high = 0;
  const char* unit = "";  ///< of a number
  const char* zero = "";  ///< what 0 stands for, which is allowed then, whatever the range
  std::vector<std::string> words = {};  ///< else
  int word = -1;                        ///< which of them it is; -1 for a value that is none
  std::function<void(int)> choose = {};
};
template <class Enum, std::size_t N>
Option choice(const char* name, const char* meaning, Enum& value,
              const Spelling<Enum> (&names)[N]) {
  Option option{name, meaning};
  for (const Spelling<Enum>& s : names) {
    if (s.value == value) option.word = static_cast<int>(option.words.size());
    option.words.emplace_back(s.name);
  }
  option.choose = [&value, &names](int word) { value = names[word].value; };
  return option;
}

/// How far apart points are at rest, as substeps see it.
struct Spacing {
  double lattice = 0;      ///< of a lattice of two points an edge; 0: steps do not depend on it [m]
  const char* field = "";  ///< of the scene, that sets it ...
  double value = 0;        ///< ... to this [m]
};

struct MethodOptions {
  Method method;
  std::vector<Option> (*list)(OptionSets& options);
  Spacing (*spacing)(const Scene& scene);
  bool takes_network;  ///< Scene::fragment_network
  /// Of `tear: measured`, over Spacing::lattice: how high the tissue is that a crack relieves, and
  /// how far ahead of its tip it is to be past the limit (docs/cutting.md); 0 where materials have
  /// no toughness, and where that is as it is.
  double tear_height, tear_length;
  /// Whether what moves are the vertices of a body's own mesh.
  bool (*moves_mesh)(const Body& body);

  const char* name() const { return name_of(method, kMethodNames); }  ///< also of their map in YAML
};

/// Of each method, in the order in which they are written (src/method_options.cpp).
const std::vector<const MethodOptions*>& method_options();
/// Of a valid scene's.
const MethodOptions& options_of(Method method);

}  // namespace tissue_sim
