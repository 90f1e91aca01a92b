#include "mls/face_substep.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "material/laws.h"
#include "mls/faces.h"
#include "mls/node_contact.h"

namespace tissue_sim {
namespace {

int whole_blocks(std::size_t count) {
  return (static_cast<int>(count) + kMlsFaceBlock - 1) / kMlsFaceBlock * kMlsFaceBlock;
}

struct Pair {
  int rank;  ///< 0 where they touch, 1 where they feel one another, 2 else
  std::int32_t low, high, low_entry, high_entry;
};

std::vector<Pair> pairs_of(const MlsState& s) {
  const MlsNodeContacts& c = s.node_contacts;
  std::vector<Pair> pairs;
  pairs.reserve(c.other.size() / 2);
  std::vector<std::int32_t> next(c.begin.begin(), c.begin.end() - 1);
  for (std::size_t k = 0; k < c.node.size(); ++k) {
    const std::int32_t i = c.node[k];
    for (std::int32_t e = c.begin[i]; e < c.begin[i + 1]; ++e) {
      const std::int32_t j = c.other[e];
      if (j < i) continue;
      // Of a node's list those below it come first, by number, as they come here.
      Pair pair{2, static_cast<std::int32_t>(k), c.at[j], e, next[j]++};
      float d[3];
      for (int a = 0; a < 3; ++a) {
        d[a] = (s.place[4 * j + a] - s.place[4 * i + a]) + (s.u[4 * j + a] - s.u[4 * i + a]);
      }
      const float rest = s.face[4 * i + 3] + s.face[4 * j + 3];
      if (mls_contact_weight(d, rest, 0.5f * (s.edge[i] + s.edge[j])) > 0) pair.rank = 1;
      if (c.slip[e].gap < 0) pair.rank = 0;
      pairs.push_back(pair);
    }
  }
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& a, const Pair& b) { return a.rank < b.rank; });
  return pairs;
}

void make_record(const MlsState& s, std::int32_t i, float* record) {
  std::copy_n(&s.place[4 * i], 3, record);
  record[3] = s.face[4 * i + 3];
  std::copy_n(&s.face[4 * i], 3, record + kMlsFaceOutward);
  record[kMlsFaceSpring] = s.contact_stiffness[i];
  record[kMlsFaceSpring + 1] = s.contact_damping[i];
  record[kMlsFaceSpring + 2] = s.root_friction[i];
}

float* of_slip(MlsSlip& slip, int row) {
  float* const rows[] = {slip.low,       slip.low + 1,  slip.low + 2, slip.high,
                         slip.high + 1,  slip.high + 2, slip.apart,   slip.apart + 1,
                         slip.apart + 2, &slip.gap,     &slip.begun};
  return rows[row];
}

void make_face_pairs(MlsState& s) {
  MlsNodeContacts& c = s.node_contacts;
  MlsFacePairs& f = c.pairs;
  const std::vector<Pair> pairs = pairs_of(s);
  const std::size_t count = whole_blocks(pairs.size());
  for (Array<std::int32_t>* a : {&f.low, &f.high, &f.low_entry, &f.high_entry}) {
    a->assign(count, 0);
  }
  f.live.assign(count, 0.0f);
  f.edge.assign(count, 1.0f);
  f.weight.assign(count, 0.0f);
  f.slip.assign(kMlsSlipRows * count, 0.0f);
  f.push.resize(kMlsFacePush * count);
  f.rests.assign(count / kMlsFaceBlock, 0);
  f.begin.assign(c.node.size() + 1, 0);
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const Pair& pair = pairs[p];
    f.low[p] = pair.low;
    f.high[p] = pair.high;
    f.low_entry[p] = pair.low_entry;
    f.high_entry[p] = pair.high_entry;
    f.live[p] = 1;
    f.edge[p] = 0.5f * (s.edge[c.node[pair.low]] + s.edge[c.node[pair.high]]);
    for (int row = 0; row < kMlsSlipRows; ++row) {
      f.slip[row * count + p] = *of_slip(c.slip[pair.low_entry], row);
    }
    ++f.begin[pair.low + 1];
    ++f.begin[pair.high + 1];
  }
  std::partial_sum(f.begin.begin(), f.begin.end(), f.begin.begin());
  f.of.resize(2 * pairs.size());
  std::vector<std::int32_t> next(f.begin.begin(), f.begin.end() - 1);
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    f.of[next[pairs[p].low]++] = static_cast<std::int32_t>(2 * p);
    f.of[next[pairs[p].high]++] = static_cast<std::int32_t>(2 * p + 1);
  }
  f.record.assign(static_cast<std::size_t>(kMlsFaceRecord) * whole_blocks(c.node.size()), 0.0f);
  for (std::size_t k = 0; k < c.node.size(); ++k) {
    make_record(s, c.node[k], &f.record[kMlsFaceRecord * k]);
  }
  c.force.assign(4 * c.node.size(), 0.0f);
  s.deformation.resize(9 * static_cast<std::size_t>(s.chunks()) * kMlsChunk);
  f.made = true;
}

}  // namespace

void return_slips(MlsNodeContacts& c) {
  MlsFacePairs& f = c.pairs;
  const std::size_t count = f.low.size();
  for (std::size_t p = 0; p < count && f.made; ++p) {
    if (f.live[p] == 0) continue;
    MlsSlip slip;
    for (int row = 0; row < kMlsSlipRows; ++row) *of_slip(slip, row) = f.slip[row * count + p];
    c.slip[f.low_entry[p]] = c.slip[f.high_entry[p]] = slip;
  }
}

