#include <algorithm>
#include <utility>

#include "mpm/anchors/anchor_faces.h"
#include "mpm/cuda/make_tables.h"

namespace tissue_sim {
namespace {

static_assert(kRowNodes == kFaceRowNodes && kLargestGroup == kFaceGroupRows,
              "rows and groups are the same on both sides");

void number_nodes(const AnchorFaces& faces, std::size_t node_count, HeldNodes& nodes) {
  const auto for_each = [&](const auto& f) {
    for (std::size_t g = 0; g < faces.groups.size(); ++g) {
      for (int i = 0; i < faces.groups[g].count; ++i) {
        const FaceRow& r = faces.rows[faces.groups[g].first + i];
        for (int k = 0; k < kRowNodes; ++k) {
          if (r.weight[k] != 0) f(r.node[k], r.share[k] != 0 ? static_cast<int>(g) : -1);
        }
      }
    }
  };
  nodes.number.assign(node_count, -1);
  for_each([&](std::int32_t node, int) { nodes.number[node] = 0; });
  for (const AnchorFaces::HeldNode& n : faces.held) nodes.number[n.node] = 0;
  std::int32_t count = 0;
  for (std::int32_t& n : nodes.number) {
    if (n == 0) n = count++;
  }
  nodes.group.assign(count, -1);
  nodes.carried.assign(count, -1);
  for_each([&](std::int32_t node, int g) {
    if (g >= 0) nodes.group[nodes.number[node]] = g;
  });
  for (std::size_t i = 0; i < faces.held.size(); ++i) {
    nodes.carried[nodes.number[faces.held[i].node]] = static_cast<std::int32_t>(i);
  }
}

/// A slot of such a node.
struct SlotOfNode {
  std::int32_t node;
  int slot;
  bool operator<(const SlotOfNode& o) const {
    return node < o.node || (node == o.node && slot < o.slot);
  }
};

/// The slots of these nodes, and which bundle has them.
struct SlotsOfNodes {
  const HeldNodes& nodes;
  std::vector<std::vector<SlotOfNode>> of_bundle;  ///< by node, then slot
  std::vector<int> first;                          ///< of each of the nodes, -1 for none

  SlotsOfNodes(const MpmState& state, const HostTables& t, const HeldNodes& held)
      : nodes(held), of_bundle(t.bundles.size()), first(held.group.size(), -1) {
    state.cpu->for_each(static_cast<int>(of_bundle.size()), [&](int i) {
      std::vector<SlotOfNode>& found = of_bundle[i];
      const CudaBundle& bundle = t.bundles[i];
      for (int k = bundle.first_block; k < bundle.first_block + bundle.blocks; ++k) {
        const CudaBlock& b = t.blocks[k];
        const Block& from = *state.blocks.all[t.of_host[k]];
        int slot = b.first_slot;
        for (int z = 0; z < b.nz + 2; ++z) {
          for (int y = 0; y < b.ny + 2; ++y) {
            const int* const row = from.node.data() + z * from.plane + y * from.pitch;
            for (int x = 0; x < b.nx + 2; ++x, ++slot) {
              if (row[x] >= 0 && held.number[row[x]] >= 0) found.push_back({row[x], slot});
            }
          }
        }
      }
      std::sort(found.begin(), found.end());
    });
    for (const std::vector<SlotOfNode>& found : of_bundle) {
      for (const SlotOfNode& s : found) {
        int& lowest = first[held.number[s.node]];
        if (lowest < 0 || s.slot < lowest) lowest = s.slot;
      }
    }
  }
  int first_of(std::int32_t node) const { return first[nodes.number[node]]; }
};

/// What rows give a node.
struct NodeOfGroup {
  std::int32_t node;
  std::vector<CudaFaceShare> shares;  ///< rows by their place in the group
  int swings = 0;                     ///< for how many of them is_swing()
};

std::vector<NodeOfGroup> nodes_of(const AnchorFaces& faces, const FaceGroup& g) {
  std::vector<NodeOfGroup> nodes;
  for (int i = 0; i < g.count; ++i) {
    const FaceRow& r = faces.rows[g.first + i];
    for (int k = 0; k < kRowNodes; ++k) {
      if (r.weight[k] == 0) continue;
      auto at = std::find_if(nodes.begin(), nodes.end(),
                             [&](const NodeOfGroup& n) { return n.node == r.node[k]; });
      if (at == nodes.end()) at = nodes.insert(nodes.end(), {r.node[k], {}, 0});
      if (r.share[k] != 0) at->shares.push_back({i, r.share[k]});
      at->swings += k == 0 && is_swing(r) ? 1 : 0;
    }
  }
  return nodes;
}

/// Adds a row that is a group of its own, for a bundle with these slots: once for each slot that a
/// node of it has there. `summed`: another bundle sums up its impulse.
void add_row(const AnchorFaces& faces, const FaceGroup& g, const SlotsOfNodes& slots, int bundle,
             int first_slot, bool summed, std::vector<CudaHeldNode>& to) {
  const FaceRow& r = faces.rows[g.first];
  const float mass = faces.inverse[g.inverse];
  const std::vector<SlotOfNode>& here = slots.of_bundle[bundle];
  std::vector<SlotOfNode>::const_iterator at[kRowNodes];
  for (int k = 0; k < kRowNodes; ++k) {
    at[k] = r.share[k] == 0 ? here.end()
                            : std::lower_bound(here.begin(), here.end(), SlotOfNode{r.node[k], 0});
  }
  for (bool more = true; more; summed = true) {
    more = false;
    for (int k = 0; k < kRowNodes; ++k) {
      CudaHeldNode n{};
      n.node = r.weight[k] == 0 ? -1 : r.node[k];
      n.local = -1;
      n.weight = mass * r.weight[k];
      n.share = r.share[k];
      const double arm = k < 3 ? r.place[k] - faces.origin[r.anchor][k] : 1;
      n.arm = static_cast<float>(mass * arm);
      n.anchor = r.anchor | (k == 0 && is_swing(r) ? kSwings : 0);
      n.impulse = summed || k == 3 ? -1 : 3 * g.first + k;
      n.parts.x = n.node < 0 ? kNoSlot : static_cast<std::uint32_t>(slots.first_of(n.node));
      if (at[k] != here.end() && at[k]->node == r.node[k]) {
        n.local = at[k]->slot - first_slot;
        n.parts.x = at[k]->slot;
        ++at[k];
        more = more || (at[k] != here.end() && at[k]->node == r.node[k]);
      }
      to.push_back(n);
    }
  }
}

/// Fills the chunks of one bundle after another.
class FillChunks {
 public:
  FillChunks(const AnchorFaces& faces, const SlotsOfNodes& slots, int room, HostFaceRows& to)
      : faces_(faces), slots_(slots), room_(room), to_(to), summed_(faces.groups.size(), false) {
    CudaFaceChunk none{};
    none.next = -1;
    to.chunks.assign(slots.of_bundle.size(), none);
  }

