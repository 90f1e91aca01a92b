// Saved states of each method, damaged: bytes at a place of a true one are exchanged, or it ends
// there; with 8 in the first byte the checksum is made right again, as in a stranger's bag. What is
// damaged is refused, or goes on for three frames.
#include <cstring>
#include <stdexcept>
#include <vector>

#include "bytes.h"
#include "frame/checksum.h"
#include "tissue_sim/simulation.h"

namespace {

using namespace tissue_sim;

Scene scene_of(int choice) {
  Scene scene;
  scene.device = Device::kCpu;
  scene.threads = 1;
  scene.cell_size = 0.01;
  scene.bodies.resize(1);
  scene.bodies[0].size = Vec3(0.03, 0.02, 0.02);
  scene.bodies[0].pose.position.z() = 0.01;
  scene.method = choice % 3 == 0 ? Method::kMpm : choice % 3 == 1 ? Method::kMls : Method::kPbd;
  scene.tools.resize(1);
  return scene;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  FuzzBytes bytes(data, size);
  const int choice = bytes.take<std::uint8_t>();
  static std::vector<std::uint8_t> saved[3];
  std::vector<std::uint8_t>& original = saved[choice % 3];
  if (original.empty()) {
    Simulation simulation(scene_of(choice));
    simulation.advance_frame();
    original = simulation.save();
  }
  std::vector<std::uint8_t> damaged = original;
  while (bytes.left() >= 4) {
    const std::size_t at = bytes.take<std::uint16_t>() * 7919u % damaged.size();
    const auto value = bytes.take<std::uint16_t>();
    if (value == 0xffff) {
      damaged.resize(at + 1);
    } else {
      damaged[at] = static_cast<std::uint8_t>(value);
    }
  }
  constexpr std::size_t kHead = 40, kSum = 32;  // frame/sealed_state.cpp
  if ((choice & 8) != 0 && damaged.size() > kHead) {
    const std::uint64_t size = damaged.size() - kHead;
    Checksum checksum;
    checksum.add(Span<const std::uint8_t>(damaged.data() + kHead, size));
    const std::uint64_t sum = checksum.value();
    std::memcpy(&damaged[kSum - sizeof size], &size, sizeof size);
    std::memcpy(&damaged[kSum], &sum, sizeof sum);
  }
  try {
    Simulation simulation(scene_of(choice));
    simulation.restore({damaged.data(), damaged.size()});
    for (int i = 0; i < 3; ++i) simulation.advance_frame();
  } catch (const std::runtime_error&) {
  }
  return 0;
}
