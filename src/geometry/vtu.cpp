// VTK's XML files of unstructured grids: arrays as text, in base64, or raw behind the tags; as they
// are or deflated in blocks.
#include <zlib.h>

#include <algorithm>
#include <map>
#include <vector>

#include "geometry/mesh_numbers.h"
#include "geometry/volume_cells.h"
#include "scene/read_file.h"

namespace tissue_sim {
namespace {

struct XmlTag {
  std::string name;  ///< with a slash in front where it ends something
  std::map<std::string, std::string> attributes;
  std::size_t end = 0;  ///< behind it [bytes]
};

class VtuFile {
 public:
  explicit VtuFile(const std::string& bytes) : bytes_(bytes) {}

  VolumeCells read() {
    find_appended();
    XmlTag tag;
    std::string within;  // Points or Cells
    std::map<std::string, XmlTag> arrays;
    std::size_t piece = 0;
    bool is_grid = false;
    for (std::size_t at = 0; at < tags_end_ && next_tag(at, tag); at = tag.end) {
      if (tag.name == "VTKFile") {
        is_grid = tag.attributes["type"] == "UnstructuredGrid";
        big_endian_ = tag.attributes["byte_order"] == "BigEndian";
        size_type_ =
            tag.attributes["header_type"] == "UInt64" ? NumberType::kUint64 : NumberType::kUint32;
        compressor_ = tag.attributes["compressor"];
      } else if (tag.name == "Piece") {
        arrays.clear();
        piece = tag.end;
      } else if (tag.name == "Points" || tag.name == "Cells") {
        within = tag.name;
      } else if (tag.name == "/Points" || tag.name == "/Cells") {
        within.clear();
      } else if (tag.name == "DataArray" && !within.empty()) {
        arrays[within == "Points" ? within : tag.attributes["Name"]] = tag;
      } else if (tag.name == "/Piece") {
        read_piece(arrays, piece);
      }
    }
    if (!is_grid) refuse("is no VTK file of an UnstructuredGrid", 0);
    return std::move(cells_);
  }

 private:
  [[noreturn]] void refuse(const std::string& why, std::size_t at) const {
    MeshNumbers(bytes_, at, NumberFormat::kText).refuse(why, at);
  }

  /// Where tags end and raw bytes may begin.
  void find_appended() {
    tags_end_ = std::min(bytes_.find("<AppendedData"), bytes_.size());
    if (tags_end_ == bytes_.size()) return;
    XmlTag tag;
    next_tag(tags_end_, tag);
    appended_is_raw_ = tag.attributes["encoding"] == "raw";
    appended_ = bytes_.find('_', tag.end);
    if (appended_ == std::string::npos) refuse("ends before its appended data", tags_end_);
    ++appended_;
  }

  /// The next tag from there on; false without one.
  bool next_tag(std::size_t at, XmlTag& tag) const {
    at = bytes_.find('<', at);
    if (at == std::string::npos) return false;
    const std::size_t end = bytes_.find('>', at);
    if (end == std::string::npos) refuse("ends within a tag", at);
    tag = XmlTag();
    tag.end = end + 1;
    constexpr const char* kBlank = " \t\r\n";
    const std::size_t name_end = std::min(bytes_.find_first_of(" \t\r\n/>", at + 2), end);
    tag.name = bytes_.substr(at + 1, name_end - at - 1);
    for (at = name_end; at < end;) {
      const std::size_t begin = bytes_.find_first_not_of(kBlank, at);
      const std::size_t equals = bytes_.find('=', begin);
      if (equals >= end) break;
      const std::size_t open = bytes_.find_first_of("\"'", equals);
      if (open >= end) break;
      const std::size_t close = bytes_.find(bytes_[open], open + 1);
      if (close >= end) break;
      const std::size_t last = bytes_.find_last_not_of(kBlank, equals - 1);
      tag.attributes[bytes_.substr(begin, last + 1 - begin)] =
          bytes_.substr(open + 1, close - open - 1);
      at = close + 1;
    }
    return true;
  }

