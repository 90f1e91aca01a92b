// Files of meshes, each format: the first byte says which.
#include <stdexcept>

#include "bytes.h"
#include "geometry/mesh.h"
#include "geometry/obj.h"
#include "geometry/off.h"
#include "geometry/ply.h"
#include "geometry/stl.h"
#include "geometry/surface.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tissue_sim;
  FuzzBytes bytes(data, size);
  const auto format = bytes.take<std::uint8_t>();
  try {
    const std::string file = bytes.rest();
    TriangleMesh mesh = format % 4 == 0   ? read_stl(file)
                        : format % 4 == 1 ? read_obj(file)
                        : format % 4 == 2 ? read_ply(file)
                                          : read_off(file);
    for (const Vec3& v : mesh.vertices) {
      if (!v.allFinite()) return 0;  // read_mesh() refuses it
    }
    merge_vertices(mesh, 0);
    drop_unused_vertices(mesh);
    std::vector<std::string> notes;
    TriangleMesh surface = mesh;
    if (!mesh.triangles.empty()) make_solid(mesh, notes);
    tidy_surface(surface, notes);
  } catch (const std::invalid_argument&) {
  }
  return 0;
}