MlsFaceSubstep::MlsFaceSubstep(MlsState& s, float dt) : s_(s) {
  MlsNodeContacts& c = s.node_contacts;
  if (c.node.empty()) return;
  MlsFacePairs& f = c.pairs;
  if (!f.made) make_face_pairs(s);
  nodes_ = static_cast<int>(c.node.size());
  pair_blocks_ = f.blocks();
  kernels_ = &mls_face_kernels(s.instructions);
  field_.node = c.node.data();
  field_.low = f.low.data();
  field_.high = f.high.data();
  field_.live = f.live.data();
  field_.edge = f.edge.data();
  field_.u = s.u.data();
  field_.v = s.v.data();
  field_.record = f.record.data();
  field_.weight = f.weight.data();
  field_.slip = f.slip.data();
  field_.stride = f.low.size();
  field_.push = f.push.data();
  field_.rests = f.rests.data();
  field_.dt = dt;
  field_.since = s.dt;
}

void MlsFaceSubstep::Last::note(int block) {
  int before = end.load(std::memory_order_relaxed);
  while (before <= block && !end.compare_exchange_weak(before, block + 1)) {
  }
}

void MlsFaceSubstep::weigh(int block) {
  std::uint8_t& rests = s_.node_contacts.pairs.rests[block];
  if (rests > 0) {
    --rests;
  } else if (kernels_->weigh(field_, block)) {
    felt_.note(block);
  }
}

void MlsFaceSubstep::turn(int block) {
  MlsNodeContacts& c = s_.node_contacts;
  const MlsFacePairs& pairs = c.pairs;
  alignas(64) float F[9][kMlsFaceBlock], knows[2][kMlsFaceBlock];
  float* records = field_.record + static_cast<std::size_t>(kMlsFaceRecord) * kMlsFaceBlock * block;
  for (int l = 0; l < kMlsFaceBlock; ++l) {
    const int k =
        std::min(nodes_ - 1, kMlsFaceBlock * block + l);  // the last one fills the block up
    const std::int32_t i = c.node[k];
    const float* from =
        &s_.deformation[9 * static_cast<std::size_t>(i / kMlsChunk) * kMlsChunk + i % kMlsChunk];
    for (int m = 0; m < 9; ++m) F[m][l] = from[m * kMlsChunk];
    knows[0][l] = c.knows[k] == kMlsBearsCouples ? 1.0f : 0.0f;
    knows[1][l] = c.knows[k] != kMlsKnowsNothing ? 1.0f : 0.0f;
    store<4>(records + kMlsFaceRecord * l + kMlsFaceU, load<4>(&s_.u[4 * i]));
  }
  kernels_->turn(F, knows, records);
  const std::int32_t end = 2 * kMlsFaceBlock * felt_.end;
  for (int k = kMlsFaceBlock * block; k < std::min(nodes_, kMlsFaceBlock * (block + 1)); ++k) {
    float sum = 0;
    for (std::int32_t e = pairs.begin[k]; e < pairs.begin[k + 1] && pairs.of[e] < end; ++e) {
      sum += pairs.weight[pairs.of[e] / 2];
    }
    field_.record[kMlsFaceRecord * k + kMlsFaceNormal + 3] = std::max(1.0f, sum);
  }
}

void MlsFaceSubstep::push(int block) {
  if (s_.node_contacts.pairs.rests[block] == 0 && kernels_->push(field_, block)) {
    touched_.note(block);
  }
}

void MlsFaceSubstep::take(int k) {
  MlsNodeContacts& c = s_.node_contacts;
  const MlsFacePairs& pairs = c.pairs;
  const float* gap = field_.slip + kMlsSlipGap * field_.stride;
  const std::int32_t end = 2 * kMlsFaceBlock * touched_.end;
  Vec<4> sum{}, rows[3] = {};
  bool any = false;
  for (std::int32_t e = pairs.begin[k]; e < pairs.begin[k + 1] && pairs.of[e] < end; ++e) {
    const std::int32_t p = pairs.of[e] / 2;
    if (!(gap[p] < 0)) continue;
    any = true;
    const bool high = pairs.of[e] % 2 != 0;
    const float* push = field_.push + kMlsFacePush * p;
    const Vec<4> on_low = load<4>(push), force = high ? -on_low : on_low;
    const Vec<4> arm = load<4>(push + (high ? 8 : 4));
    sum += force;
    for (int a = 0; a < 3; ++a) rows[a] += force[a] * arm;
  }
  store<4>(&c.force[4 * k], sum);
  const float* record = field_.record + kMlsFaceRecord * k;
  if (!any || !(record[kMlsFaceOutward + 3] > 0)) return;
  // Arms in reference space; then force (x) M^-1 arm from Q.
  const std::int32_t i = c.node[k];
  float couple[9], m[6], Q[9];
  for (int a = 0; a < 3; ++a) {
    const float row[3] = {rows[a][0], rows[a][1], rows[a][2]};
    for (int b = 0; b < 3; ++b) {
      couple[3 * a + b] = mls_contact::dot(row, record + kMlsFaceInverse + 3 * b);
    }
  }
  for (int q = 0; q < 6; ++q) m[q] = s_.inverse_moment[q][i];
  times_symmetric(couple, m, Q);
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) {
      const float q = Q[3 * a + b];
      if (s_.lanes.any_slots) s_.lanes.row(kMlsStressRow + 3 * a + b)[i] -= q;
      if (s_.lanes.any_entries) s_.stress[16 * static_cast<std::size_t>(i) + 4 * b + a] -= q;
    }
  }
}

}  // namespace tissue_sim
