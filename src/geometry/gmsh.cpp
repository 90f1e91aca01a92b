// Gmsh's files: versions 2 and 4.1, as text and binary.
#include <unordered_map>
#include <vector>

#include "geometry/mesh_numbers.h"
#include "geometry/volume_cells.h"

namespace tissue_sim {
namespace {

struct GmshElement {
  CellKind kind;
  int corners;
};

/// By Gmsh's number of a type, from 1 on.
constexpr GmshElement kGmshElements[] = {
    {CellKind::kLine, 2},          {CellKind::kTriangle, 3},     {CellKind::kQuadrilateral, 4},
    {CellKind::kTetrahedron, 4},   {CellKind::kHexahedron, 8},   {CellKind::kWedge, 6},
    {CellKind::kPyramid, 5},       {CellKind::kLine, 3},         {CellKind::kTriangle, 6},
    {CellKind::kQuadrilateral, 9}, {CellKind::kTetrahedron, 10}, {CellKind::kHexahedron, 27},
    {CellKind::kWedge, 18},        {CellKind::kPyramid, 14},     {CellKind::kPoint, 1},
    {CellKind::kQuadrilateral, 8}, {CellKind::kHexahedron, 20},  {CellKind::kWedge, 15},
    {CellKind::kPyramid, 13},      {CellKind::kTriangle, 9},     {CellKind::kTriangle, 10},
    {CellKind::kTriangle, 12},     {CellKind::kTriangle, 15},    {CellKind::kTriangle, 15},
    {CellKind::kTriangle, 21},     {CellKind::kLine, 4},         {CellKind::kLine, 5},
    {CellKind::kLine, 6},          {CellKind::kTetrahedron, 20}, {CellKind::kTetrahedron, 35},
    {CellKind::kTetrahedron, 56}};

class GmshFile {
 public:
  explicit GmshFile(const std::string& bytes) : in_(bytes, 0, NumberFormat::kText) {}

  VolumeCells read() {
    std::string word;
    while (in_.word(word)) {
      if (word == "$meshformat") {
        read_format();
      } else if (version_ != 0 && (word == "$nodes" || word == "$elements")) {
        in_.skip_line();
        if (word == "$nodes") {
          version_ < 4 ? read_nodes_2() : read_nodes_4();
        } else {
          version_ < 4 ? read_elements_2() : read_elements_4();
        }
      } else if (word[0] == '$' && (version_ != 0 || word == "$comments")) {
        in_.skip_past("\n$End");  // whatever is in it
        in_.word(word);
        continue;
      } else {
        in_.refuse(
            version_ == 0 ? "is no Gmsh file (it begins with no $MeshFormat)" : "has no section",
            in_.place());
      }
      const std::size_t at = in_.place();
      if (!in_.word(word) || word.compare(0, 4, "$end") != 0) {
        in_.refuse("has more in a section than it counts, or ends within it", at);
      }
    }
    for (const Waiting& e : waiting_) add(e);
    return std::move(cells_);
  }

 private:
  struct Waiting {  // for nodes may come behind
    CellKind kind;
    int count;
    std::size_t first, place;
  };

  void read_format() {
    version_ = in_.next(NumberType::kNone, "the version");
    if (!(version_ >= 2 && version_ < 3) && version_ != 4.1) {
      in_.refuse("is of a version of Gmsh's format that is neither 2 nor 4.1", in_.place());
    }
    const bool is_binary = in_.whole(NumberType::kNone, "the kind of file") != 0;
    const int size = in_.whole(NumberType::kNone, "the size of numbers");
    if (size != 8 && size != 4) in_.refuse("has no valid size of numbers", in_.place());
    size_ = size == 8 ? NumberType::kUint64 : NumberType::kUint32;
    in_.skip_line();
    if (!is_binary) return;
    const std::size_t at = in_.place();
    in_.set_format(NumberFormat::kLittleEndian);
    const double one = in_.next(NumberType::kInt32, "the number one");
    if (one == 1 << 24) {
      in_.set_format(NumberFormat::kBigEndian);
    } else if (one != 1) {
      in_.refuse("has no number one by which its bytes' order shows", at);
    }
  }

  void add_node(int tag) {
    const auto index = static_cast<int>(cells_.mesh.vertices.size());
    index_of_.emplace(tag, index);
    Vec3 x;
    for (double& c : x) c = in_.next(NumberType::kDouble, "a coordinate");
    cells_.mesh.vertices.push_back(x);
  }