  void add(int bundle, int first_slot, int group) {
    const FaceGroup& g = faces_.groups[group];
    const std::vector<NodeOfGroup> nodes = nodes_of(faces_, g);
    std::vector<CudaFaceEntry> entries;
    std::vector<std::pair<std::int32_t, int>> entry_of;  // of each node the first
    const std::vector<SlotOfNode>& here = slots_.of_bundle[bundle];
    std::vector<CudaFaceShare> shares;
    for (const NodeOfGroup& n : nodes) {
      entry_of.emplace_back(n.node, static_cast<int>(entries.size()));
      const int first_share = static_cast<int>(shares.size());
      const int count = static_cast<int>(n.shares.size());
      shares.insert(shares.end(), n.shares.begin(), n.shares.end());
      auto at = std::lower_bound(here.begin(), here.end(), SlotOfNode{n.node, 0});
      if (count == 0 || at == here.end() || at->node != n.node) {
        entries.push_back(entry(n, slots_.first_of(n.node), -1, first_share));
        continue;
      }
      for (; at != here.end() && at->node == n.node; ++at) {
        entries.push_back(entry(n, at->slot, at->slot - first_slot, first_share));
      }
    }
    const int count = static_cast<int>(entries.size());
    CudaFaceChunk& chunk = chunk_with_room(bundle, count, g.count);
    const int first_share = static_cast<int>(to_.shares.size());
    for (CudaFaceShare& s : shares) s.row += chunk.rows;
    to_.shares.insert(to_.shares.end(), shares.begin(), shares.end());
    for (CudaFaceEntry& e : entries) {
      e.next_share += first_share;
      e.share.row += chunk.rows;
    }
    to_.entries.insert(to_.entries.end(), entries.begin(), entries.end());
    for (int i = 0; i < g.count; ++i) {
      const FaceRow& r = faces_.rows[g.first + i];
      CudaFaceRow row{};
      for (int k = 0; k < kRowNodes; ++k) {
        const auto at = std::find_if(entry_of.begin(), entry_of.end(),
                                     [&](const auto& e) { return e.first == r.node[k]; });
        // One of weight 0 may stand for none of the group's.
        row.entry[k] = chunk.entries + (at == entry_of.end() ? 0 : at->second);
        row.weight[k] = r.weight[k];
      }
      row.anchor = r.anchor;
      for (int a = 0; a < 3; ++a) {
        row.place[a] = static_cast<float>(r.place[a] - faces_.origin[r.anchor][a]);
      }
      row.group = chunk.rows;
      row.rows = g.count;
      row.inverse = g.inverse + i * g.count;
      row.impulse = summed_[group] ? -1 : g.first + i;
      to_.rows.push_back(row);
    }
    summed_[group] = true;
    chunk.entries += count;
    chunk.rows += g.count;
  }

