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

double q[N][6], dq[N][6], ddq[N][6], tau[N][6], M[N][36], delta[N][6];
double all_q[6 * N], all_dq[6 * N], all_ddq[6 * N], all_tau[6 * N], all_M[36 * N], all_delta[6 * N];

}  // namespace

#define COMPARE(NAME)                                                                            \
  do {                                                                                           \
    static double phi[NAME##_n_parameters];                                                      \
    static double K[N][6 * NAME##_n_parameters];                                                 \
    NAME##_parameters(phi);                                                                      \
    enter(#NAME "_idm", [&] {                                                                    \
      for (int k = 0; k < N; ++k) NAME##_inverse_dynamics(phi, q[k], dq[k], ddq[k], tau[k]);     \
    });                                                                                          \
    enter(#NAME "_idm_batch",                                                                    \
           [&] { NAME##_inverse_dynamics_batch(N, phi, all_q, all_dq, all_ddq, all_tau); });     \
    enter(#NAME "_ddm", [&] {                                                                    \
      for (int k = 0; k < N; ++k) NAME##_direct_dynamics(phi, q[k], dq[k], M[k], delta[k]);      \
    });                                                                                          \
    enter(#NAME "_ddm_batch",                                                                    \
           [&] { NAME##_direct_dynamics_batch(N, phi, all_q, all_dq, all_M, all_delta); });      \
    enter(#NAME "_regressor", [&] {                                                              \
      for (int k = 0; k < N; ++k) NAME##_K_regressor(q[k], dq[k], ddq[k], K[k]);                 \
    });                                                                                          \
  } while (false)

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
      all_q[i * N + k] = q[k][i] = Q[k][i] = normal(random);
      all_dq[i * N + k] = dq[k][i] = V[k][i] = normal(random);
      all_ddq[i * N + k] = ddq[k][i] = A[k][i] = normal(random);
    }
  }

  double phi[full_n_parameters], worst = 0;
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
  report();
  return sink == 1e300;
}
