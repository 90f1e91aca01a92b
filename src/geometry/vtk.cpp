// Legacy VTK files. What writers differ in: cells are listed with their sizes in front, or from
// version 5 on as offsets; whatever fields and metadata come between.
#include <algorithm>
#include <vector>

#include "geometry/mesh_numbers.h"
#include "geometry/volume_cells.h"

namespace tissue_sim {
namespace {

NumberType type_at(MeshNumbers& in) {
  const std::size_t at = in.place();
  std::string name;
  in.word(name);
  const NumberType type = number_type(name);
  if (type == NumberType::kNone) in.refuse("has numbers of an unknown type", at);
  in.skip_line();
  return type;
}

/// The corners of each cell one after the other, and where each ends.
struct CellList {
  std::vector<int> corners;
  std::vector<std::size_t> ends;
};

CellList read_offsets(MeshNumbers& in, int offsets, int size) {
  CellList list;
  std::string word;
  in.word(word);
  NumberType type = type_at(in);
  std::size_t before = 0;
  for (int i = 0; i < offsets; ++i) {
    const std::size_t at = in.place();
    const auto end = static_cast<std::size_t>(in.whole(type, "a cell's offset"));
    if (end < before || end > (i > 0 ? static_cast<std::size_t>(size) : 0)) {
      in.refuse("has a cell beyond its list of vertices", at);
    }
    if (i > 0) list.ends.push_back(end);
    before = end;
  }
  const std::size_t at = in.place();
  in.word(word);
  if (word != "connectivity") in.refuse("has no connectivity behind its offsets", at);
  type = type_at(in);
  for (int i = 0; i < size; ++i) list.corners.push_back(in.whole(type, "a vertex's number"));
  return list;
}

/// The size that the file says stands for nothing: it is wrong in files that people have.
CellList read_sizes(MeshNumbers& in, int cells, std::size_t bytes) {
  CellList list;
  for (int i = 0; i < cells; ++i) {
    const std::size_t at = in.place();
    const int count = in.whole(NumberType::kInt32, "a cell's size");
    if (static_cast<std::size_t>(count) > bytes)
      in.refuse("has a cell of " + std::to_string(count) + " corners", at);
    for (int k = 0; k < count; ++k) {
      list.corners.push_back(in.whole(NumberType::kInt32, "a vertex's number"));
    }
    list.ends.push_back(list.corners.size());
  }
  return list;
}

/// What no mesh needs, but stands before it: arrays with a name.
void skip_fields(MeshNumbers& in, int count) {
  std::string word;
  for (int i = 0; i < count; ++i) {
    in.word(word);
    if (word == "metadata") {  // of the array before: lines, the last of which is empty
      in.skip_past("\n\n");
      in.word(word);
    }
    const auto components = in.whole(NumberType::kNone, "a field's number of components");
    const auto tuples = in.whole(NumberType::kNone, "a field's length");
    const std::size_t size = size_of(type_at(in));
    in.skip(static_cast<std::size_t>(components) * static_cast<std::size_t>(tuples) * size,
            "a field");
  }
}

}  // namespace

VolumeCells read_vtk(const std::string& bytes) {
  MeshNumbers in(bytes, 0, NumberFormat::kText);
  std::string word;
  in.word(word);
  if (word != "#" && word != "#vtk")
    in.refuse("is no legacy VTK file (it does not begin with # vtk)", 0);
  in.skip_line();
  in.skip_line();  // a title, that may be any words
  in.word(word);
  const bool is_binary = word == "binary";
  if (!is_binary && word != "ascii") in.refuse("says neither ASCII nor BINARY", in.place());
  if (is_binary) in.set_format(NumberFormat::kBigEndian);
  VolumeCells cells;
  CellList list;
  std::vector<int> types;
  while (in.word(word)) {
    if (word == "dataset") {
      in.word(word);
      if (word != "unstructured_grid") {
        throw std::invalid_argument("holds " + word.substr(0, 40) +
                                    ", and tetrahedra are an UNSTRUCTURED_GRID: save it as that, "
                                    "or a surface as STL, OBJ, PLY or OFF");
      }
    } else if (word == "field" && is_binary) {
      in.word(word);
      const int count = in.whole(NumberType::kNone, "the number of fields");
      skip_fields(in, count);
    } else if (word == "points") {
      const int count = in.whole(NumberType::kNone, "the number of points");
      const NumberType type = type_at(in);
      for (int i = 0; i < count; ++i) {
        Vec3 x;
        for (double& c : x) c = in.next(type, "a coordinate");
        cells.mesh.vertices.push_back(x);
      }
    } else if (word == "cells") {
      const int count = in.whole(NumberType::kNone, "the number of cells");
      const int size = in.whole(NumberType::kNone, "the size of the cells");
      in.skip_line();
      MeshNumbers ahead = in;
      ahead.word(word);
      list =
          word == "offsets" ? read_offsets(in, count, size) : read_sizes(in, count, bytes.size());
    } else if (word == "cell_types") {
      const int count = in.whole(NumberType::kNone, "the number of cells");
      in.skip_line();
      for (int i = 0; i < count; ++i) {
        types.push_back(in.whole(NumberType::kInt32, "a cell's type"));
      }
    } else if (word == "cell_data" || word == "point_data") {
      break;
    }
  }
  if (types.size() != list.ends.size()) {
    in.refuse("has " + std::to_string(list.ends.size()) + " cells and types of " +
                  std::to_string(types.size()),
              in.place());
  }
  for (std::size_t i = 0; i < types.size(); ++i) {
    const std::size_t begin = i > 0 ? list.ends[i - 1] : 0;
    cells.add(vtk_cell(types[i]), list.corners.data() + begin,
              static_cast<int>(list.ends[i] - begin));
  }
  return cells;
}

CellKind vtk_cell(int type) {
  constexpr struct {
    int type;
    CellKind kind;
  } kKinds[] = {
      {1, CellKind::kPoint},         {2, CellKind::kPoint},          {3, CellKind::kLine},
      {4, CellKind::kLine},          {21, CellKind::kLine},          {5, CellKind::kTriangle},
      {6, CellKind::kTriangle},      {22, CellKind::kTriangle},      {8, CellKind::kQuadrilateral},
      {9, CellKind::kQuadrilateral}, {23, CellKind::kQuadrilateral}, {10, CellKind::kTetrahedron},
      {24, CellKind::kTetrahedron},  {71, CellKind::kTetrahedron},   {11, CellKind::kVoxel},
      {12, CellKind::kHexahedron},   {25, CellKind::kHexahedron},    {29, CellKind::kHexahedron},
      {33, CellKind::kHexahedron},   {72, CellKind::kHexahedron},    {13, CellKind::kWedge},
      {26, CellKind::kWedge},        {14, CellKind::kPyramid},       {27, CellKind::kPyramid}};
  for (const auto& k : kKinds) {
    if (k.type == type) return k.kind;
  }
  return CellKind::kOther;
}

}  // namespace tissue_sim
