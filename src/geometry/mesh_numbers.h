// The numbers of a mesh file, one after the other, whether text or binary.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

#include "geometry/byte_order.h"
#include "geometry/mesh_words.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {

enum class NumberType {
  kNone,
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kInt64,
  kUint64,
  kFloat,
  kDouble
};

/// By what PLY and VTK call it, in small letters; kNone for what is no name.
inline NumberType number_type(const std::string& name) {
  constexpr struct {
    const char* name;
    NumberType type;
  } kNames[] = {{"char", NumberType::kInt8},
                {"int8", NumberType::kInt8},
                {"uchar", NumberType::kUint8},
                {"uint8", NumberType::kUint8},
                {"unsigned_char", NumberType::kUint8},
                {"short", NumberType::kInt16},
                {"int16", NumberType::kInt16},
                {"ushort", NumberType::kUint16},
                {"uint16", NumberType::kUint16},
                {"unsigned_short", NumberType::kUint16},
                {"int", NumberType::kInt32},
                {"int32", NumberType::kInt32},
                {"vtkidtype", NumberType::kInt32},  // so VTK writes it, whatever its own size
                {"uint", NumberType::kUint32},
                {"uint32", NumberType::kUint32},
                {"unsigned_int", NumberType::kUint32},
                {"long", NumberType::kInt64},
                {"int64", NumberType::kInt64},
                {"vtktypeint64", NumberType::kInt64},
                {"unsigned_long", NumberType::kUint64},
                {"uint64", NumberType::kUint64},
                {"vtktypeuint64", NumberType::kUint64},
                {"float", NumberType::kFloat},
                {"float32", NumberType::kFloat},
                {"double", NumberType::kDouble},
                {"float64", NumberType::kDouble}};
  for (const auto& n : kNames) {
    if (name == n.name) return n.type;
  }
  return NumberType::kNone;
}

inline std::size_t size_of(NumberType type) {
  constexpr std::size_t kSizes[] = {0, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
  return kSizes[static_cast<int>(type)];
}

enum class NumberFormat { kText, kLittleEndian, kBigEndian };

/// Of bytes that must outlive it, from `first` on. What is not there it refuses with
/// std::invalid_argument, a verb in front, that says where.
class MeshNumbers {
 public:
  MeshNumbers(const std::string& bytes, std::size_t first, NumberFormat format)
      : bytes_(bytes), at_(first), format_(format) {}

  /// Of no type: as text, whatever the format.
  double next(NumberType type, const char* what) {
    if (++read_ % 4096 == 0) stop_if_asked();
    if (format_ == NumberFormat::kText || type == NumberType::kNone) {
      MeshWords words(bytes_, at_);
      double value = 0;
      const bool is_number = words.next(value);
      at_ = words.place();
      if (!is_number) ended(what);
      return value;
    }
    switch (type) {
      case NumberType::kInt8:
        return take<std::int8_t>(what);
      case NumberType::kUint8:
        return take<std::uint8_t>(what);
      case NumberType::kInt16:
        return take<std::int16_t>(what);
      case NumberType::kUint16:
        return take<std::uint16_t>(what);
      case NumberType::kInt32:
        return take<std::int32_t>(what);
      case NumberType::kUint32:
        return take<std::uint32_t>(what);
      case NumberType::kInt64:
        return take<std::int64_t>(what);
      case NumberType::kUint64:
        return take<std::uint64_t>(what);
      case NumberType::kFloat:
        return take<float>(what);
      case NumberType::kDouble:
        return take<double>(what);
      case NumberType::kNone:
        break;
    }
    ended(what);
  }
  /// A whole number from 0 to 2^31 - 1: a count, or a number of something.
  int whole(NumberType type, const char* what) {
    const std::size_t at = at_;
    const double value = next(type, what);
    if (value >= 0 && value < 2147483648.0 && value == static_cast<int>(value)) {
      return static_cast<int>(value);
    }
    refuse("has no valid " + std::string(what), at);
  }
  /// In small letters; false at the end.
  bool word(std::string& word) {
    MeshWords words(bytes_, at_);
    const bool found = words.next(word);
    at_ = words.place();
    return found;
  }
  /// To behind the line's end.
  void skip_line() {
    MeshWords words(bytes_, at_);
    words.skip_line();
    at_ = words.place();
    if (at_ < bytes_.size() && bytes_[at_] == '\r') ++at_;
    if (at_ < bytes_.size() && bytes_[at_] == '\n') ++at_;
  }
  void skip(std::size_t count, const char* what) {
    if (bytes_.size() - at_ < count) ended(what);
    at_ += count;
  }
  /// To behind the next `mark`; false, and to the end, without one.
  bool skip_past(const std::string& mark) {
    const std::size_t found = bytes_.find(mark, at_);
    at_ = found == std::string::npos ? bytes_.size() : found + mark.size();
    return found != std::string::npos;
  }
  std::size_t place() const { return at_; }
  bool is_binary() const { return format_ != NumberFormat::kText; }
  void set_format(NumberFormat format) { format_ = format; }

  [[noreturn]] void refuse(const std::string& why, std::size_t at) const {
    throw std::invalid_argument(why + " (byte " + std::to_string(at) + " of " +
                                std::to_string(bytes_.size()) + "): export or copy it again");
  }

 private:
  template <class T>
  double take(const char* what) {
    if (bytes_.size() - at_ < sizeof(T)) ended(what);
    const T value = number_at<T>(&bytes_[at_], format_ == NumberFormat::kBigEndian);
    at_ += sizeof(T);
    return static_cast<double>(value);
  }
  [[noreturn]] void ended(const char* what) const {
    refuse("ends, or has no number, where " + std::string(what) + " should be", at_);
  }

  const std::string& bytes_;
  std::size_t at_;
  NumberFormat format_;
  unsigned read_ = 0;
};

}  // namespace tissue_sim
