#include "paper/hash_grid.h"

#include <algorithm>
#include <cstring>

#include "compute/simd.h"

namespace tissue_sim {
namespace {

constexpr std::int32_t kPoints = 2048;  // that are looked at together, so that they stay near
constexpr int kBits = 64;

/// Bit k of the result is byte k of eight that are 0 or 1.
std::uint64_t eight_bits(const std::uint8_t* bytes) {
  std::uint64_t v;
  std::memcpy(&v, bytes, sizeof v);
  return v * 0x0102040810204080u >> 56;
}

/// Bits of 64 bytes that are 0 or 1, which are cleared.
std::uint64_t take_bits(std::uint8_t* bytes) {
  std::uint64_t bits = 0;
  for (int i = 0; i < 8; ++i) bits |= eight_bits(bytes + 8 * i) << 8 * i;
  if (bits != 0) std::memset(bytes, 0, kBits);
  return bits;
}

/// Where a run of cells that hold points begins, of which none goes on from word to word.
TISSUE_SIM_INLINE std::uint64_t starts(std::uint64_t word) { return word & ~(word << 1); }

/// What a row's words tell of its runs.
struct RowOfRuns {
  const std::uint64_t* words;
  const std::int32_t* first;  ///< number of each word's first run

  /// Number of the run that a cell is in.
  TISSUE_SIM_INLINE std::int32_t at(std::size_t word, int bit) const {
    const std::uint64_t up_to = ~std::uint64_t{0} >> (63 - bit);
    return first[word] + __builtin_popcountll(starts(words[word]) & up_to) - 1;
  }
};

/// Numbers the runs of some words from `run` on. Returns the number after the last.
TISSUE_SIM_INLINE std::int32_t number(const std::uint64_t* words, std::size_t count,
                                      std::int32_t run, std::int32_t* first) {
  for (std::size_t w = 0; w < count; ++w) {
    first[w] = run;
    if (words[w] != 0) run += __builtin_popcountll(starts(words[w]));
  }
  return run;
}

/// Joins the runs of two words that lie side by side.
TISSUE_SIM_INLINE void join_words(const RowOfRuns& before, std::size_t w, const RowOfRuns& own,
                                  std::size_t v, UnionFind& runs) {
  for (std::uint64_t left = starts(before.words[w] & own.words[v]); left != 0; left &= left - 1) {
    const int bit = __builtin_ctzll(left);
    runs.join(before.at(w, bit), own.at(v, bit));
  }
}

TISSUE_SIM_INLINE void join_rows(const RowOfRuns& before, const RowOfRuns& own, std::size_t words,
                                 UnionFind& runs) {
  for (std::size_t w = 0; w < words; ++w) join_words(before, w, own, w, runs);
}

// Both with the processor's own count of bits, where it has one.
struct Passes {
  std::int32_t (*number)(const std::uint64_t*, std::size_t, std::int32_t, std::int32_t*);
  void (*join_rows)(const RowOfRuns&, const RowOfRuns&, std::size_t, UnionFind&);
};
std::int32_t number_sse2(const std::uint64_t* words, std::size_t count, std::int32_t run,
                         std::int32_t* first) {
  return number(words, count, run, first);
}
void join_rows_sse2(const RowOfRuns& before, const RowOfRuns& own, std::size_t words,
                    UnionFind& runs) {
  join_rows(before, own, words, runs);
}
#if defined(__x86_64__)
TISSUE_SIM_TARGET_AVX2 std::int32_t number_avx2(const std::uint64_t* words, std::size_t count,
                                                std::int32_t run, std::int32_t* first) {
  return number(words, count, run, first);
}
TISSUE_SIM_TARGET_AVX2 void join_rows_avx2(const RowOfRuns& before, const RowOfRuns& own,
                                           std::size_t words, UnionFind& runs) {
  join_rows(before, own, words, runs);
}
#endif
const Passes& passes() {
#if defined(__x86_64__)
  static const bool avx2 = instruction_set() >= InstructionSet::kAvx2;
  static constexpr Passes kAvx2 = {number_avx2, join_rows_avx2};
  if (avx2) return kAvx2;
#endif
  static constexpr Passes kSse2 = {number_sse2, join_rows_sse2};
  return kSse2;
}

std::int64_t words_in_row(const CellBox& box) { return (box.n[0] + kBits - 1) / kBits; }

/// Whether each cell of the box gets memory of its own, and the hash of a cell is its place there.
bool is_dense(const PointPlaces& places, const CellBox& box) {
  const double cells = 64.0 * words_in_row(box) * box.n[1] * box.n[2];
  return cells <= std::min(2e9, std::max(4e6, 32.0 * places.count));
}

}  // namespace

void HashGrid::mark_all(const PointPlaces& places, const CellBox& box, Cpu& cpu) {
  const auto row = static_cast<std::int32_t>(kBits * words_in_row(box));
  const CellOrder order{0, row, row * box.n[1]};
  words_.resize(static_cast<std::size_t>(words_in_row(box)) * box.n[1] * box.n[2]);
  const std::size_t cells = kBits * words_.size();
  if (!held_is_clear_) std::fill(held_.begin(), held_.end(), 0);
  held_is_clear_ = false;
  if (held_.size() < cells) held_.resize(cells, 0);
  label_.resize(std::max(label_.size(), cells));
  mark_cells(places, box, order, cpu, cell_, held_);
  constexpr int kWords = 512;
  const int words = static_cast<int>(words_.size());
  cpu.for_each((words + kWords - 1) / kWords, [&](int i) {
    const int end = std::min((i + 1) * kWords, words);
    for (int w = i * kWords; w < end; ++w) words_[w] = take_bits(&held_[kBits * std::size_t(w)]);
  });
  held_is_clear_ = true;
}

void HashGrid::join_all(Cpu& cpu) {
  const CellBox& box = box_;
  const auto in_row = static_cast<std::size_t>(words_in_row(box));
  const int rows = box.n[1] * box.n[2], to_plane = box.n[1];
  const int shares = std::min(rows, cpu.threads()), rows_in_share = (rows + shares - 1) / shares;
  shares_.resize(shares);
  first_.resize(words_.size());
  const Passes& pass = passes();
  cpu.for_each(shares, [&](int i) {
    WordShare& share = shares_[i];
    share.begin = std::min(i * rows_in_share, rows) * in_row;
    share.end = std::min((i + 1) * rows_in_share, rows) * in_row;
    share.runs = pass.number(words_.data() + share.begin, share.end - share.begin, 0,
                             first_.data() + share.begin);
  });
  std::int32_t runs = 0;
  for (WordShare& share : shares_) {
    share.first_run = runs;
    runs += share.runs;
  }
  runs_ = UnionFind(runs);
  // Rows of one share are joined with one another, then those that another share is before.
  const auto join_rows = [&](int other, int row) {
    pass.join_rows({words_.data() + other * in_row, first_.data() + other * in_row},
                   {words_.data() + row * in_row, first_.data() + row * in_row}, in_row, runs_);
  };
  cpu.for_each(shares, [&](int i) {
    const WordShare& share = shares_[i];
    for (std::size_t w = share.begin; i > 0 && w < share.end; ++w) first_[w] += share.first_run;
    const int begin = static_cast<int>(share.begin / in_row),
              end = static_cast<int>(share.end / in_row);
    for (int row = begin; row < end; ++row) {
      for (std::size_t w = row * in_row + 1; w < (row + 1) * in_row; ++w) join_along(w - 1, w);
      if (row % to_plane != 0 && row - 1 >= begin) join_rows(row - 1, row);
      if (row - to_plane >= begin) join_rows(row - to_plane, row);
    }
  });
  for (int i = 1; i < shares; ++i) {
    const int begin = static_cast<int>(shares_[i].begin / in_row),
              end = static_cast<int>(shares_[i].end / in_row);
    if (begin < end && begin % to_plane != 0) join_rows(begin - 1, begin);
    for (int row = std::max(begin, to_plane); row < std::min(end, begin + to_plane); ++row) {
      join_rows(row - to_plane, row);
    }
  }
}

/// Of a word and the one before it along x.
void HashGrid::join_along(std::size_t before, std::size_t word) {
  if ((words_[before] >> 63 & words_[word] & 1) == 0) return;
  const RowOfRuns runs{words_.data(), first_.data()};
  runs_.join(runs.at(before, kBits - 1), first_[word]);
}

void HashGrid::mark_scattered(const PointPlaces& places, const CellBox& box) {
  std::size_t room = 64;
  while (room < 2 * static_cast<std::size_t>(places.count)) room *= 2;
  key_.assign(room, -1);
  word_.resize(room);
  words_.clear();
  key_of_word_.clear();
  const auto row = words_in_row(box), plane = row * box.n[1];
  std::vector<std::int32_t> of_axis[3];
  std::int64_t last_key = -1;
  std::int32_t last = -1;
  for (std::int32_t begin = 0; begin < places.count; begin += kPoints) {
    const std::int32_t end = std::min(begin + kPoints, places.count);
    for (int a = 0; a < 3; ++a) {
      of_axis[a].assign(end - begin, 0);
      if (places.x[a] == nullptr) continue;
      PointPlaces line;
      line.x[0] = places.x[a];
      line.count = places.count;
      CellBox on_line = box;
      on_line.lowest[0] = box.lowest[a];
      on_line.n[0] = box.n[a];
      find_cells(line, on_line, {0, 0, 0}, begin, end, of_axis[a].data());
    }
    for (std::int32_t p = begin; p < end; ++p) {
      const std::int32_t x = of_axis[0][p - begin];
      const std::int64_t key =
          x / kBits + row * of_axis[1][p - begin] + plane * of_axis[2][p - begin];
      if (key != last_key) {
        std::size_t place = place_of(key);
        if (key_[place] < 0) {
          key_[place] = key;
          word_[place] = static_cast<std::int32_t>(words_.size());
          words_.push_back(0);
          key_of_word_.push_back(key);
        }
        last_key = key;
        last = word_[place];
      }
      words_[last] |= std::uint64_t{1} << x % kBits;
      cell_[p] = kBits * last + x % kBits;
    }
  }
  label_.resize(std::max(label_.size(), kBits * words_.size()));
}

std::size_t HashGrid::place_of(std::int64_t key) const {
  const std::size_t mask = key_.size() - 1;
  auto place =
      static_cast<std::size_t>(static_cast<std::uint64_t>(key) * 0x9e3779b97f4a7c15u >> 20);
  for (place &= mask; key_[place] >= 0 && key_[place] != key;) place = (place + 1) & mask;
  return place;
}

void HashGrid::join_scattered() {
  first_.resize(words_.size());
  const std::int32_t runs = passes().number(words_.data(), words_.size(), 0, first_.data());
  shares_ = {{0, words_.size(), 0, runs}};
  runs_ = UnionFind(runs);
  const RowOfRuns all{words_.data(), first_.data()};
  const std::int64_t row = words_in_row(box_), plane = row * box_.n[1];
  for (std::size_t w = 0; w < words_.size(); ++w) {
    const std::int64_t key = key_of_word_[w];
    const auto before = [&](std::int64_t step) {
      const std::size_t place = place_of(key - step);
      return key_[place] < 0 ? -1 : word_[place];
    };
    if (const int other = key % row != 0 ? before(1) : -1; other >= 0) join_along(other, w);
    if (const int other = key / row % box_.n[1] != 0 ? before(row) : -1; other >= 0) {
      join_words(all, other, all, w, runs_);
    }
    if (const int other = key >= plane ? before(plane) : -1; other >= 0)
      join_words(all, other, all, w, runs_);
  }
}

void HashGrid::label_roots(Cpu& cpu) {
  root_.resize(runs_.size());
  for (std::size_t i = 0; i < root_.size(); ++i) {
    root_[i] = runs_.root(static_cast<std::int32_t>(i));
  }
  cpu.for_each(static_cast<int>(shares_.size()), [&](int i) {
    const WordShare& share = shares_[i];
    const std::int32_t* root = root_.data() + share.first_run;
    std::int32_t* label = label_.data() + kBits * share.begin;
    for (std::size_t w = share.begin; w < share.end; ++w, label += kBits) {
      for (std::uint64_t held = words_[w]; held != 0; ++root) {
        const int from = __builtin_ctzll(held);
        const std::uint64_t gap = ~(held >> from);  // its lowest bit: where the run ends
        const int length = gap == 0 ? kBits : __builtin_ctzll(gap);
        std::fill_n(label + from, length, *root);
        held = from + length >= kBits ? 0 : held & ~std::uint64_t{0} << (from + length);
      }
    }
  });
}

const PointGroups& HashGrid::read_out(Cpu& cpu) {
  reader_.read(cell_, label_, static_cast<std::int32_t>(runs_.size()), cpu, groups_);
  return groups_;
}

void HashGrid::mark(const PointPlaces& places, const CellBox& box, Cpu& cpu) {
  box_ = box;
  dense_ = is_dense(places, box);
  cell_.resize(places.count);
  if (dense_) {
    mark_all(places, box, cpu);
  } else {
    mark_scattered(places, box);
  }
}

void HashGrid::label(Cpu& cpu) {
  if (dense_) {
    join_all(cpu);
  } else {
    join_scattered();
  }
  label_roots(cpu);
}

const PointGroups& HashGrid::find_groups(const PointPlaces& places, const CellBox& box, Cpu& cpu) {
  mark(places, box, cpu);
  label(cpu);
  return read_out(cpu);
}

}  // namespace tissue_sim
