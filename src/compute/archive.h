// Archives: the bytes of a state, written and read by one list of its fields:
//
//   struct Nodes {
//     ...
//     TISSUE_SIM_FIELDS(u, v, mass)
//   };
//
// or, where reading takes more than that,
//
//   template <class Archive>
//   void fields(Archive& archive, Nodes& n) { archive(n.u, n.v, n.mass); }
//
//   ArchiveWriter out;  out(nodes);
//   ArchiveReader in(out.bytes());  in(nodes);
//
// Numbers, and what is made of integers without a gap between them, go byte by byte; all else needs
// such a list, so that equal states are equal bytes. Bytes are those of this machine: a state goes
// to other processes on the same kind of machine, not to other ones.
//
// archive.part("nodes", n) writes the name and the size before it: where a state was written by
// another program the reader says in which part, and state_parts() tells which part of two states
// differs.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "tissue_sim/types.h"

namespace tissue_sim {

template <class Archive, class T, class = void>
struct HasFields : std::false_type {};
template <class Archive, class T>
struct HasFields<Archive, T,
                 std::void_t<decltype(fields(std::declval<Archive&>(), std::declval<T&>()))>>
    : std::true_type {};

template <class Archive, class T, class = void>
struct HasOwnFields : std::false_type {};
template <class Archive, class T>
struct HasOwnFields<Archive, T,
                    std::void_t<decltype(std::declval<T&>().each_field(std::declval<Archive&>()))>>
    : std::true_type {};

/// What is copied byte by byte.
template <class T>
inline constexpr bool kIsPlain = std::is_arithmetic_v<T> || std::is_enum_v<T> ||
                                 (std::is_trivially_copyable_v<T> && !std::is_pointer_v<T> &&
                                  std::has_unique_object_representations_v<T>);
template <class T, class Archive>
inline constexpr bool kGoesPlain =
    kIsPlain<T> && !HasFields<Archive, T>::value && !HasOwnFields<Archive, T>::value;

/// What both have in common: how what is made of others is taken apart.
template <class Archive>
class ArchiveFields {
 public:
  template <class... T>
  void operator()(T&... all) {
    (item(all), ...);
  }
  template <class... T>
  void part(const std::string& name, T&... all) {
    self().begin_part(name);
    (item(all), ...);
    self().end_part(name);
  }

 private:
  Archive& self() { return static_cast<Archive&>(*this); }

  template <class T>
  void item(T& x) {
    if constexpr (HasFields<Archive, T>::value) {
      fields(self(), x);
    } else if constexpr (HasOwnFields<Archive, T>::value) {
      x.each_field(self());
    } else if constexpr (std::is_array_v<T> && !kGoesPlain<std::remove_all_extents_t<T>, Archive>) {
      for (auto& each : x) item(each);
    } else {
      static_assert(kIsPlain<std::remove_all_extents_t<T>>, "this type needs a list of its fields");
      self().raw(&x, sizeof x);
    }
  }
  template <class T, class Allocator>
  void item(std::vector<T, Allocator>& x) {
    static_assert(!std::is_same_v<T, bool>, "its elements have no address");
    constexpr bool plain = kGoesPlain<T, Archive>;
    x.resize(self().count(x.size(), plain ? sizeof(T) : 1));
    if constexpr (plain) {
      self().raw(x.data(), x.size() * sizeof(T));
    } else {
      for (T& each : x) item(each);
    }
  }
  template <class T, std::size_t N>
  void item(std::array<T, N>& x) {
    if constexpr (kGoesPlain<T, Archive>) {
      self().raw(x.data(), sizeof x);
    } else {
      for (T& each : x) item(each);
    }
  }
  void item(std::string& x) {
    x.resize(self().count(x.size(), 1));
    self().raw(x.data(), x.size());
  }
  template <class T, int Rows, int Columns, int Options>
  void item(Eigen::Matrix<T, Rows, Columns, Options, Rows, Columns>& x) {
    static_assert(Rows > 0 && Columns > 0, "of a size that is not fixed");
    self().raw(x.data(), sizeof(T) * Rows * Columns);
  }
  void item(Quat& x) { self().raw(x.coeffs().data(), 4 * sizeof(double)); }
  template <class T>
  void item(std::set<T>& x) {
    std::vector<T> all(x.begin(), x.end());
    item(all);
    x = std::set<T>(all.begin(), all.end());
  }
  template <class T>
  void item(std::unique_ptr<T>& x) {
    std::uint8_t there = x != nullptr;
    item(there);
    if (there == 0) {
      x.reset();
      return;
    }
    if (x == nullptr) x = std::make_unique<T>();
    item(*x);
  }
};

class ArchiveWriter : public ArchiveFields<ArchiveWriter> {
 public:
  static constexpr bool kReads = false;
  void raw(void* data, std::size_t size) {
    const auto* const begin = static_cast<const std::uint8_t*>(data);
    bytes_.insert(bytes_.end(), begin, begin + size);
  }
  std::size_t count(std::size_t n, std::size_t) {
    std::uint64_t written = n;
    raw(&written, sizeof written);
    return n;
  }
  void begin_part(const std::string& name) {
    std::string written = name;
    (*this)(written);
    count(0, 1);
    begun_.push_back(bytes_.size());
  }
  void end_part(const std::string&) {
    const std::size_t begin = begun_.back();
    begun_.pop_back();
    const std::uint64_t size = bytes_.size() - begin;
    std::memcpy(bytes_.data() + begin - sizeof size, &size, sizeof size);
  }
  const std::vector<std::uint8_t>& bytes() const { return bytes_; }
  std::vector<std::uint8_t> take() { return std::move(bytes_); }

