// A reader of our own: what CAD programs write has bytes after the last triangle, capitals, and
// normals such as "-nan(ind)".
#include "geometry/stl.h"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <cstring>
#include <stdexcept>

#include "geometry/mesh_words.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace {

constexpr std::size_t kHeader = 84, kTriangle = 50;  // [bytes]

std::uint32_t little_endian(const char* p) {
  std::uint32_t value = 0;
  for (int i = 3; i >= 0; --i) value = value << 8 | static_cast<unsigned char>(p[i]);
  return value;
}

float real(const char* p) {
  const std::uint32_t bits = little_endian(p);
  float value;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

void add_triangle(TriangleMesh& mesh) {
  const int end = static_cast<int>(mesh.vertices.size());
  mesh.triangles.push_back({end - 3, end - 2, end - 1});
}

TriangleMesh read_binary(const std::string& bytes, std::size_t count) {
  TriangleMesh mesh;
  mesh.vertices.reserve(3 * count);
  mesh.triangles.reserve(count);
  for (std::size_t t = 0; t < count; ++t) {
    if (t % 4096 == 0) stop_if_asked();
    const char* p = bytes.data() + kHeader + t * kTriangle + 12;  // after the normal
    for (int k = 0; k < 3; ++k, p += 12) {
      mesh.vertices.emplace_back(real(p), real(p + 4), real(p + 8));
    }
    add_triangle(mesh);
  }
  return mesh;
}

TriangleMesh read_text(const std::string& bytes, std::size_t first) {
  TriangleMesh mesh;
  MeshWords words(bytes, first);
  std::string word;
  int corners = 0;
  const auto facet = [&] { return "facet " + std::to_string(mesh.triangles.size() + 1); };
  while (words.next(word)) {
    if (word == "solid" || word == "endsolid") {
      words.skip_line();  // a name, that may be any words
    } else if (word == "vertex") {
      Vec3 v;
      for (double& x : v) {
        if (!words.next(x)) {
          throw std::invalid_argument("has a vertex in " + facet() +
                                      " that is no three numbers: export it again");
        }
      }
      mesh.vertices.push_back(v);
      ++corners;
    } else if (word == "endloop") {
      if (corners != 3) {
        throw std::invalid_argument("has " + std::to_string(corners) + " corners in " + facet() +
                                    ": an STL file holds triangles");
      }
      add_triangle(mesh);
      corners = 0;
    }
  }
  if (corners != 0) {
    throw std::invalid_argument("ends within " + facet() + ": export or copy it again");
  }
  return mesh;
}

/// Where the word "solid" begins, in letters of any size; the text's length where it does not begin
/// with it.
std::size_t solid_in(const std::string& bytes) {
  std::size_t at = bytes.compare(0, 3, "\xEF\xBB\xBF") == 0 ? 3 : 0;  // the mark of UTF-8
  while (at < bytes.size() && std::isspace(static_cast<unsigned char>(bytes[at]))) ++at;
  std::string word = bytes.substr(at, 5);
  for (char& c : word) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return word == "solid" ? at : bytes.size();
}

}  // namespace

TriangleMesh read_stl(const std::string& bytes) {
  const std::size_t solid = solid_in(bytes);
  // A binary file's count, at byte 80, has a zero in it; what follows a text's end may have some.
  const bool is_text = bytes.find('\0') >= std::min(kHeader, bytes.size());
  if (is_text && solid < bytes.size()) return read_text(bytes, solid);
  if (is_text || bytes.size() < kHeader) {
    throw std::invalid_argument(
        "is no STL file (text begins with \"solid\", binary has a header of 84 bytes): export it "
        "again as a binary STL");
  }
  const std::size_t room = (bytes.size() - kHeader) / kTriangle;
  const bool whole = (bytes.size() - kHeader) % kTriangle == 0;
  std::size_t count = little_endian(bytes.data() + 80);
  if (count == 0 && whole) count = room;
  if (count > room) {
    throw std::invalid_argument("ends after " + std::to_string(room) + " of the " +
                                std::to_string(count) +
                                " triangles that its header counts: export or copy it again");
  }
  return read_binary(bytes, count);
}

}  // namespace tissue_sim
