// Prints where the vertices of a mesh are, for scripts that fit something to a body: a line
// "x y z" each, in the file's own unit.
//   rosrun tissue_sim mesh_vertices FILE
#include <cstdio>
#include <exception>

#include "geometry/tet_mesh.h"

int main(int argc, char** argv) {
  using namespace tissue_sim;
  if (argc != 2) {
    std::fputs("mesh_vertices FILE: a mesh of a surface, or of tetrahedra\n", stderr);
    return 2;
  }
  try {
    const std::string path = resolve_path(argv[1], "mesh");
    const std::vector<Vec3> vertices =
        is_tet_file(path) ? load_tet_file(path, nullptr).vertices : read_mesh(path).vertices;
    for (const Vec3& v : vertices) std::printf("%.9g %.9g %.9g\n", v.x(), v.y(), v.z());
    return 0;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
}