 private:
  std::vector<std::uint8_t> bytes_;
  std::vector<std::size_t> begun_;  ///< where the parts begin that are not yet ended
};

/// Throws std::runtime_error where there are not enough bytes.
class ArchiveReader : public ArchiveFields<ArchiveReader> {
 public:
  static constexpr bool kReads = true;
  /// The bytes must outlive it.
  explicit ArchiveReader(Span<const std::uint8_t> bytes) : at_(bytes.begin()), end_(bytes.end()) {}

  void raw(void* data, std::size_t size) {
    if (size > left()) throw std::runtime_error("the state ends too early");
    if (size > 0) std::memcpy(data, at_, size);
    at_ += size;
  }
  std::size_t count(std::size_t, std::size_t bytes_each) {
    std::uint64_t n = 0;
    raw(&n, sizeof n);
    if (n > left() / bytes_each) throw std::runtime_error("the state ends too early");
    return static_cast<std::size_t>(n);
  }
  void begin_part(const std::string& name) {
    std::string read;
    (*this)(read);
    if (read != name) {
      throw std::runtime_error("the state has '" + read + "' where this program has '" + name +
                               "': another build wrote it");
    }
    const std::size_t size = count(0, 1);
    ends_.push_back(at_ + size);
  }
  void end_part(const std::string& name) {
    if (at_ != ends_.back()) {
      throw std::runtime_error("the state's '" + name +
                               "' is not what this program has by that "
                               "name: another build wrote it");
    }
    ends_.pop_back();
  }
  std::size_t left() const { return static_cast<std::size_t>(end_ - at_); }
  /// The next so many bytes.
  Span<const std::uint8_t> take(std::size_t size) {
    if (size > left()) throw std::runtime_error("the state ends too early");
    at_ += size;
    return {at_ - size, size};
  }

 private:
  const std::uint8_t *at_, *end_;
  std::vector<const std::uint8_t*> ends_;  ///< of the parts that are being read
};

struct StatePart {
  std::string name;
  Span<const std::uint8_t> bytes;
};

/// The parts of what is made of parts alone, which must outlive them.
inline std::vector<StatePart> state_parts(Span<const std::uint8_t> state) {
  ArchiveReader in(state);
  std::vector<StatePart> parts;
  while (in.left() > 0) {
    StatePart part;
    in(part.name);
    const std::size_t size = in.count(0, 1);
    part.bytes = in.take(size);
    parts.push_back(part);
  }
  return parts;
}

}  // namespace tissue_sim
