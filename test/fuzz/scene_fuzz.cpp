// Texts of scenes; what is taken is written and read again as it was.
#include <cstdlib>
#include <stdexcept>

#include "bytes.h"
#include "tissue_sim/scene.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tissue_sim;
  std::string text;
  try {
    text = scene_to_yaml(scene_from_yaml(FuzzBytes(data, size).rest()));
  } catch (const std::invalid_argument&) {
    return 0;
  }
  if (scene_to_yaml(scene_from_yaml(text)) != text) std::abort();
  return 0;
}
