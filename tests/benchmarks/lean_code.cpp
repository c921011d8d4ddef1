// Nanoseconds of exported functions and of Pinocchio's algorithms on the same arm.
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "arm.h"
#include "base.h"
#include "base_K.h"
#include "fs18.h"
#include "fs18_K.h"
#include "full.h"
#include "full_K.h"
#include "single_M.h"
#include "single_d.h"
#include "terms_M.h"
#include "terms_d.h"

namespace {

constexpr int N = 256;
constexpr int repeats = 8;
constexpr int rounds = 300;

struct Entry {
  std::string name;
  std::function<void()> work;
  std::vector<double> times;
};
std::vector<Entry> entries;

void enter(const char *name, std::function<void()> work) { entries.push_back({name, work, {}}); }

// All of them in turn, in small turns, so that what disturbs one disturbs its neighbours too.
void report() {
  for (int round = 0; round < rounds; ++round)
    for (Entry &entry : entries) {
      entry.work();
      const auto start = std::chrono::steady_clock::now();
      for (int k = 0; k < repeats; ++k) entry.work();
      const std::chrono::duration<double, std::nano> spent = std::chrono::steady_clock::now() - start;
      entry.times.push_back(spent.count() / repeats / N);
    }
  for (const Entry &entry : entries) {
    std::printf("%s", entry.name.c_str());
    for (double time : entry.times) std::printf(" %.2f", time);
    std::printf("\n");
  }
}

double q[N][6], dq[N][6], ddq[N][6], tau[N][6];

}  // namespace

// Arguments in the precision of a model, filled with the same states.
#define GIVEN(NAME)                                                                              \
  static NAME##_real phi[NAME##_n_parameters], q_[N][6], dq_[N][6], ddq_[N][6];                  \
  static NAME##_real Q[6 * N], DQ[6 * N], DDQ[6 * N];                                            \
  NAME##_parameters(phi);                                                                        \
  for (int k = 0; k < N; ++k)                                                                    \
    for (int i = 0; i < 6; ++i) {                                                                \
      Q[i * N + k] = q_[k][i] = NAME##_real(q[k][i]);                                            \
      DQ[i * N + k] = dq_[k][i] = NAME##_real(dq[k][i]);                                         \
      DDQ[i * N + k] = ddq_[k][i] = NAME##_real(ddq[k][i]);                                      \
    }

#define INVERSE(NAME)                                                                            \
  do {                                                                                           \
    GIVEN(NAME)                                                                                  \
    static NAME##_real tau_[N][6], TAU[6 * N];                                                   \
    enter(#NAME "_idm", [&] {                                                                    \
      for (int k = 0; k < N; ++k) NAME##_inverse_dynamics(phi, q_[k], dq_[k], ddq_[k], tau_[k]); \
    });                                                                                          \
    enter(#NAME "_idm_batch",                                                                    \
           [&] { NAME##_inverse_dynamics_batch(N, phi, Q, DQ, DDQ, TAU); });                     \
  } while (false)

#define DIRECT(NAME)                                                                             \
  do {                                                                                           \
    GIVEN(NAME)                                                                                  \
    static NAME##_real M_[N][36], delta_[N][6], MM[36 * N], DELTA[6 * N];                        \
    enter(#NAME "_ddm", [&] {                                                                    \
      for (int k = 0; k < N; ++k) NAME##_direct_dynamics(phi, q_[k], dq_[k], M_[k], delta_[k]);  \
    });                                                                                          \
    enter(#NAME "_ddm_batch", [&] { NAME##_direct_dynamics_batch(N, phi, Q, DQ, MM, DELTA); });  \
  } while (false)

#define REGRESSOR(NAME)                                                                          \
  do {                                                                                           \
    static double K[N][6 * NAME##_n_parameters];                                                 \
    enter(#NAME "_regressor", [&] {                                                              \
      for (int k = 0; k < N; ++k) NAME##_K_regressor(q[k], dq[k], ddq[k], K[k]);                 \
    });                                                                                          \
  } while (false)

#define COMPARE(NAME) \
  INVERSE(NAME);      \
  DIRECT(NAME);       \
  REGRESSOR(NAME)

int main() {
  pinocchio::Model model;
  model.gravity.linear() << gravity[0], gravity[1], gravity[2];
  for (int i = 0; i < 6; ++i) {
    pinocchio::SE3 placement;
    for (int r = 0; r < 3; ++r) {
      placement.translation()[r] = places[i][r][3];
      for (int c = 0; c < 3; ++c) placement.rotation()(r, c) = places[i][r][c];
    }
    const auto id = model.addJoint(i, pinocchio::JointModelRZ(), placement, std::to_string(i));
    Eigen::Matrix<double, 10, 1> values;
    for (int k = 0; k < 10; ++k) values[k] = inertias[i][k];
    model.appendBodyToJoint(id, pinocchio::Inertia::FromDynamicParameters(values));
  }
  pinocchio::Data data(model);

  std::mt19937 random(0);
  std::normal_distribution<double> normal;
  std::vector<Eigen::VectorXd> Q, V, A;
  for (int k = 0; k < N; ++k) {
    Q.emplace_back(6), V.emplace_back(6), A.emplace_back(6);
    for (int i = 0; i < 6; ++i) {
      q[k][i] = Q[k][i] = normal(random);
      dq[k][i] = V[k][i] = normal(random);
      ddq[k][i] = A[k][i] = normal(random);
    }
  }

  static double phi[full_n_parameters];
  double worst = 0;
  full_parameters(phi);
  for (int k = 0; k < N; ++k) {
    full_inverse_dynamics(phi, q[k], dq[k], ddq[k], tau[k]);
    const Eigen::VectorXd &expected = pinocchio::rnea(model, data, Q[k], V[k], A[k]);
    for (int i = 0; i < 6; ++i) worst = std::max(worst, std::abs(tau[k][i] - expected[i]));
  }
  std::printf("difference %.3e\n", worst);

  double sink = 0;
  enter("rnea", [&] {
    for (int k = 0; k < N; ++k) sink += pinocchio::rnea(model, data, Q[k], V[k], A[k])[0];
  });
  enter("crba_bias", [&] {
    for (int k = 0; k < N; ++k) {
      sink += pinocchio::crba(model, data, Q[k])(0, 0);
      sink += pinocchio::nonLinearEffects(model, data, Q[k], V[k])[0];
    }
  });
  enter("aba", [&] {
    for (int k = 0; k < N; ++k) sink += pinocchio::aba(model, data, Q[k], V[k], A[k])[0];
  });
  enter("regressor", [&] {
    for (int k = 0; k < N; ++k)
      sink += pinocchio::computeJointTorqueRegressor(model, data, Q[k], V[k], A[k])(0, 9);
  });
  COMPARE(full);
  COMPARE(base);
  COMPARE(fs18);
  INVERSE(terms_d);
  DIRECT(terms_M);
  INVERSE(single_d);
  DIRECT(single_M);
  report();
  return sink == 1e300;
}
