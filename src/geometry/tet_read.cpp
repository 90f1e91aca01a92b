#include <array>
#include <cctype>
#include <filesystem>
#include <stdexcept>

#include "geometry/mesh_numbers.h"
#include "geometry/volume_cells.h"
#include "scene/read_file.h"

namespace tissue_sim {
namespace {

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
  throw std::invalid_argument("mesh " + path + " " + why);
}

std::string extension_of(const std::string& path) {
  std::string e = std::filesystem::path(path).extension().string();
  for (char& c : e) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return e;
}

std::string file_bytes(const std::string& path) {
  const std::string bytes = read_file(path, kLargestMesh);
  if (bytes.empty()) throw std::invalid_argument("is empty: export it again");
  return bytes;
}

std::string without_comments(std::string text) {
  bool within = false;
  for (char& c : text) {
    within = c != '\n' && (within || c == '#');
    if (within) c = ' ';
  }
  return text;
}

/// The numbers of a text file, all of which are written out.
class TextNumbers : public MeshNumbers {
 public:
  explicit TextNumbers(const std::string& text) : MeshNumbers(text, 0, NumberFormat::kText) {}
  double number(const char* what) { return next(NumberType::kNone, what); }
  int count(const char* what) { return whole(NumberType::kNone, what); }
  void skip_numbers(int n, const char* what) {
    for (int i = 0; i < n; ++i) number(what);
  }
  Vec3 place_in_space() {
    Vec3 x;
    for (double& c : x) c = number("a coordinate");
    return x;
  }
};

VolumeCells read_tetgen(const std::string& path) {
  std::filesystem::path stem = path;
  const std::string extension = extension_of(path);
  // Of the pair the file that is not the one named is named by what is wrong with it.
  const auto text_of = [&](const char* of) {
    stem.replace_extension(of);
    try {
      return without_comments(file_bytes(stem.string()));
    } catch (const std::invalid_argument& e) {
      if (extension == of) throw;
      throw std::invalid_argument("needs " + stem.string() + ", which " + e.what());
    }
  };
  VolumeCells cells;
  const std::string node_text = text_of(".node");
  TextNumbers nodes(node_text);
  const int n = nodes.count("the number of vertices");
  const int dimension = nodes.count("the dimension");
  if (dimension != 3) {
    nodes.refuse("has vertices of " + std::to_string(dimension) + " coordinates: 3 are needed", 0);
  }
  const int attributes = nodes.count("the number of attributes");
  const int markers = nodes.count("the number of markers");
  int first = 0;
  for (int i = 0; i < n; ++i) {
    const int index = nodes.count("a vertex's number");
    if (i == 0) first = index;
    cells.mesh.vertices.push_back(nodes.place_in_space());
    nodes.skip_numbers(attributes, "a vertex's attribute");
    nodes.skip_numbers(markers, "a vertex's marker");
  }
  const std::string element_text = text_of(".ele");
  TextNumbers elements(element_text);
  const int m = elements.count("the number of tetrahedra");
  const int corners = elements.count("the number of corners");
  const int regions = elements.count("the number of attributes");
  if (corners != 4 && corners != 10) elements.refuse("has elements that are no tetrahedra", 0);
  for (int i = 0; i < m; ++i) {
    elements.count("a tetrahedron's number");
    std::array<int, 4> t;
    for (int& v : t) v = elements.count("a vertex's number") - first;
    elements.skip_numbers(corners - 4, "a vertex's number");
    elements.skip_numbers(regions, "an attribute");
    cells.add(CellKind::kTetrahedron, t.data(), 4);
  }
  return cells;
}

VolumeCells read_medit(const std::string& bytes) {
  const std::string text = without_comments(bytes);
  TextNumbers in(text);
  VolumeCells cells;
  const struct {
    const char* name;
    CellKind kind;
    int corners;
  } kinds[] = {{"edges", CellKind::kLine, 2},
               {"triangles", CellKind::kTriangle, 3},
               {"quadrilaterals", CellKind::kQuadrilateral, 4},
               {"tetrahedra", CellKind::kTetrahedron, 4},
               {"hexahedra", CellKind::kHexahedron, 8},
               {"prisms", CellKind::kWedge, 6},
               {"pyramids", CellKind::kPyramid, 5}};
  int dimension = 3;
  for (std::string word; in.word(word) && word != "end";) {
    if (word == "meshversionformatted") {
      in.count("the version");
    } else if (word == "dimension") {
      dimension = in.count("the dimension");
    } else if (word == "vertices") {
      if (dimension != 3) in.refuse("is not three-dimensional", in.place());
      const int n = in.count("the number of vertices");
      for (int i = 0; i < n; ++i) {
        cells.mesh.vertices.push_back(in.place_in_space());
        in.number("a vertex's mark");
      }
    }
    for (const auto& of : kinds) {  // what else there is are numbers of others, and their names
      if (word != of.name) continue;
      const int n = in.count("the number of cells");
      for (int i = 0; i < n; ++i) {
        std::array<int, 8> c{};
        for (int k = 0; k < of.corners; ++k) c[k] = in.count("a vertex's number") - 1;
        in.number("a cell's mark");
        cells.add(of.kind, c.data(), of.corners);
      }
    }
  }
  return cells;
}

using ReadCells = VolumeCells (*)(const std::string& bytes);

/// What reads files of that extension; nullptr for TetGen's, which are two.
ReadCells cell_reader_of(const std::string& extension) {
  return extension == ".mesh"  ? read_medit
         : extension == ".vtk" ? read_vtk
         : extension == ".vtu" ? read_vtu
         : extension == ".msh" ? read_gmsh
                               : nullptr;
}

}  // namespace

bool is_tet_file(const std::string& path) {
  const std::string e = extension_of(path);
  return cell_reader_of(e) != nullptr || e == ".node" || e == ".ele";
}

TetMesh read_tets(const std::string& path, std::vector<std::string>* notes) {
  VolumeCells cells;
  try {
    const ReadCells read = cell_reader_of(extension_of(path));
    cells = read != nullptr ? read(file_bytes(path)) : read_tetgen(path);
  } catch (const std::invalid_argument& e) {
    refuse(path, e.what());
  }
  TetMesh& mesh = cells.mesh;
  if (mesh.tetrahedra.empty()) {
    const std::string note = cells.note();
    refuse(path, (note.empty() ? "has no tetrahedra" : note) +
                     ": export a volume mesh, or a surface as STL, OBJ, PLY or OFF");
  }
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (mesh.vertices[v].allFinite()) continue;
    refuse(path,
           "has coordinates that are not finite (vertex " + std::to_string(v) + "): repair it");
  }
  const int n = static_cast<int>(mesh.vertices.size());
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    for (const int v : mesh.tetrahedra[t]) {
      if (v >= 0 && v < n) continue;
      refuse(path, "has a vertex in tetrahedron " + std::to_string(t) +
                       " that is not there: there are " + std::to_string(n));
    }
  }
  const std::string note = cells.note();
  if (notes != nullptr && !note.empty()) notes->push_back(note);
  return std::move(mesh);
}

}  // namespace tissue_sim
