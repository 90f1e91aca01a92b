#include "programs/dataset/dataset_scene.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

#include "tissue_sim/material.h"

namespace tissue_sim {
namespace {

/// Draws that are the same with every standard library.
class Draw {
 public:
  explicit Draw(std::uint64_t seed) : random_(seed) {}
  double even(double from, double to) {
    return from + (to - from) * (static_cast<double>(random_() >> 11) * 0x1p-53);
  }
  double log_even(double from, double to) { return std::exp(even(std::log(from), std::log(to))); }
  int whole(int from, int to) {  // both may be
    return from + static_cast<int>(random_() % static_cast<std::uint64_t>(to - from + 1));
  }
  Vec3 direction() {
    Vec3 d;
    do {
      d = Vec3(even(-1, 1), even(-1, 1), even(-1, 1));
    } while (d.norm() > 1 || d.norm() < 0.1);
    return d.normalized();
  }
  std::uint64_t bits() { return random_(); }

 private:
  std::mt19937_64 random_;
};

/// A blade that goes straight into the body from its top, to a depth.
BladePath notch(const Body& body, const Vec3& size, double x, double depth) {
  BladePath path;
  path.edge = {Vec3(0, -size.y(), 0), Vec3(0, size.y(), 0)};
  const double top = body.pose.position.z() + 0.5 * size.z();
  for (const double z : {top + 0.01, top - depth}) {
    path.poses.push_back({Vec3(x, body.pose.position.y(), z), Quat::Identity()});
  }
  return path;
}

}  // namespace

const std::vector<std::string>& dataset_kinds() {
  static const std::vector<std::string> kinds = {"tension", "fall", "compression",
                                                 "cut",     "blow", "anchored"};
  return kinds;
}

DatasetScene make_dataset_scene(std::uint64_t seed, int index,
                                const std::vector<std::string>& kinds) {
  Draw draw(seed * 0x9e3779b97f4a7c15u + 0x2545f4914f6cdd1du * static_cast<unsigned>(index + 1));
  DatasetScene d;
  d.index = index;
  d.kind = kinds.at(index % kinds.size());
  d.seed = draw.bits();
  Scene& s = d.scene;
  s.name = d.kind;
  s.device = Device::kCpu;
  s.threads = 1;
  s.frame_rate = 960;  // a strain of a tenth takes a millisecond
  s.seed = d.seed;
  const double cells[] = {0.0015, 0.002, 0.0025, 0.003};
  s.cell_size = cells[draw.whole(0, 3)];
  const double h = s.cell_size;

  Material m;
  m.name = "torn";
  m.young_modulus = draw.log_even(1500, 5000);
  m.poisson_ratio = draw.even(0.3, 0.42);
  m.viscosity = draw.even(0, 0.3);
  m.tear_stretch = draw.even(1.15, 1.45);
  m.tear_length = draw.even(1.5, 2.0) * h;  // of the coarse cells, in all runs: toughness is one
  s.materials = {m};

  Body b;
  b.name = "torn";
  b.material = m.name;
  Vec3 size(h * draw.whole(8, 12), h * draw.whole(3, 4), h * draw.whole(3, 4));
  switch (draw.whole(0, 2)) {
    case 0:
      b.shape = Shape::kBox;
      b.size = size;
      break;
    case 1:
      b.shape = Shape::kEllipsoid;
      b.radii = 0.5 * size;
      break;
    default:
      b.shape = Shape::kCylinder;  // lies or stands as tall as it is long
      size = Vec3(size.y(), size.y(), size.x());
      b.radius = 0.5 * size.y();
      b.height = size.z();
  }
  const double gap = d.kind == "fall" || d.kind == "compression" ? 0.5 * h : 20 * h;
  b.pose.position = Vec3(0.5 * size.x(), 0.5 * size.y(), 0.5 * size.z() + gap);
  s.bodies = {b};
  s.ground.enabled = gap < h;
  s.gravity = Vec3(0, 0, s.ground.enabled ? -9.81 : 0);

  // Strain that moves at v in a rod with wave speed c is v / c.
  const double c = std::sqrt(m.young_modulus / m.density), strain = m.tear_stretch - 1;
  const Vec3 middle = b.pose.position;
  int along = 0;
  size.maxCoeff(&along);
  d.speed = draw.even(2.0, 5.0);
  const double v = d.speed * strain * c;
  std::function<Vec3(const Vec3&)> own;  // the kind's
  if (d.kind == "tension" || d.kind == "cut") {
    const double rate = v / (0.5 * size[along]), spin = draw.even(-0.2, 0.2) * rate;
    const int across = (along + 1) % 3;
    own = [=](const Vec3& x) {
      Vec3 velocity = Vec3::Zero();
      velocity[along] = rate * (x[along] - middle[along]);
      velocity[across] = spin * (x[along] - middle[along]);
      return velocity;
    };
    if (d.kind == "cut") {
      const int notches = draw.whole(1, 3);
      for (int i = 0; i < notches; ++i) {
        const double x = middle.x() + draw.even(-0.35, 0.35) * size.x();
        d.cuts.push_back(notch(b, size, x, draw.even(0.3, 0.7) * size.z()));
      }
    }
  } else if (d.kind == "anchored") {
    // Held at one end, an eighth to a quarter of it; the rest moves away, and across.
    const double held = draw.even(0.125, 0.25) * size[along];
    const double rate = v / size[along], swing = draw.even(-0.5, 0.5) * rate;
    const int across = (along + 1) % 3;
    Anchor anchor;
    anchor.kind = Region::Kind::kBox;
    anchor.min = middle - size;
    anchor.max = middle + size;
    const double face = middle[along] - 0.5 * size[along] + held;
    anchor.max[along] = face;
    s.bodies[0].anchors = {anchor};
    own = [=](const Vec3& x) {
      const double from_face = std::max(0.0, x[along] - face);
      Vec3 velocity = Vec3::Zero();
      velocity[along] = rate * from_face;
      velocity[across] = swing * from_face;
      return velocity;
    };
  } else if (d.kind == "fall") {
    const double down = v, sideways = draw.even(-0.5, 0.5) * down;
    own = [=](const Vec3&) { return Vec3(sideways, 0, -down); };
  } else if (d.kind == "compression") {
    const double rate = 2 * v / size.z();
    own = [=](const Vec3& x) { return Vec3(0, 0, -rate * (x.z() - gap)); };
  } else if (d.kind == "blow") {
    // At a place of the surface, into the body or out of it.
    const Vec3 way = draw.direction(), at = middle + 0.5 * way.cwiseProduct(size);
    const double width = draw.even(0.4, 0.9) * size.minCoeff(), sign = draw.whole(0, 1) * 2 - 1;
    own = [=](const Vec3& x) {
      const double r = (x - at).norm() / width;
      return Vec3(2 * sign * v * std::exp(-r * r) * way);
    };
  } else {
    throw std::invalid_argument("there is no kind of scene '" + d.kind +
                                "': it must be tension, fall, compression, cut, blow or anchored");
  }
  // Waves on top of it: tissue that is torn evenly comes apart in its middle, whatever the cells.
  struct Wave {
    Vec3 along, way;  // [1/m], [m/s]
    double phase;
  };
  std::vector<Wave> waves(3);
  for (Wave& w : waves) {
    w.along = draw.direction() * draw.even(2, 7) / size.maxCoeff();
    w.way = draw.direction() * draw.even(0, 0.4) * v;
    w.phase = draw.even(0, 6.283185307179586);
  }
  d.velocity = [=](const Vec3& x) {
    Vec3 velocity = own(x);
    for (const Wave& w : waves) velocity += std::sin(w.along.dot(x - middle) + w.phase) * w.way;
    return velocity;
  };
  return d;
}

Scene finer(const DatasetScene& scene, double level) {
  Scene s = scene.scene;
  s.cell_size /= level;
  return s;
}

}  // namespace tissue_sim
