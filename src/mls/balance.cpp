// Newton's method for balanced weights. Its linear systems are J S J^T, J the derivative of what is
// out of balance by the weights and S the weights themselves; they are solved by conjugate
// gradients, applied node by node, and sums run in a fixed order: the same bits on any number of
// threads.
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "mls/pairs.h"

namespace tissue_sim {
namespace {

using Matrix = Eigen::Matrix3d;
using Vectors = std::vector<Vec3>;

constexpr int kSteps = 12;           // of Newton's method, at most
constexpr int kIterations = 60;      // of conjugate gradients, at most
constexpr double kEnough = 1e-6;     // out of balance, relative
constexpr double kReduction = 0.03;  // of the residual by conjugate gradients
constexpr double kLargestStep = 1;   // of the logarithm of a weight
constexpr int kGrain = 256;

class Balance {
 public:
  Balance(const MlsNodes& nodes, Cpu& cpu, MlsPairs& pairs)
      : nodes_(nodes), cpu_(cpu), pairs_(pairs), n_(nodes.count()) {
    weight_.assign(pairs.whole.begin(), pairs.whole.end());
    normal_.resize(n_);
    inverse_.resize(n_);
    change_.resize(n_);
    change_of_weight_.resize(weight_.size());
    free_.resize(n_);
    for (std::int32_t i = 0; i < n_; ++i) free_[i] = nodes.surface[i] == 0;
  }

  double run() {
    double left = prepare();
    for (int step = 0; step < kSteps && left > kEnough; ++step) {
      const Vectors lambda = solve();
      times_transpose(lambda);
      cpu_.for_each(
          static_cast<int>(weight_.size()),
          [&](int e) {
            const double d = std::min(kLargestStep, std::max(-kLargestStep, change_of_weight_[e]));
            weight_[e] *= std::exp(d);
          },
          4096);
      left = prepare();
    }
    for (std::size_t e = 0; e < weight_.size(); ++e) {
      pairs_.whole[e] = static_cast<float>(weight_[e]);
    }
    pairs_.weight = pairs_.whole;
    return left;
  }

 private:
  Vec3 r(std::int32_t i, std::int32_t e) const {
    return nodes_.place[pairs_.other[e]] - nodes_.place[i];
  }
  Vec3 g(std::int32_t i, std::int32_t e, const Vec3& r) const {
    return (normal_[i] + normal_[pairs_.other[e]]) * r;
  }
  template <class F>
  void for_each_node(const F& f) {
    cpu_.for_each(n_, f, kGrain);
  }

  /// N_i and what is out of balance, with these weights; the largest of it, relative.
  double prepare() {
    for_each_node([&](int i) {
      Matrix moment = Matrix::Zero();
      for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) {
        const Vec3 d = r(i, e);
        moment += weight_[e] * d * d.transpose();
      }
      inverse_[i] = moment.inverse();
      if (!inverse_[i].allFinite()) {  // a support that spans no space: surface, and left alone
        inverse_[i].setZero();
        free_[i] = false;
      }
      normal_[i] = static_cast<double>(nodes_.volume[i]) * inverse_[i];
    });
    residual_.assign(n_, Vec3::Zero());
    diagonal_.assign(n_, 1.0);
    std::vector<double> relative(n_, 0.0);
    for_each_node([&](int i) {
      if (!free_[i]) return;
      double lengths = 0, diagonal = 0;
      for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) {
        const Vec3 term = g(i, e, r(i, e));
        residual_[i] += weight_[e] * term;
        lengths += weight_[e] * term.norm();
        diagonal += weight_[e] * term.squaredNorm();
      }
      diagonal_[i] = std::max(diagonal, 1e-300);
      relative[i] = residual_[i].norm() / std::max(lengths, 1e-300);
    });
    return n_ == 0 ? 0 : *std::max_element(relative.begin(), relative.end());
  }

  /// change_of_weight_ = J^T lambda, per entry: dw = w times it is the step.
  void times_transpose(const Vectors& lambda) {
    for_each_node([&](int i) {
      Matrix& y = change_[i];
      y.setZero();
      for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) {
        y += weight_[e] * (lambda[i] - lambda[pairs_.other[e]]) * r(i, e).transpose();
      }
    });
    for_each_node([&](int i) {
      for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) {
        const std::int32_t j = pairs_.other[e];
        const Vec3 d = r(i, e), a = inverse_[i] * d, b = inverse_[j] * d;
        const double by_moments = static_cast<double>(nodes_.volume[i]) * a.dot(change_[i] * a) +
                                  static_cast<double>(nodes_.volume[j]) * b.dot(change_[j] * b);
        change_of_weight_[e] = g(i, e, d).dot(lambda[i] - lambda[j]) - by_moments;
      }
    });
  }

  /// out = J (w change_of_weight_), 0 at nodes that are not free.
  void times(Vectors& out) {
    for_each_node([&](int i) {
      Matrix moment = Matrix::Zero();
      for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) {
        const Vec3 d = r(i, e);
        moment += weight_[e] * change_of_weight_[e] * d * d.transpose();
      }
      change_[i] = -static_cast<double>(nodes_.volume[i]) * (inverse_[i] * moment * inverse_[i]);
    });
    for_each_node([&](int i) {
      out[i].setZero();
      if (!free_[i]) return;
      for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) {
        const Vec3 d = r(i, e);
        out[i] += weight_[e] *
                  (change_of_weight_[e] * g(i, e, d) + (change_[i] + change_[pairs_.other[e]]) * d);
      }
    });
  }

  double dot(const Vectors& a, const Vectors& b) const {
    double sum = 0;
    for (std::int32_t i = 0; i < n_; ++i) sum += a[i].dot(b[i]);
    return sum;
  }

  /// J S J^T lambda = -residual.
  Vectors solve() {
    Vectors x(n_, Vec3::Zero()), rest(n_), z(n_), p(n_), q(n_);
    for (std::int32_t i = 0; i < n_; ++i) rest[i] = -residual_[i];
    const auto precondition = [&] {
      for (std::int32_t i = 0; i < n_; ++i) {
        z[i] = Vec3::Zero();
        if (free_[i] != 0) z[i] = rest[i] / diagonal_[i];
      }
    };
    precondition();
    p = z;
    double rz = dot(rest, z);
    const double enough = kReduction * kReduction * rz;
    for (int k = 0; k < kIterations && rz > enough && rz > 0; ++k) {
      times_transpose(p);
      times(q);
      const double curvature = dot(p, q);
      if (!(curvature > 0)) break;
      const double alpha = rz / curvature;
      for (std::int32_t i = 0; i < n_; ++i) {
        x[i] += alpha * p[i];
        rest[i] -= alpha * q[i];
      }
      precondition();
      const double next = dot(rest, z);
      for (std::int32_t i = 0; i < n_; ++i) p[i] = z[i] + next / rz * p[i];
      rz = next;
    }
    return x;
  }

  const MlsNodes& nodes_;
  Cpu& cpu_;
  MlsPairs& pairs_;
  const std::int32_t n_;
  std::vector<double> weight_, change_of_weight_, diagonal_;
  std::vector<Matrix> normal_, inverse_, change_;
  std::vector<char> free_;
  Vectors residual_;
};

}  // namespace

double balance(const MlsNodes& nodes, Cpu& cpu, MlsPairs& pairs) {
  return Balance(nodes, cpu, pairs).run();
}

}  // namespace tissue_sim
