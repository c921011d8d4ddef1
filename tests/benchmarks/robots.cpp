// Nanoseconds of Pinocchio's inverse dynamics of the arm that standard input describes.
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>

#include <chrono>
#include <cstdio>
#include <iostream>
#include <string>

int main() {
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
  pinocchio::Data data(model);
  Eigen::VectorXd q(n), v(n), a(n);
  for (int i = 0; i < n; ++i) {
    q[i] = 0.3 + 0.1 * i;
    v[i] = 0.2 * i - 0.5;
    a[i] = 0.7 - 0.3 * i;
  }
  double least = 1e9, sum = 0;
  for (int turn = 0; turn < 60; ++turn) {
    const auto begin = std::chrono::steady_clock::now();
    for (int k = 0; k < 20000; ++k) {
      q[k % n] += 1e-6;
      sum += pinocchio::rnea(model, data, q, v, a)[k % n];
    }
    const std::chrono::duration<double, std::nano> spent = std::chrono::steady_clock::now() - begin;
    least = std::min(least, spent.count() / 20000);
  }
  std::printf("%.1f %g\n", least, sum);
  return 0;
}
