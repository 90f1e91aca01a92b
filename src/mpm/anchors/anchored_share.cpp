#include <algorithm>
#include <cmath>

#include "mpm/anchors/anchor_faces.h"
#include "mpm/lattice/bonds.h"

namespace tissue_sim {
namespace {

constexpr int kLines = 8;           // along y and z, where it is not exact
constexpr double kSmallest = 1e-3;  // share of a point below which it is none: its anchor is off
                                    // by less than that of its cube then

/// What a region covers of a line along x at y, z; false for nothing.
bool covered(const Region& r, double y, double z, double& begin, double& end) {
  begin = -1e30;
  end = 1e30;
  switch (r.kind) {
    case Region::Kind::kBelow:
      return z < r.z;
    case Region::Kind::kBox:
      begin = r.min.x();
      end = r.max.x();
      return y >= r.min.y() && y <= r.max.y() && z >= r.min.z() && z <= r.max.z();
    case Region::Kind::kBall: {
      const double dy = y - r.center.y(), dz = z - r.center.z();
      const double left = r.radius * r.radius - dy * dy - dz * dz;
      if (left <= 0) return false;
      begin = r.center.x() - std::sqrt(left);
      end = r.center.x() + std::sqrt(left);
      return true;
    }
  }
  return false;
}

/// The box that a region is a part of.
Box box_of(const Region& r) {
  Box box;
  switch (r.kind) {
    case Region::Kind::kBelow:
      box.min = Vec3::Constant(-1e30);
      box.max = Vec3(1e30, 1e30, r.z);
      break;
    case Region::Kind::kBox:
      box.min = r.min;
      box.max = r.max;
      break;
    case Region::Kind::kBall:
      box.min = r.center - Vec3::Constant(r.radius);
      box.max = r.center + Vec3::Constant(r.radius);
      break;
  }
  return box;
}

/// Of a cube whose part between `low` and `high` is inside.
OutsideShare outside_box(const Vec3& low, const Vec3& high, const Vec3& center, double edge) {
  const Vec3 size = (high - low) / edge;
  const double inside = size.prod();
  OutsideShare result;
  result.share = 1 - inside;
  if (result.share > 1e-9) {
    result.middle = -inside * (0.5 * (low + high) - center) / edge / result.share;
  }
  return result;
}

void find_lightness(LatticeTissue& tissue) {
  Points& points = tissue.points;
  const auto share = [&](int p) { return points.free_volume[p] / points.volume[p]; };
  points.lightness.assign(points.size(), 1.0f);
  for (const LatticeBody& b : tissue.bodies) {
    for (int p = b.first_point; p < b.first_point + b.point_count; ++p) {
      if (share(p) >= 1) continue;
      const Points::Site& s = points.site[p];
      float most = share(p);
      for (int k = 0; k < kBondCount; ++k) {
        const BondOffset o = bond_offset(k);
        const int other = b.point(s.x + o.x, s.y + o.y, s.z + o.z);
        if (other >= 0) most = std::max(most, std::min(share(other), 1.0f));
      }
      points.lightness[p] = most > 0 ? share(p) / most : 0;
    }
  }
}

}  // namespace

OutsideShare share_outside(const std::vector<Anchor>& anchors, const Vec3& center, double edge) {
  const Vec3 first = center - Vec3::Constant(edge / 2), last = center + Vec3::Constant(edge / 2);
  std::vector<const Anchor*> near;
  for (const Anchor& a : anchors) {
    const Box box = box_of(a);
    if ((box.min.array() < last.array()).all() && (box.max.array() > first.array()).all()) {
      near.push_back(&a);
    }
  }
  if (near.empty()) return {};
  if (near.size() == 1 && near[0]->kind != Region::Kind::kBall) {
    const Box box = box_of(*near[0]);
    return outside_box(box.min.cwiseMax(first), box.max.cwiseMin(last), center, edge);
  }
  const double width = edge / kLines;
  double sum = 0;
  Vec3 moment = Vec3::Zero();
  std::vector<std::pair<double, double>> inside;
  for (int i = 0; i < kLines * kLines; ++i) {
    const double y = first.y() + (i % kLines + 0.5) * width;
    const double z = first.z() + (i / kLines + 0.5) * width;
    inside.clear();
    for (const Anchor* a : near) {
      double begin, end;
      if (covered(*a, y, z, begin, end)) inside.emplace_back(begin, end);
    }
    std::sort(inside.begin(), inside.end());
    double from = first.x();
    const auto add = [&](double to) {
      to = std::min(to, last.x());
      if (to <= from) return;
      sum += to - from;
      moment += (to - from) * Vec3(0.5 * (from + to) - center.x(), y - center.y(), z - center.z());
    };
    for (const auto& [begin, end] : inside) {
      add(begin);
      from = std::max(from, end);
    }
    add(last.x());
  }
  OutsideShare result;
  result.share = sum / (edge * kLines * kLines);
  if (result.share > 1e-9) result.middle = moment / (sum * edge);
  return result;
}

void find_free_volumes(LatticeTissue& tissue) {
  const bool any = std::any_of(tissue.bodies.begin(), tissue.bodies.end(),
                               [](const LatticeBody& b) { return !b.body.anchors.empty(); });
  if (!any) return;
  tissue.points.free_volume.assign(tissue.points.size(), 0.0f);
  for (const LatticeBody& b : tissue.bodies) {
    for (int p = b.first_point; p < b.first_point + b.point_count; ++p) {
      const Points::Site& s = tissue.points.site[p];
      const OutsideShare o =
          share_outside(b.body.anchors, b.site_position(s.x, s.y, s.z), b.cell_size / 2);
      if (o.share < kSmallest) continue;
      // A point stands in the middle of its cube, the share does not: some of it goes to the next.
      for (int k = 0; k < 8; ++k) {
        double weight = o.share;
        int to[3] = {s.x, s.y, s.z};
        for (int a = 0; a < 3; ++a) {
          const int next = to[a] + (o.middle[a] < 0 ? -1 : 1);
          double off = share_shifted(std::abs(o.middle[a]), next >> 1 != to[a] >> 1);
          if (off < kSmallest) off = 0;  // rounding would leave nodes of 1e-24 kg
          weight *= k >> a & 1 ? off : 1 - off;
          if (k >> a & 1) to[a] = next;
        }
        if (weight == 0) continue;
        const int other = b.point(to[0], to[1], to[2]);
        tissue.points.free_volume[other < 0 ? p : other] +=
            static_cast<float>(weight) * tissue.points.volume[p];
      }
    }
  }
  find_lightness(tissue);
}

}  // namespace tissue_sim
