// Times Pinocchio on one robot: reads the name of a quantity a line, answers with nanoseconds per call.
//
//     pinocchio ROBOT.urdf fixed|floating FRAME CALLS

#include <chrono>
#include <cstdlib>
#include <iostream>
#include <random>
#include <string>
#include <vector>

#include <pinocchio/algorithm/aba-derivatives.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/center-of-mass.hpp>
#include <pinocchio/algorithm/centroidal.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/parsers/urdf.hpp>

namespace pin = pinocchio;

struct State {
    Eigen::VectorXd q, v, a;
};

int main(int argc, char** argv) {
    if (argc != 5) {
        std::cerr << "usage: pinocchio ROBOT.urdf fixed|floating FRAME CALLS\n";
        return 2;
    }
    pin::Model model;
    if (std::string(argv[2]) == "floating") {
        pin::urdf::buildModel(argv[1], pin::JointModelFreeFlyer(), model);
    } else {
        pin::urdf::buildModel(argv[1], model);
    }
    pin::Data data(model);
    const auto frame = model.getFrameId(argv[3]);
    const int calls = std::atoi(argv[4]);

    std::mt19937_64 generator(1);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    auto vector = [&] {
        Eigen::VectorXd out(model.nv);
        for (auto& entry : out) entry = uniform(generator);
        return out;
    };
    std::vector<State> states;
    for (int i = 0; i < 64; ++i) {
        Eigen::VectorXd tangent = vector();
        states.push_back({pin::integrate(model, pin::neutral(model), tangent), vector(), vector()});
    }
    Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(6, model.nv);

    std::string name;
    std::size_t next = 0;
    while (std::getline(std::cin, name)) {
        auto time = [&](auto&& call) {
            const auto start = std::chrono::steady_clock::now();
            for (int i = 0; i < calls; ++i) {
                next = (next + 1) % states.size();
                call(states[next]);
            }
            const auto end = std::chrono::steady_clock::now();
            return std::chrono::duration<double, std::nano>(end - start).count() / calls;
        };
        double ns = -1;
        if (name == "rnea") {
            ns = time([&](const State& s) { pin::rnea(model, data, s.q, s.v, s.a); });
        } else if (name == "bias") {
            ns = time([&](const State& s) { pin::nonLinearEffects(model, data, s.q, s.v); });
        } else if (name == "crba" || name == "crba_full") {
            // Upper triangle; `crba_full` is what a user needs who wants both.
            const bool full = name == "crba_full";
            ns = time([&](const State& s) {
                pin::crba(model, data, s.q, pin::Convention::LOCAL);
                if (full) data.M.triangularView<Eigen::StrictlyLower>() = data.M.transpose().triangularView<Eigen::StrictlyLower>();
            });
        } else if (name == "aba") {
            ns = time([&](const State& s) { pin::aba(model, data, s.q, s.v, s.a, pin::Convention::LOCAL); });
        } else if (name == "forward_kinematics") {
            ns = time([&](const State& s) { pin::forwardKinematics(model, data, s.q); });
        } else if (name == "frame_jacobian") {
            ns = time([&](const State& s) { pin::computeFrameJacobian(model, data, s.q, frame, jacobian); });
        } else if (name == "com_jacobian") {
            ns = time([&](const State& s) { pin::jacobianCenterOfMass(model, data, s.q); });
        } else if (name == "centroidal_map") {
            ns = time([&](const State& s) { pin::computeCentroidalMap(model, data, s.q); });
        } else if (name == "inverse_mass") {
            ns = time([&](const State& s) { pin::computeMinverse(model, data, s.q); });
        } else if (name == "rnea_derivatives") {
            ns = time([&](const State& s) { pin::computeRNEADerivatives(model, data, s.q, s.v, s.a); });
        } else if (name == "aba_derivatives") {
            ns = time([&](const State& s) { pin::computeABADerivatives(model, data, s.q, s.v, s.a); });
        }
        std::cout << ns << std::endl;
    }
}
