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

using Vector = Eigen::Vector3f;
using Matrix = Eigen::Matrix3f;
using Vectors = std::vector<Vector>;

constexpr int kSteps = 12;           // of Newton's method, at most
constexpr int kIterations = 60;      // of conjugate gradients, at most
constexpr float kEnough = 1e-5f;     // out of balance, relative
constexpr float kReduction = 0.05f;  // of the residual by conjugate gradients
constexpr float kLargestStep = 1;    // of the logarithm of a weight
constexpr int kGrain = 256;

/// In units of the mean spacing, so that single precision does.
class Balance {
 public:
  Balance(const MlsNodes& nodes, Cpu& cpu, MlsPairs& pairs)
      : cpu_(cpu), pairs_(pairs), n_(nodes.count()), weight_(pairs.whole), r_(weight_.size()) {
    double support = 0, volume = 0;
    for (std::int32_t i = 0; i < n_; ++i) {
      support += pairs.support[i] / n_;
      volume += nodes.volume[i] / n_;
    }
    for (std::int32_t i = 0; i < n_; ++i) {
      volume_.push_back(static_cast<float>(nodes.volume[i] / volume));
      free_.push_back(nodes.surface[i] == 0);
      for (std::int32_t e = pairs.begin[i]; e < pairs.begin[i + 1]; ++e) {
        r_[e] = ((nodes.place[pairs.other[e]] - nodes.place[i]) / support).cast<float>();
      }
    }
    g_.resize(r_.size());
    step_.resize(r_.size());
    normal_.resize(n_);
    inverse_.resize(n_);
    change_.resize(n_);
  }

  double run() {
    float left = prepare();
    for (int step = 0; step < kSteps && left > kEnough; ++step) {
      times_transpose(solve());
      for_each_entry([&](std::int32_t, std::int32_t e) {
        weight_[e] *= std::exp(std::min(kLargestStep, std::max(-kLargestStep, step_[e])));
      });
      left = prepare();
    }
    pairs_.whole = weight_;
    pairs_.weight = weight_;
    return left;
  }

 private:
  template <class F>
  void for_each_node(const F& f) {
    cpu_.for_each(n_, f, kGrain);
  }
  template <class F>
  void for_each_entry(const F& f) {
    for_each_node([&](int i) {
      for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) f(i, e);
    });
  }

  /// N_i and what is out of balance, with these weights; the largest of it, relative.
  float prepare() {
    for_each_node([&](int i) {
      Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
      for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) {
        const Vec3 r = r_[e].cast<double>();
        moment += static_cast<double>(weight_[e]) * r * r.transpose();
      }
      const Eigen::Matrix3d inverse = moment.inverse();
      inverse_[i] = inverse.cast<float>();
      if (!inverse_[i].allFinite()) {  // a support that spans no space: left as it is
        inverse_[i].setZero();
        free_[i] = 0;
      }
      normal_[i] = volume_[i] * inverse_[i];
    });
    for_each_entry([&](std::int32_t i, std::int32_t e) {
      g_[e] = (normal_[i] + normal_[pairs_.other[e]]) * r_[e];
    });
    residual_.assign(n_, Vector::Zero());
    diagonal_.assign(n_, 1.0f);
    std::vector<float> relative(n_, 0.0f);
    for_each_node([&](int i) {
      if (free_[i] == 0) return;
      float lengths = 0, diagonal = 0;
      for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) {
        residual_[i] += weight_[e] * g_[e];
        lengths += weight_[e] * g_[e].norm();
        diagonal += weight_[e] * g_[e].squaredNorm();
      }
      if (lengths == 0) return;
      diagonal_[i] = diagonal;
      relative[i] = residual_[i].norm() / lengths;
    });
    return n_ == 0 ? 0 : *std::max_element(relative.begin(), relative.end());
  }

  /// step_ = J^T lambda, of each weight's logarithm.
  void times_transpose(const Vectors& lambda) {
    for_each_node([&](int i) {
      Matrix& y = change_[i];
      y.setZero();
      for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) {
        const Vector d = weight_[e] * (lambda[i] - lambda[pairs_.other[e]]);
        y += d * r_[e].transpose();
      }
      y = volume_[i] * (inverse_[i] * y * inverse_[i]).eval();
    });
    for_each_entry([&](std::int32_t i, std::int32_t e) {
      const std::int32_t j = pairs_.other[e];
      const Matrix by_moments = change_[i] + change_[j];
      step_[e] = g_[e].dot(lambda[i] - lambda[j]) - r_[e].dot(by_moments * r_[e]);
    });
  }

  /// out = J (w step_), 0 at nodes that are not free.
  void times(Vectors& out) {
    for_each_node([&](int i) {
      Matrix moment = Matrix::Zero();
      for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) {
        moment += weight_[e] * step_[e] * r_[e] * r_[e].transpose();
      }
      change_[i] = -volume_[i] * (inverse_[i] * moment * inverse_[i]);
    });
    for_each_node([&](int i) {
      out[i].setZero();
      if (free_[i] == 0) return;
      for (std::int32_t e = pairs_.begin[i]; e < pairs_.begin[i + 1]; ++e) {
        const Matrix change = change_[i] + change_[pairs_.other[e]];
        out[i] += weight_[e] * (step_[e] * g_[e] + change * r_[e]);
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
    Vectors x(n_, Vector::Zero()), rest(n_), z(n_), p(n_), q(n_);
    for (std::int32_t i = 0; i < n_; ++i) rest[i] = -residual_[i];
    const auto precondition = [&] {
      for (std::int32_t i = 0; i < n_; ++i) z[i] = rest[i] * (free_[i] / diagonal_[i]);
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
      const auto alpha = static_cast<float>(rz / curvature);
      for (std::int32_t i = 0; i < n_; ++i) {
        x[i] += alpha * p[i];
        rest[i] -= alpha * q[i];
      }
      precondition();
      const double next = dot(rest, z);
      for (std::int32_t i = 0; i < n_; ++i) p[i] = z[i] + static_cast<float>(next / rz) * p[i];
      rz = next;
    }
    return x;
  }

  Cpu& cpu_;
  MlsPairs& pairs_;
  const std::int32_t n_;
  Array<float> weight_;
  Vectors r_, g_;              // of each entry
  std::vector<float> step_;    // of each entry
  std::vector<float> volume_;  // of each node, as all below
  std::vector<char> free_;
  std::vector<Matrix> normal_, inverse_, change_;
  std::vector<float> diagonal_;
  Vectors residual_;
};

}  // namespace

double balance(const MlsNodes& nodes, Cpu& cpu, MlsPairs& pairs) {
  return Balance(nodes, cpu, pairs).run();
}

}  // namespace tissue_sim
