// Files of fragment networks.
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <stdexcept>

#include "bytes.h"
#include "fragments/network_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tissue_sim;
  const std::string path = "/dev/shm/tissue_sim_network_" + std::to_string(getpid());
  std::ofstream(path, std::ios::binary) << FuzzBytes(data, size).rest();
  try {
    const FragmentNetwork network(path);
  } catch (const std::invalid_argument&) {
  }
  std::remove(path.c_str());
  return 0;
}