  /// Up to `count` bytes of base64 from there on; what stands for each part may be padded.
  std::string base64(std::size_t at, std::size_t count) const {
    std::string bytes;
    unsigned bits = 0;
    int digits = 0, held = 0;  // of a group of four; digits of it that are no padding
    for (; at < bytes_.size() && bytes.size() < count; ++at) {
      const char c = bytes_[at];
      const int value = c >= 'A' && c <= 'Z'   ? c - 'A'
                        : c >= 'a' && c <= 'z' ? c - 'a' + 26
                        : c >= '0' && c <= '9' ? c - '0' + 52
                        : c == '+'             ? 62
                        : c == '/'             ? 63
                                               : -1;
      if (value < 0 && c != '=') {
        if (c == '<') break;
        continue;  // ends of lines
      }
      bits = bits << 6 | static_cast<unsigned>(std::max(value, 0));
      held += value >= 0 ? 1 : 0;
      if (++digits < 4) continue;
      for (int k = 0; k + 1 < held; ++k) bytes += static_cast<char>(bits >> (16 - 8 * k));
      bits = 0;
      digits = held = 0;
    }
    if (bytes.size() > count) bytes.resize(count);
    return bytes;
  }

  /// `count` bytes from byte `first` of an array on, which begins at `at`.
  std::string part(std::size_t at, bool is_raw, std::size_t first, std::size_t count) const {
    std::string bytes;
    if (is_raw && at + first < bytes_.size()) bytes = bytes_.substr(at + first, count);
    if (!is_raw) bytes = base64(at, first + count).erase(0, first);
    if (bytes.size() < count) {
      refuse("ends within an array of " + std::to_string(count) + " bytes", at);
    }
    return bytes;
  }

  /// The bytes of an array that is not text.
  std::string binary(std::size_t at, bool is_raw) {
    const std::size_t width = size_of(size_type_);
    const auto sizes = [&](std::size_t first, std::size_t count) {
      const std::string bytes = part(at, is_raw, first * width, count * width);
      std::vector<std::size_t> all;
      MeshNumbers in(bytes, 0, format());
      for (std::size_t i = 0; i < count; ++i) {
        const double size = in.next(size_type_, "a size");
        if (!(size <= static_cast<double>(kLargestMesh))) {
          refuse("has a size that no array has, or says the wrong order of its bytes", at);
        }
        all.push_back(static_cast<std::size_t>(size));
      }
      return all;
    };
    // Many arrays may be said to lie at one place, and little may inflate to much.
    const auto take = [&](std::size_t size) {
      if ((taken_ += size) > kLargestMesh) refuse("has arrays larger than any mesh", at);
    };
    if (compressor_.empty()) {
      const std::size_t size = sizes(0, 1)[0];
      take(size);
      return part(at, is_raw, width, size);
    }
    if (compressor_ != "vtkZLibDataCompressor") {
      refuse("is compressed by " + compressor_.substr(0, 40) + " (save it with zlib or without)",
             at);
    }
    const std::vector<std::size_t> head = sizes(0, 3);  // blocks, their size, that of the last
    if (head[0] > bytes_.size()) refuse("counts more blocks than it has bytes", at);
    if (head[0] == 0) return "";
    const std::vector<std::size_t> packed = sizes(3, head[0]);
    std::size_t first = (3 + head[0]) * width, all = 0;
    for (const std::size_t size : packed) all += size;
    const std::string blocks = part(at, is_raw, first, all);
    std::string bytes;
    first = 0;
    for (std::size_t i = 0; i < packed.size(); ++i) {
      stop_if_asked();
      const std::size_t size = i + 1 == packed.size() && head[2] > 0 ? head[2] : head[1];
      take(size);
      uLongf got = size;
      const std::size_t begin = bytes.size();
      bytes.resize(begin + size);
      const int rc = uncompress(reinterpret_cast<Bytef*>(&bytes[begin]), &got,
                                reinterpret_cast<const Bytef*>(blocks.data() + first),
                                static_cast<uLong>(packed[i]));
      if (rc != Z_OK || got != size) {
        refuse("has a block that does not inflate to the size that it says", at);
      }
      first += packed[i];
    }
    return bytes;
  }

