// Archives: what is written is read, whatever it is made of; equal values are equal bytes; a reader
// that knows other parts says which.
#include "compute/archive.h"

#include <gtest/gtest.h>

#include <new>
#include <string>

namespace tissue_sim {
namespace {

/// With gaps between its members, where anything may be.
struct Gappy {
  std::uint8_t small;
  double large;
  bool is_so;
  float place[3];
};
template <class Archive>
void fields(Archive& archive, Gappy& g) {
  archive(g.small, g.large, g.is_so, g.place);
}
static_assert(!kIsPlain<Gappy>, "else its gaps were written, too");
static_assert(kIsPlain<std::array<std::int32_t, 3>>);

struct Made {
  std::vector<Gappy> gappy;
  std::vector<std::vector<float>> nested;
  std::set<std::int32_t> set;
  std::string text;
  std::array<std::array<double, 2>, 3> table = {};
  std::vector<Vec3> places;
  std::unique_ptr<Gappy> maybe;
};
template <class Archive>
void fields(Archive& archive, Made& m) {
  archive(m.gappy, m.nested, m.set, m.text, m.table, m.places, m.maybe);
}

/// In memory that was full of `before`.
Made made(int before) {
  Made m;
  alignas(Gappy) unsigned char room[sizeof(Gappy)];
  std::fill(std::begin(room), std::end(room), static_cast<unsigned char>(before));
  auto* gappy = new (room) Gappy;
  gappy->small = 3;
  gappy->large = 0.1;
  gappy->is_so = true;
  for (int a = 0; a < 3; ++a) gappy->place[a] = 0.5f * static_cast<float>(a);
  m.gappy.resize(2);
  for (Gappy& to : m.gappy) std::memcpy(static_cast<void*>(&to), room, sizeof room);
  m.nested = {{1, 2}, {}, {3}};
  m.set = {5, -2, 9};
  m.text = "what";
  m.table[1][1] = 7;
  m.places = {Vec3(1, 2, 3)};
  m.maybe = std::make_unique<Gappy>(m.gappy[0]);
  return m;
}

std::vector<std::uint8_t> written(Made m) {
  ArchiveWriter out;
  out.part("first", m);
  std::int32_t number = 4;
  out.part("second", number);
  return out.take();
}

TEST(Archive, WhatIsWrittenIsRead) {
  const std::vector<std::uint8_t> bytes = written(made(0));
  Made m;
  std::int32_t number = 0;
  ArchiveReader in({bytes.data(), bytes.size()});
  in.part("first", m);
  in.part("second", number);
  EXPECT_EQ(in.left(), 0u);
  EXPECT_EQ(number, 4);
  EXPECT_EQ(m.nested, made(0).nested);
  EXPECT_EQ(m.set, made(0).set);
  EXPECT_EQ(m.text, "what");
  EXPECT_EQ(m.table, made(0).table);
  EXPECT_EQ(m.places, made(0).places);
  ASSERT_EQ(m.gappy.size(), 2u);
  ASSERT_NE(m.maybe, nullptr);
  EXPECT_EQ(m.maybe->place[2], 1.0f);
  EXPECT_EQ(written(std::move(m)), bytes);
}

TEST(Archive, EqualValuesAreEqualBytes) { EXPECT_EQ(written(made(0x55)), written(made(0xaa))); }

TEST(Archive, PartsHaveNames) {
  const std::vector<std::uint8_t> bytes = written(made(0));
  const auto parts = state_parts({bytes.data(), bytes.size()});
  ASSERT_EQ(parts.size(), 2u);
  EXPECT_EQ(parts[0].name, "first");
  EXPECT_EQ(parts[1].name, "second");
  EXPECT_EQ(parts[1].bytes.size(), 4u);
  const auto reason = [&](const std::string& name, auto value) -> std::string {
    ArchiveReader in({bytes.data(), bytes.size()});
    try {
      in.part(name, value);
    } catch (const std::runtime_error& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_NE(reason("other", std::int32_t(0)).find("'first' where this program has 'other'"),
            std::string::npos);
  EXPECT_NE(reason("first", std::int32_t(0)).find("'first'"), std::string::npos);
  ArchiveReader cut({bytes.data(), 20});
  Made m;
  EXPECT_THROW(cut.part("first", m), std::runtime_error);
}

}  // namespace
}  // namespace tissue_sim