 private:
  static int numbers(int entries, int rows) {
    return kFaceEntryRoom * entries + kFaceRowRoom * rows;
  }
  static CudaFaceEntry entry(const NodeOfGroup& n, int slot, int local, int first_share) {
    CudaFaceEntry e{};
    e.node = n.node;
    e.parts.x = static_cast<std::uint32_t>(slot);  // kNoSlot for -1
    e.local = local;
    e.shares = static_cast<int>(n.shares.size());
    if (e.shares > 0) e.share = n.shares[0];
    e.next_share = first_share + 1;
    e.swings = n.swings;
    return e;
  }
  /// The bundle's last chunk, or one more where that has no room for it.
  CudaFaceChunk& chunk_with_room(int bundle, int entries, int rows) {
    if (bundle != bundle_) last_ = bundle_ = bundle;
    const int alone = numbers(entries, rows);
    const auto has_room = [&](const CudaFaceChunk& c) {
      return c.rows == 0 || (c.is_large == 0 && numbers(c.entries, c.rows) + alone <= room_);
    };
    if (!has_room(to_.chunks[last_])) {
      CudaFaceChunk more{};
      more.next = -1;
      to_.chunks[last_].next = static_cast<int>(to_.chunks.size());
      last_ = to_.chunks[last_].next;
      to_.chunks.push_back(more);
    }
    CudaFaceChunk& chunk = to_.chunks[last_];
    if (chunk.rows > 0) return chunk;
    chunk.first_entry = static_cast<int>(to_.entries.size());
    chunk.first_row = static_cast<int>(to_.rows.size());
    chunk.is_large = alone > room_ ? 1 : 0;
    if (chunk.is_large != 0) {
      to_.room_each = std::max(to_.room_each, static_cast<std::size_t>((alone + 3) / 4 * 4));
    }
    return chunk;
  }

  const AnchorFaces& faces_;
  const SlotsOfNodes& slots_;
  int room_;
  HostFaceRows& to_;
  std::vector<bool> summed_;
  int bundle_ = -1, last_ = -1;  ///< the bundle at work, and its last chunk
};

}  // namespace

void make_face_rows(const MpmState& state, const HostTables& t, int plane_slots, HostFaceRows& to) {
  const AnchorFaces& faces = state.anchors;
  HeldNodes before = std::move(to.nodes);
  to = HostFaceRows();
  to.nodes = std::move(before);
  to.is_new = true;
  if (faces.groups.empty() && faces.held.empty()) return;
  number_nodes(faces, state.nodes.size(), to.nodes);
  const HeldNodes& nodes = to.nodes;
  const SlotsOfNodes slots(state, t, nodes);
  for (const FaceRow& r : faces.rows) {
    for (int k = 0; k < kRowNodes; ++k) {
      to.carries_always =
          to.carries_always || (r.weight[k] != 0 && nodes.carried[nodes.number[r.node[k]]] >= 0);
    }
  }
  struct OfBundle {
    std::vector<int> groups;
    std::vector<CudaHeldNode> held;
    std::vector<CudaCarriedNode> carried;
  };
  const int count = static_cast<int>(t.bundles.size());
  std::vector<OfBundle> of(count);
  state.cpu->for_each(count, [&](int i) {
    for (const SlotOfNode& s : slots.of_bundle[i]) {
      const std::int32_t number = nodes.number[s.node];
      if (nodes.group[number] >= 0) of[i].groups.push_back(nodes.group[number]);
      if (nodes.carried[number] < 0) continue;
      const AnchorFaces::HeldNode& h = faces.held[nodes.carried[number]];
      of[i].carried.push_back({s.node,
                               s.slot - t.bundles[i].first_slot,
                               s.slot,
                               h.anchor,
                               {h.place[0], h.place[1], h.place[2]}});
    }
    std::sort(of[i].groups.begin(), of[i].groups.end());
    of[i].groups.erase(std::unique(of[i].groups.begin(), of[i].groups.end()), of[i].groups.end());
  });
  std::vector<int> summed_by(faces.groups.size(), -1);  // the first bundle that has a group
  for (int i = 0; i < count; ++i) {
    for (const int g : of[i].groups) {
      if (summed_by[g] < 0) summed_by[g] = i;
    }
  }
  state.cpu->for_each(count, [&](int i) {
    for (const int g : of[i].groups) {
      if (faces.groups[g].count > 1) continue;
      add_row(faces, faces.groups[g], slots, i, t.bundles[i].first_slot, summed_by[g] != i,
              of[i].held);
    }
  });
  FillChunks fill(faces, slots, 4 * 9 * plane_slots, to);
  for (int i = 0; i < count; ++i) {
    to.first_carried.push_back(static_cast<int>(to.carried.size()));
    to.carried.insert(to.carried.end(), of[i].carried.begin(), of[i].carried.end());
    to.first_held.push_back(static_cast<int>(to.held.size()));
    to.held.insert(to.held.end(), of[i].held.begin(), of[i].held.end());
    for (const int g : of[i].groups) {
      if (faces.groups[g].count == 1) continue;
      fill.add(i, t.bundles[i].first_slot, g);
    }
    const int here = static_cast<int>(of[i].held.size());
    to.most_held = std::max(to.most_held, here);
  }
  to.first_held.push_back(static_cast<int>(to.held.size()));
  to.first_carried.push_back(static_cast<int>(to.carried.size()));
}

}  // namespace tissue_sim
