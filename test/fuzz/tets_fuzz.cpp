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
  const char* const extensions[] = {".mesh", ".vtk", ".node"};
  const std::string stem = "/dev/shm/tissue_sim_fuzz_" + std::to_string(getpid());
  const std::string path = stem + extensions[format % 3];
  std::ofstream(path, std::ios::binary) << bytes.rest();
  if (format % 3 == 2) std::ofstream(stem + ".ele", std::ios::binary) << bytes.rest();
  try {
    TetMesh mesh = read_tets(path);
    std::vector<std::string> notes;
    check_tets(mesh, notes);
    boundary(mesh);
  } catch (const std::invalid_argument&) {
  }
  std::remove(path.c_str());
  std::remove((stem + ".ele").c_str());
  return 0;
}
