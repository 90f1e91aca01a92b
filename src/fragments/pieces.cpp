#include "fragments/pieces.h"

#include <algorithm>
#include <map>
#include <unordered_map>

#include "fragments/find_parted.h"

namespace tissue_sim {
namespace {

double volume_of(const float* volume, const PartedRun& run) {
  double sum[4] = {};  // side by side: each waits for what it was
  std::int32_t p = run.begin;
  for (; p + 4 <= run.end; p += 4) {
    for (int i = 0; i < 4; ++i) sum[i] += volume[p + i];
  }
  for (; p < run.end; ++p) sum[0] += volume[p];
  return sum[0] + sum[1] + (sum[2] + sum[3]);
}

/// Loose is what came off something, or lies in a body that is held elsewhere, and is not held
/// itself.
void tell_loose(Pieces& pieces) {
  std::vector<bool> anchored(pieces.next_id, false), body_held(pieces.all.size(), false);
  for (const std::int32_t p : pieces.anchored) anchored[pieces.of_point[p]] = true;
  for (const Fragment& f : pieces.all) body_held[f.body] = body_held[f.body] || anchored[f.id];
  for (Fragment& f : pieces.all) {
    f.loose = !anchored[f.id] && (f.parent >= 0 || body_held[f.body]);
  }
}

}  // namespace

Pieces one_piece_a_body(int bodies, const PiecePoints& points) {
  Pieces pieces;
  for (int b = 0; b < bodies; ++b) {
    Fragment f;
    f.id = f.body = b;
    pieces.all.push_back(f);
  }
  pieces.next_id = bodies;
  pieces.lowest.assign(bodies, -1);
  pieces.of_point.reserve(points.count);
  for (std::int32_t p = 0; p < points.count; ++p) {
    Fragment& f = pieces.all[points.body(p)];
    if (f.point_count == 0) pieces.lowest[f.id] = p;
    pieces.of_point.push_back(f.id);
    ++f.point_count;
    f.volume += points.volume[p];
    if (points.anchored[p] != 0) pieces.anchored.push_back(p);
  }
  tell_loose(pieces);
  return pieces;
}

std::vector<int> part_pieces(const float* volume, const std::vector<PartedRun>& parted,
                             Pieces& pieces) {
  struct Part {
    std::int32_t lowest;
    int count;
    double volume;
  };
  std::vector<int> index(pieces.next_id, -1);  // of a piece in `all`
  for (std::size_t i = 0; i < pieces.all.size(); ++i) {
    index[pieces.all[i].id] = static_cast<int>(i);
  }
  // By piece, each in the order of its lowest point: first what is left of it.
  std::map<int, std::vector<Part>> parts_of;
  std::unordered_map<std::int32_t, int> place;  // of a part, by its lowest point
  for (const PartedRun& run : parted) {
    const int id = pieces.of_point[run.begin];
    std::vector<Part>& parts = parts_of[id];
    if (parts.empty()) {
      const Fragment& piece = pieces.all[index[id]];
      parts.push_back({pieces.lowest[id], piece.point_count, piece.volume});
    }
    const auto [at, is_new] = place.try_emplace(run.lowest, static_cast<int>(parts.size()));
    if (is_new) parts.push_back({run.lowest, 0, 0});
    const double taken = volume_of(volume, run);
    for (Part* part : {&parts[at->second], &parts[0]}) {
      const int sign = part == &parts[0] ? -1 : 1;
      part->count += sign * (run.end - run.begin);
      part->volume += sign * taken;
    }
  }
  std::vector<int> fresh;
  std::unordered_map<std::int32_t, int> id_of;  // of a part, by its lowest point
  for (const auto& [id, parts] : parts_of) {
    const auto largest = std::max_element(
        parts.begin(), parts.end(), [](const Part& a, const Part& b) { return a.count < b.count; });
    for (auto part = parts.begin(); part != parts.end(); ++part) {
      const int own_id = part == largest ? id : pieces.next_id;
      id_of[part->lowest] = own_id;
      if (part != largest) {
        Fragment f;
        f.id = pieces.next_id++;
        f.parent = id;
        f.body = pieces.all[index[id]].body;
        index.push_back(static_cast<int>(pieces.all.size()));
        fresh.push_back(f.id);
        pieces.all.push_back(f);
        pieces.lowest.push_back(part->lowest);
      }
      Fragment& piece = pieces.all[index[own_id]];
      piece.point_count = part->count;
      piece.volume = part->volume;
    }
    pieces.lowest[id] = largest->lowest;
    if (largest == parts.begin()) continue;
    const int now = id_of[parts[0].lowest];
    // Written to whether or not it changes, as std::replace() is not: in vectors.
    for (std::int32_t& piece : pieces.of_point) piece = piece == id ? now : piece;
  }
  for (const PartedRun& run : parted) {
    std::fill(pieces.of_point.begin() + run.begin, pieces.of_point.begin() + run.end,
              id_of[run.lowest]);
  }
  if (!fresh.empty()) tell_loose(pieces);
  return fresh;
}

std::vector<PartedRun> find_parted(const Pieces& pieces, UnionFind& linked) {
  std::vector<PartedRun> parted;
  const auto count = static_cast<std::int32_t>(pieces.of_point.size());
  const std::int32_t *of_point = pieces.of_point.data(), *lowest_of = pieces.lowest.data();
  for (std::int32_t p = 0; p < count; ++p) {
    const std::int32_t lowest = linked.root(p), piece = of_point[p];
    if (lowest_of[piece] == lowest) continue;
    if (!parted.empty() && parted.back().end == p && parted.back().lowest == lowest &&
        of_point[p - 1] == piece) {
      ++parted.back().end;
    } else {
      parted.push_back({p, p + 1, lowest});
    }
  }
  return parted;
}

std::vector<int> update_pieces(const float* volume, UnionFind& linked, Pieces& pieces) {
  return part_pieces(volume, find_parted(pieces, linked), pieces);
}

}  // namespace tissue_sim
