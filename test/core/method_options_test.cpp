// A method lists its options once: they are read, written, refused and documented by that list.
#include "scene/method_options.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <stdexcept>

namespace tissue_sim {
namespace {

Scene scene_of(const MethodOptions& of) {
  Scene scene;
  scene.method = of.method;
  scene.bodies.resize(1);
  return scene;
}

TEST(MethodOptions, ComeBackAsTheyWereWritten) {
  for (const MethodOptions* of : method_options()) {
    Scene scene = scene_of(*of);
    for (const Option& option : of->list(scene)) {
      const std::string before = scene_to_yaml(scene);
      if (option.number != nullptr) *option.number = 0.75 * option.high;
      if (option.count != nullptr) *option.count = static_cast<int>(option.high) - 1;
      if (option.choose) option.choose(static_cast<int>(option.words.size()) - 1);
      const std::string changed = scene_to_yaml(scene);
      EXPECT_NE(changed, before) << of->name() << "." << option.name;
      EXPECT_EQ(scene_to_yaml(scene_from_yaml(changed)), changed);
    }
  }
}

TEST(MethodOptions, AreRefusedByTheirNames) {
  for (const MethodOptions* of : method_options()) {
    Scene scene = scene_of(*of);
    for (const Option& option : of->list(scene)) {
      const OptionSets right = scene;
      if (option.number != nullptr) *option.number = 2 * option.high;
      if (option.count != nullptr) *option.count = static_cast<int>(option.high) + 1;
      if (option.choose) continue;
      const std::string name = std::string(of->name()) + "." + option.name + " is ";
      try {
        validate(scene);
        FAIL() << name;
      } catch (const std::invalid_argument& e) {
        EXPECT_EQ(std::string(e.what()).substr(0, name.size()), name);
      }
      static_cast<OptionSets&>(scene) = right;
    }
  }
  Scene scene = scene_of(options_of(Method::kMpm));
  scene.pbd.model = static_cast<PbdModel>(7);
  EXPECT_THROW(validate(scene), std::invalid_argument);
}

std::string values_of(const Option& option) {
  std::string words;
  for (const std::string& word : option.words) words += (words.empty() ? "" : ", ") + word;
  if (!words.empty()) return words + " | " + option.words[option.word];
  return text(option.low) + " to " + text(option.high) + (*option.unit ? " " : "") + option.unit +
         (*option.zero ? std::string("; 0: ") + option.zero : "") + " | " +
         text(option.number != nullptr ? *option.number : *option.count);
}

TEST(MethodOptions, StandInTheDocumentationAsTheyAre) {
  for (const MethodOptions* of : method_options()) {
    OptionSets defaults;
    if (of->list(defaults).empty()) continue;
    std::ifstream file(std::string(TISSUE_SIM_DOCS) + "/" + of->name() + ".md");
    const std::string page{std::istreambuf_iterator<char>(file), {}};
    std::string table = "| Option | Values | Default | |\n| --- | --- | --- | --- |\n";
    for (const Option& option : of->list(defaults)) {
      table += std::string("| `") + option.name + "` | " + values_of(option) + " | " +
               option.meaning + " |\n";
    }
    EXPECT_NE(page.find(table), std::string::npos) << "docs/" << of->name() << ".md shall have\n"
                                                   << table;
  }
}

}  // namespace
}  // namespace tissue_sim
