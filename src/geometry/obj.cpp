#include "geometry/obj.h"

#include <cstdlib>
#include <stdexcept>
#include <vector>

#include "geometry/mesh_words.h"
#include "geometry/polygon.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace obj_file {
namespace {

/// The vertex of "7", "7/1", "7//3" or "-1", counted from 1, or back from the last; from 0 here.
double corner(const std::string& word, std::size_t vertices) {
  char* end = nullptr;
  const long number = std::strtol(word.c_str(), &end, 10);
  if (end == word.c_str() || (*end != '\0' && *end != '/')) {
    throw std::invalid_argument("has a face with a corner that is no number: export it again");
  }
  return static_cast<double>(number < 0 ? static_cast<long>(vertices) + number : number - 1);
}

}  // namespace
}  // namespace obj_file

TriangleMesh read_obj(const std::string& bytes) {
  TriangleMesh mesh;
  MeshWords words(bytes, 0);
  std::string word;
  std::vector<std::vector<double>> faces;
  for (std::size_t lines = 0; words.next(word); ++lines) {
    if (lines % 4096 == 0) stop_if_asked();
    if (word == "v") {
      Vec3 x;
      for (double& value : x) {
        if (!words.next_in_line(value)) {
          throw std::invalid_argument("has a vertex that is no three numbers: export it again");
        }
      }
      mesh.vertices.push_back(x);
    } else if (word == "f") {
      faces.emplace_back();
      while (words.next_in_line(word)) {
        if (word == "\\") {  // goes on in the next line
          words.skip_comments('#');
          continue;
        }
        if (word.front() == '#') break;
        faces.back().push_back(obj_file::corner(word, mesh.vertices.size()));
      }
    }
    words.skip_line();
  }
  for (const std::vector<double>& face : faces) add_polygon(mesh, face);
  return mesh;
}

}  // namespace tissue_sim
