// Files of tetrahedra, each format: the first byte says which. They are read by name.
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <stdexcept>

#include "bytes.h"
#include "geometry/tet_mesh.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tissue_sim;
  FuzzBytes bytes(data, size);
  const auto format = bytes.take<std::uint8_t>();
  const char* const extensions[] = {".mesh", ".vtk", ".node", ".msh", ".vtu"};
  constexpr std::size_t kCount = sizeof extensions / sizeof extensions[0];
  const std::string stem = "/dev/shm/tissue_sim_fuzz_" + std::to_string(getpid());
  const std::string path = stem + extensions[format % kCount];
  std::ofstream(path, std::ios::binary) << bytes.rest();
  if (format % kCount == 2) std::ofstream(stem + ".ele", std::ios::binary) << bytes.rest();
  try {
    std::vector<std::string> notes;
    load_tet_file(path, &notes);
  } catch (const std::invalid_argument&) {
  }
  std::remove(path.c_str());
  std::remove((stem + ".ele").c_str());
  return 0;
}
