#include "geometry/off.h"

#include <cstdint>
#include <stdexcept>
#include <vector>

#include "geometry/byte_order.h"
#include "geometry/mesh_words.h"
#include "geometry/polygon.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace off_file {
namespace {

[[noreturn]] void refuse(const std::string& why) { throw std::invalid_argument(why); }
[[noreturn]] void ended() {
  refuse("ends, or has no number, within its vertices and faces: export or copy it again");
}

TriangleMesh read_text(const std::string& bytes, std::size_t first) {
  MeshWords words(bytes, first);
  const auto number = [&words](bool in_line) {
    if (!in_line) words.skip_comments('#');
    double value = 0;
    if (!(in_line ? words.next_in_line(value) : words.next(value))) ended();
    return value;
  };
  const double vertices = number(false), faces = number(true);
  words.skip_line();  // the number of edges, which may lack
  TriangleMesh mesh;
  for (double i = 0; i < vertices; ++i) {
    const double x = number(false), y = number(true), z = number(true);
    mesh.vertices.emplace_back(x, y, z);
    words.skip_line();  // normals and colours
    if (mesh.vertices.size() % 4096 == 0) stop_if_asked();
  }
  std::vector<double> corners;
  for (double i = 0; i < faces; ++i) {
    const double count = number(false);
    corners.clear();
    for (double k = 0; k < count; ++k) corners.push_back(number(true));
    words.skip_line();
    add_polygon(mesh, corners);
  }
  return mesh;
}

/// Geomview writes big-endian; others the order of their machine.
TriangleMesh read_binary(const std::string& bytes, std::size_t at) {
  const std::size_t size = bytes.size();
  if (size - at < 12) ended();
  const std::uint32_t big = number_at<std::uint32_t>(&bytes[at], true);
  const bool big_endian = big <= (size - at) / 12;
  const auto integer = [&] {
    if (size - at < 4) ended();
    at += 4;
    return number_at<std::uint32_t>(&bytes[at - 4], big_endian);
  };
  const auto real = [&] {
    if (size - at < 4) ended();
    at += 4;
    return static_cast<double>(number_at<float>(&bytes[at - 4], big_endian));
  };
  const std::uint32_t vertices = integer(), faces = integer();
  integer();  // edges
  TriangleMesh mesh;
  for (std::uint32_t i = 0; i < vertices; ++i) {
    const double x = real(), y = real(), z = real();
    mesh.vertices.emplace_back(x, y, z);
  }
  std::vector<double> corners;
  for (std::uint32_t i = 0; i < faces; ++i) {
    const std::uint32_t count = integer();
    corners.clear();
    for (std::uint32_t k = 0; k < count; ++k) corners.push_back(integer());
    const std::uint32_t colours = integer();
    for (std::uint32_t k = 0; k < colours; ++k) real();
    add_polygon(mesh, corners);
  }
  return mesh;
}

}  // namespace
}  // namespace off_file

TriangleMesh read_off(const std::string& bytes) {
  using off_file::read_binary;
  using off_file::read_text;
  MeshWords words(bytes, 0);
  std::string word;
  words.skip_comments('#');
  const std::size_t begin = words.place();
  words.next(word);
  const bool named = word.size() >= 3 && word.compare(word.size() - 3, 3, "off") == 0;
  if (!named) return read_text(bytes, begin);  // the word may lack
  if (word.find_first_of("4n") != word.npos && word != "noff" && word != "cnoff") {
    off_file::refuse("has vertices of other than three coordinates: export it again");
  }
  const std::size_t after = words.place();
  if (words.next_in_line(word) && word == "binary") {
    std::size_t data = words.place();
    if (data < bytes.size() && bytes[data] == '\r') ++data;
    if (data < bytes.size() && bytes[data] == '\n') ++data;
    if (named && begin + 3 != after)
      off_file::refuse("is a binary OFF file with more than places: save it as text");
    return read_binary(bytes, data);
  }
  return read_text(bytes, after);
}

}  // namespace tissue_sim