  void read_nodes_2() {
    const int count = in_.whole(NumberType::kNone, "the number of nodes");
    in_.skip_line();
    for (int i = 0; i < count; ++i) add_node(in_.whole(NumberType::kInt32, "a node's number"));
  }

  void read_nodes_4() {
    const int blocks = in_.whole(size_, "the number of blocks");
    for (int i = 0; i < 3; ++i) in_.next(size_, "the number of nodes");
    std::vector<int> tags;
    for (int b = 0; b < blocks; ++b) {
      const int dimension = in_.whole(NumberType::kInt32, "an entity's dimension");
      in_.next(NumberType::kInt32, "an entity's number");
      const int parametric = in_.whole(NumberType::kInt32, "a flag");
      const int count = in_.whole(size_, "the number of nodes");
      if (dimension > 3) in_.refuse("has an entity of more than 3 dimensions", in_.place());
      tags.clear();
      for (int i = 0; i < count; ++i) tags.push_back(in_.whole(size_, "a node's number"));
      for (const int tag : tags) {
        add_node(tag);
        for (int k = 0; parametric != 0 && k < dimension; ++k) {
          in_.next(NumberType::kDouble, "a node's parameter");
        }
      }
    }
  }

  const GmshElement& element(int type, std::size_t at) const {
    constexpr int kCount = sizeof kGmshElements / sizeof kGmshElements[0];
    if (type < 1 || type > kCount) {
      in_.refuse("has elements of an unknown type " + std::to_string(type), at);
    }
    return kGmshElements[type - 1];
  }

  void read_corners(const GmshElement& e, NumberType type) {
    waiting_.push_back({e.kind, e.corners, corners_.size(), in_.place()});
    for (int k = 0; k < e.corners; ++k) corners_.push_back(in_.whole(type, "a node's number"));
  }

  void read_elements_2() {
    const int count = in_.whole(NumberType::kNone, "the number of elements");
    in_.skip_line();
    constexpr NumberType kInt = NumberType::kInt32;
    for (int i = 0; i < count;) {
      // As text each element says what it is, in binary each block of them.
      const std::size_t at = in_.place();
      if (!in_.is_binary()) in_.whole(kInt, "an element's number");
      const GmshElement& e = element(in_.whole(kInt, "an element's type"), at);
      const int block = in_.is_binary() ? in_.whole(kInt, "the number of elements") : 1;
      const int tags = in_.whole(kInt, "the number of tags");
      if (block < 1 || block > count - i) in_.refuse("counts no valid number of elements", at);
      for (int k = 0; k < block; ++k, ++i) {
        if (in_.is_binary()) in_.next(kInt, "an element's number");
        for (int t = 0; t < tags; ++t) in_.next(kInt, "a tag");
        read_corners(e, kInt);
      }
    }
  }

  void read_elements_4() {
    const int blocks = in_.whole(size_, "the number of blocks");
    for (int i = 0; i < 3; ++i) in_.next(size_, "the number of elements");
    for (int b = 0; b < blocks; ++b) {
      for (int i = 0; i < 2; ++i) in_.next(NumberType::kInt32, "an entity");
      const std::size_t at = in_.place();
      const GmshElement& e = element(in_.whole(NumberType::kInt32, "an element's type"), at);
      const int count = in_.whole(size_, "the number of elements");
      for (int k = 0; k < count; ++k) {
        in_.next(size_, "an element's number");
        read_corners(e, size_);
      }
    }
  }

  void add(const Waiting& e) {
    indices_.clear();
    for (int k = 0; k < e.count; ++k) {
      const int tag = corners_[e.first + k];
      const auto found = index_of_.find(tag);
      if (found == index_of_.end()) {
        in_.refuse("has an element with node " + std::to_string(tag) + ", which is not there",
                   e.place);
      }
      indices_.push_back(found->second);
    }
    cells_.add(e.kind, indices_.data(), e.count);
  }

  MeshNumbers in_;
  double version_ = 0;
  NumberType size_ = NumberType::kUint64;  ///< of counts and tags in version 4
  VolumeCells cells_;
  std::unordered_map<int, int> index_of_;  ///< of nodes, by tag
  std::vector<Waiting> waiting_;
  std::vector<int> corners_, indices_;
};

}  // namespace

VolumeCells read_gmsh(const std::string& bytes) { return GmshFile(bytes).read(); }

}  // namespace tissue_sim
