#include "geometry/ply.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <stdexcept>
#include <vector>

#include "geometry/mesh_numbers.h"
#include "geometry/polygon.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace ply_file {
namespace {

using Type = NumberType;

[[noreturn]] void refuse_file(const std::string& why) { throw std::invalid_argument(why); }

Type type_of(const std::string& name) {
  const Type type = number_type(name);
  if (type != Type::kNone) return type;
  refuse_file("is a PLY file with a property of an unknown type: export it again");
}

struct Property {
  Type count = Type::kNone;  ///< of a list
  Type type = Type::kNone;
  std::string name;
};

struct Element {
  std::string name;
  double count = 0;
  std::vector<Property> properties;

  int find(const std::string& property) const {
    for (std::size_t i = 0; i < properties.size(); ++i) {
      if (properties[i].name == property) return static_cast<int>(i);
    }
    return -1;
  }
};

struct Header {
  NumberFormat format = NumberFormat::kText;
  std::vector<Element> elements;
  std::size_t end = 0;  ///< where the data begins [bytes]
};

Header read_header(const std::string& bytes) {
  Header header;
  MeshWords words(bytes, 3);
  std::string word, type;
  bool known_format = false;
  for (bool ended = false; !ended;) {
    if (!words.next(word)) refuse_file("ends within its header: export or copy it again");
    if (word == "format") {
      words.next_in_line(word);
      known_format =
          word == "ascii" || word == "binary_little_endian" || word == "binary_big_endian";
      header.format = word == "ascii"               ? NumberFormat::kText
                      : word == "binary_big_endian" ? NumberFormat::kBigEndian
                                                    : NumberFormat::kLittleEndian;
    } else if (word == "element") {
      Element e;
      if (!words.next_in_line(e.name) || !words.next_in_line(e.count) || !(e.count >= 0)) {
        refuse_file("has an element without a number in its header: export it again");
      }
      header.elements.push_back(e);
    } else if (word == "property") {
      if (header.elements.empty()) refuse_file("has a property of nothing in its header");
      Property p;
      words.next_in_line(type);
      if (type == "list") {
        words.next_in_line(type);
        p.count = type_of(type);
        words.next_in_line(type);
      }
      p.type = type_of(type);
      words.next_in_line(p.name);
      header.elements.back().properties.push_back(p);
    }
    ended = word == "end_header";
    words.skip_line();  // whatever else stands in it; comments
  }
  header.end = words.place();
  // One end of line, of one character or two; what follows may begin with any.
  if (header.end < bytes.size() && bytes[header.end] == '\r') ++header.end;
  if (header.end < bytes.size() && bytes[header.end] == '\n') ++header.end;
  if (!known_format) refuse_file("is a PLY file of an unknown format: export it again");
  return header;
}

}  // namespace
}  // namespace ply_file

TriangleMesh read_ply(const std::string& bytes) {
  using namespace ply_file;
  if (bytes.compare(0, 3, "ply") != 0 && bytes.compare(0, 3, "PLY") != 0) {
    refuse_file("is no PLY file (it does not begin with \"ply\"): export it again");
  }
  const Header header = read_header(bytes);
  TriangleMesh mesh;
  std::vector<double> corners, corners_of_all;  // faces may come before vertices
  std::vector<std::size_t> ends;
  MeshNumbers numbers(bytes, header.end, header.format);
  constexpr const char* kWhat = "a number of its elements";
  for (const Element& element : header.elements) {
    const bool is_vertex = element.name == "vertex", is_face = element.name == "face";
    const int place[3] = {element.find("x"), element.find("y"), element.find("z")};
    if (is_vertex && std::min({place[0], place[1], place[2]}) < 0) {
      refuse_file("has vertices without x, y and z: export it again");
    }
    int list = element.find("vertex_indices");
    if (list < 0) list = element.find("vertex_index");
    if (is_face && element.count > 0 && (list < 0 || element.properties[list].count == Type::kNone))
      refuse_file("has faces without a list vertex_indices: export it again");
    if (element.properties.empty()) continue;
    for (double i = 0; i < element.count; ++i) {
      if (mesh.vertices.size() % 4096 == 0) stop_if_asked();
      Vec3 x = Vec3::Zero();
      for (std::size_t p = 0; p < element.properties.size(); ++p) {
        const Property& property = element.properties[p];
        if (property.count == Type::kNone) {
          const double value = numbers.next(property.type, kWhat);
          for (int a = 0; a < 3; ++a) {
            if (place[a] == static_cast<int>(p)) x[a] = value;
          }
          continue;
        }
        const double count = numbers.next(property.count, kWhat);
        const bool is_corners = is_face && static_cast<int>(p) == list;
        for (double k = 0; k < count; ++k) {
          const double corner = numbers.next(property.type, kWhat);
          if (is_corners) corners_of_all.push_back(corner);
        }
      }
      if (is_vertex) mesh.vertices.push_back(x);
      if (is_face) ends.push_back(corners_of_all.size());
    }
  }
  std::size_t first = 0;
  for (const std::size_t end : ends) {
    corners.assign(corners_of_all.begin() + static_cast<std::ptrdiff_t>(first),
                   corners_of_all.begin() + static_cast<std::ptrdiff_t>(end));
    add_polygon(mesh, corners);
    first = end;
  }
  return mesh;
}

std::string to_ply(const SurfaceTriangles& surface, const std::vector<std::uint32_t>& colours) {
  const auto put = [](std::string& bytes, std::uint32_t word) {
    for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(word >> shift & 0xff);
  };
  using Corner = std::array<std::uint32_t, 4>;  // the bits of its place, and its piece
  std::map<Corner, std::uint32_t> numbers;
  std::string vertices, faces;
  for (std::size_t t = 0; t < surface.fragment.size(); ++t) {
    faces += '\3';
    for (std::size_t c = 0; c < 3; ++c) {
      Corner corner;
      std::memcpy(corner.data(), &surface.corners[9 * t + 3 * c], 3 * sizeof(float));
      corner[3] = static_cast<std::uint32_t>(surface.fragment[t]);
      const auto next = static_cast<std::uint32_t>(numbers.size());
      const auto [found, is_new] = numbers.emplace(corner, next);
      put(faces, found->second);
      for (int a = 0; is_new && a < 3; ++a) put(vertices, corner[a]);
    }
    put(faces, static_cast<std::uint32_t>(surface.fragment[t]));
    faces += static_cast<char>(surface.cut[t]);
    for (int shift = 16; shift >= 0; shift -= 8) {
      faces += static_cast<char>(colours[t] >> shift & 0xff);
    }
  }
  return "ply\nformat binary_little_endian 1.0\ncomment metres\nelement vertex " +
         std::to_string(numbers.size()) +
         "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
         std::to_string(surface.fragment.size()) +
         "\nproperty list uchar int vertex_indices\nproperty int fragment\nproperty uchar cut\n"
         "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n" +
         vertices + faces;
}

}  // namespace tissue_sim
