#include <algorithm>
#include <cctype>
#include <filesystem>
#include <locale>
#include <sstream>
#include <stdexcept>

#include "geometry/tet_mesh.h"
#include "scene/read_file.h"
#include "tissue_sim/limits.h"

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

/// The words of a file, one after the other, without comments.
class TetWords {
 public:
  explicit TetWords(const std::string& path) : path_(path) {
    std::string all;
    try {
      all = read_file(path, kLargestMesh);
    } catch (const std::invalid_argument& e) {
      refuse(path, e.what());
    }
    if (all.empty()) refuse(path, "is empty: export it again");
    std::istringstream lines(all);
    std::ostringstream kept;
    for (std::string line; std::getline(lines, line);) {
      kept << line.substr(0, line.find('#')) << '\n';
    }
    in_.str(kept.str());
    in_.imbue(std::locale::classic());
  }
  bool word(std::string& w) { return static_cast<bool>(in_ >> w); }
  double number(const char* what) {
    double v = 0;
    if (++read_ % 4096 == 0) stop_if_asked();
    if (!(in_ >> v))
      refuse(path_, std::string("ends, or has no number, where ") + what + " should be");
    return v;
  }
  int count(const char* what) {
    const double v = number(what);
    if (!(v >= 0 && v < 1e8) || v != static_cast<int>(v)) {
      refuse(path_, "has no valid " + std::string(what));
    }
    return static_cast<int>(v);
  }
  void skip(int n, const char* what) {
    for (int i = 0; i < n; ++i) number(what);
  }
  void skip_line() {
    std::string rest;
    std::getline(in_, rest);
  }

 private:
  std::string path_;
  std::istringstream in_;
  unsigned read_ = 0;
};

TetMesh read_tetgen(const std::string& path) {
  std::filesystem::path stem = path;
  stem.replace_extension();
  TetMesh mesh;
  TetWords nodes(stem.string() + ".node");
  const int n = nodes.count("the number of vertices");
  const int dimension = nodes.count("the dimension");
  if (dimension != 3)
    refuse(path, "has vertices of " + std::to_string(dimension) + " coordinates: 3 are needed");
  const int more = nodes.count("the number of attributes") + nodes.count("the number of markers");
  int first = 0;
  for (int i = 0; i < n; ++i) {
    const int index = nodes.count("a vertex's number");
    if (i == 0) first = index;
    Vec3 x;
    for (int a = 0; a < 3; ++a) x[a] = nodes.number("a coordinate");
    nodes.skip(more, "a vertex's attribute");
    mesh.vertices.push_back(x);
  }
  TetWords elements(stem.string() + ".ele");
  const int m = elements.count("the number of tetrahedra");
  const int corners = elements.count("the number of corners");
  const int attributes = elements.count("the number of attributes");
  if (corners != 4 && corners != 10) refuse(path, "has elements that are no tetrahedra");
  for (int i = 0; i < m; ++i) {
    elements.count("a tetrahedron's number");
    std::array<int, 4> t;
    for (int& v : t) v = elements.count("a vertex's number") - first;
    elements.skip(corners - 4 + attributes, "an attribute");
    mesh.tetrahedra.push_back(t);
  }
  return mesh;
}

TetMesh read_medit(const std::string& path) {
  TetWords in(path);
  TetMesh mesh;
  int dimension = 3;
  for (std::string word; in.word(word);) {
    if (word == "MeshVersionFormatted") {
      in.count("the version");
    } else if (word == "Dimension") {
      dimension = in.count("the dimension");
    } else if (word == "Vertices") {
      if (dimension != 3) refuse(path, "is not three-dimensional");
      const int n = in.count("the number of vertices");
      for (int i = 0; i < n; ++i) {
        Vec3 x;
        for (int a = 0; a < 3; ++a) x[a] = in.number("a coordinate");
        in.number("a vertex's mark");
        mesh.vertices.push_back(x);
      }
    } else if (word == "Tetrahedra") {
      const int n = in.count("the number of tetrahedra");
      for (int i = 0; i < n; ++i) {
        std::array<int, 4> t;
        for (int& v : t) v = in.count("a vertex's number") - 1;
        in.number("a tetrahedron's mark");
        mesh.tetrahedra.push_back(t);
      }
    } else if (word == "End") {
      break;
    }  // what else there is are numbers of other elements, and their names
  }
  return mesh;
}

TetMesh read_vtk(const std::string& path) {
  TetWords in(path);
  TetMesh mesh;
  std::vector<int> offsets, corners, types;
  bool listed = false;  // with a count before each cell, as in versions before 5
  for (std::string word; in.word(word);) {
    if (word == "BINARY") refuse(path, "is binary: save it as ASCII");
    if (word == "POINTS") {
      const int n = in.count("the number of points");
      in.word(word);
      for (int i = 0; i < n; ++i) {
        Vec3 x;
        for (int a = 0; a < 3; ++a) x[a] = in.number("a coordinate");
        mesh.vertices.push_back(x);
      }
    } else if (word == "CELLS") {
      const int n = in.count("the number of cells"), size = in.count("the size of the cells");
      std::string next;
      if (!in.word(next)) refuse(path, "ends within its cells");
      if (next == "OFFSETS") {
        in.word(next);
        for (int i = 0; i < n; ++i) offsets.push_back(in.count("an offset"));
        in.word(next);
        in.word(next);
        for (int i = 0; i < size; ++i) corners.push_back(in.count("a vertex's number"));
      } else {
        listed = true;
        double first = 0;
        std::istringstream(next) >> first;
        if (!(first >= 0 && first < 1e8)) refuse(path, "has no valid size of a cell");
        int k = static_cast<int>(first);
        for (int i = 0; i < n; ++i) {
          if (i > 0) k = in.count("a cell's size");
          offsets.push_back(static_cast<int>(corners.size()));
          for (int j = 0; j < k; ++j) corners.push_back(in.count("a vertex's number"));
        }
        offsets.push_back(static_cast<int>(corners.size()));
      }
    } else if (word == "CELL_TYPES") {
      const int n = in.count("the number of cells");
      for (int i = 0; i < n; ++i) types.push_back(in.count("a cell's type"));
    }
  }
  (void)listed;
  for (std::size_t i = 0; i < types.size() && i + 1 < offsets.size(); ++i) {
    constexpr int kTetrahedron = 10;
    if (types[i] != kTetrahedron || offsets[i + 1] - offsets[i] != 4) continue;
    if (offsets[i + 1] > static_cast<int>(corners.size())) {
      refuse(path, "has a cell beyond its list of vertices: export it again");
    }
    std::array<int, 4> t;
    std::copy_n(corners.begin() + offsets[i], 4, t.begin());
    mesh.tetrahedra.push_back(t);
  }
  return mesh;
}

}  // namespace

bool is_tet_file(const std::string& path) {
  const std::string e = extension_of(path);
  return e == ".node" || e == ".ele" || e == ".mesh" || e == ".vtk";
}

TetMesh read_tets(const std::string& path) {
  const std::string e = extension_of(path);
  TetMesh mesh = e == ".mesh" ? read_medit(path) : e == ".vtk" ? read_vtk(path) : read_tetgen(path);
  if (mesh.tetrahedra.empty()) refuse(path, "has no tetrahedra: export a volume mesh");
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
  return mesh;
}

}  // namespace tissue_sim