  NumberFormat format() const {
    return big_endian_ ? NumberFormat::kBigEndian : NumberFormat::kLittleEndian;
  }

  std::vector<double> numbers(std::map<std::string, XmlTag>& arrays, const std::string& name,
                              std::size_t piece) {
    const auto found = arrays.find(name);
    if (found == arrays.end() || found->second.end == 0)
      refuse("has a piece without " + name, piece);
    XmlTag& tag = found->second;
    std::string type_name = tag.attributes["type"];
    for (char& c : type_name) c = static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
    const NumberType type = number_type(type_name);
    if (type == NumberType::kNone) refuse(name + " is of an unknown type", tag.end);
    std::vector<double> all;
    const std::string& kind = tag.attributes["format"];
    if (kind == "ascii") {
      const std::string text = bytes_.substr(tag.end, bytes_.find('<', tag.end) - tag.end);
      MeshWords words(text, 0);
      for (double value = 0; words.next(value);) all.push_back(value);
      return all;
    }
    std::string bytes;
    if (kind == "appended") {
      const std::string& offset = tag.attributes["offset"];
      MeshWords word(offset, 0);
      double at = 0;
      if (appended_ == 0 || !word.next(at) || !(at >= 0 && at < double(bytes_.size()))) {
        refuse("has no valid offset of " + name, tag.end);
      }
      bytes = binary(appended_ + static_cast<std::size_t>(at), appended_is_raw_);
    } else {
      bytes = binary(tag.end, false);
    }
    const std::size_t count = bytes.size() / size_of(type);
    MeshNumbers in(bytes, 0, format());
    for (std::size_t i = 0; i < count; ++i) all.push_back(in.next(type, "a number"));
    return all;
  }

  void read_piece(std::map<std::string, XmlTag>& arrays, std::size_t piece) {
    const std::string& dimension = arrays["Points"].attributes["NumberOfComponents"];
    if (!dimension.empty() && dimension != "3") refuse("has points that are not 3 numbers", piece);
    const std::vector<double> points = numbers(arrays, "Points", piece),
                              corners = numbers(arrays, "connectivity", piece),
                              ends = numbers(arrays, "offsets", piece),
                              types = numbers(arrays, "types", piece);
    if (types.size() != ends.size()) {
      refuse("has " + std::to_string(ends.size()) + " cells and types of " +
                 std::to_string(types.size()),
             piece);
    }
    const std::size_t before = cells_.mesh.vertices.size(), count = points.size() / 3;
    for (std::size_t i = 0; i < count; ++i) {
      cells_.mesh.vertices.emplace_back(points[3 * i], points[3 * i + 1], points[3 * i + 2]);
    }
    std::vector<int> own;
    double begin = 0;
    for (std::size_t i = 0; i < types.size(); ++i) {
      if (!(ends[i] >= begin && ends[i] <= static_cast<double>(corners.size()))) {
        refuse("has a cell beyond its list of vertices", piece);
      }
      own.clear();
      for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(ends[i]); ++k) {
        if (!(corners[k] >= 0 && corners[k] < static_cast<double>(count))) {
          refuse("has cell " + std::to_string(i) + " with a vertex that is not there: there are " +
                     std::to_string(count),
                 piece);
        }
        own.push_back(static_cast<int>(before) + static_cast<int>(corners[k]));
      }
      cells_.add(
          types[i] >= 0 && types[i] < 256 ? vtk_cell(static_cast<int>(types[i])) : CellKind::kOther,
          own.data(), static_cast<int>(own.size()));
      begin = ends[i];
    }
  }

  const std::string& bytes_;
  std::size_t tags_end_ = 0, appended_ = 0, taken_ = 0;
  bool appended_is_raw_ = false, big_endian_ = false;
  NumberType size_type_ = NumberType::kUint32;
  std::string compressor_;
  VolumeCells cells_;
};

}  // namespace

VolumeCells read_vtu(const std::string& bytes) { return VtuFile(bytes).read(); }

}  // namespace tissue_sim
