// Nanoseconds of Pinocchio's algorithms, by their names, on the arm that standard input describes.
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/regressor.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <functional>
#include <iostream>
#include <random>
#include <string>
#include <vector>

namespace {

constexpr int states = 256, repeats = 8, rounds = 60;

pinocchio::Model read_model() {
  pinocchio::Model model;
  int n = 0;
  std::cin >> n;
  for (int k = 0; k < n; ++k) {
    int parent = 0;
    char axis = 'z';
    Eigen::Matrix3d R;
    Eigen::Vector3d p;
    Eigen::Matrix<double, 10, 1> inertia;
    std::cin >> parent >> axis;
    for (int i = 0; i < 9; ++i) std::cin >> R(i / 3, i % 3);
    for (int i = 0; i < 3; ++i) std::cin >> p[i];
    for (int i = 0; i < 10; ++i) std::cin >> inertia[i];
    const pinocchio::SE3 placement(R, p);
    const std::string name = "joint" + std::to_string(k);
    const auto joint = axis == 'x'   ? model.addJoint(parent, pinocchio::JointModelRX(), placement, name)
                       : axis == 'y' ? model.addJoint(parent, pinocchio::JointModelRY(), placement, name)
                                     : model.addJoint(parent, pinocchio::JointModelRZ(), placement, name);
    model.appendBodyToJoint(joint, pinocchio::Inertia::FromDynamicParameters(inertia), pinocchio::SE3::Identity());
  }
  return model;
}

}  // namespace

int main() {
  const pinocchio::Model model = read_model();
  pinocchio::Data data(model);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-2, 2);
  std::vector<Eigen::VectorXd> q, v, a;
  for (int k = 0; k < states; ++k)
    for (auto *list : {&q, &v, &a}) {
      list->push_back(Eigen::VectorXd(model.nv));
      for (int i = 0; i < model.nv; ++i) list->back()[i] = uniform(random);
    }
  double sum = 0;
  struct Entry {
    std::string name;
    std::function<void(int)> work;
    double least = 1e9;
  };
  std::vector<Entry> entries = {
      {"rnea", [&](int k) { sum += pinocchio::rnea(model, data, q[k], v[k], a[k])[0]; }},
      {"computeGeneralizedGravity", [&](int k) { sum += pinocchio::computeGeneralizedGravity(model, data, q[k])[0]; }},
      {"nonLinearEffects", [&](int k) { sum += pinocchio::nonLinearEffects(model, data, q[k], v[k])[0]; }},
      {"crba", [&](int k) { sum += pinocchio::crba(model, data, q[k], pinocchio::Convention::WORLD)(0, 0); }},
      {"crba + nonLinearEffects",
       [&](int k) {
         sum += pinocchio::crba(model, data, q[k], pinocchio::Convention::WORLD)(0, 0);
         sum += pinocchio::nonLinearEffects(model, data, q[k], v[k])[0];
       }},
      {"computeCoriolisMatrix", [&](int k) { sum += pinocchio::computeCoriolisMatrix(model, data, q[k], v[k])(0, 0); }},
      {"computeRNEADerivatives",
       [&](int k) {
         pinocchio::computeRNEADerivatives(model, data, q[k], v[k], a[k]);
         sum += data.dtau_dq(0, 0);
       }},
      {"aba", [&](int k) { sum += pinocchio::aba(model, data, q[k], v[k], a[k], pinocchio::Convention::LOCAL)[0]; }},
      {"computeJointTorqueRegressor",
       [&](int k) { sum += pinocchio::computeJointTorqueRegressor(model, data, q[k], v[k], a[k])(0, 0); }},
  };
  // All of them in turn, so that what disturbs one disturbs its neighbours too.
  for (int round = 0; round < rounds; ++round)
    for (Entry &entry : entries) {
      const auto begin = std::chrono::steady_clock::now();
      for (int turn = 0; turn < repeats; ++turn)
        for (int k = 0; k < states; ++k) entry.work(k);
      const std::chrono::duration<double, std::nano> spent = std::chrono::steady_clock::now() - begin;
      entry.least = std::min(entry.least, spent.count() / repeats / states);
    }
  for (const Entry &entry : entries) std::printf("%.1f %s\n", entry.least, entry.name.c_str());
  return sum == 0.123;
}
