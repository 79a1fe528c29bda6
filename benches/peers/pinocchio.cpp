// Times single calls of Pinocchio, compiled for this processor. The script dynamics.py builds and runs this program.
//
//     pinocchio MODEL STATES
//
// MODEL is an archive written by Pinocchio's Python package. STATES is a file with q, v, a, τ of one state after the
// other, as 64-bit floating-point numbers. The program prints a line for each algorithm: its name and the median time
// of a call in ns. If Pinocchio offers an algorithm in two conventions, the program prints the time of the faster
// convention. The file is compiled once for each PART, because a single translation unit would take too much memory.
#include <pinocchio/multibody.hpp>
#if PART == 0
#include <pinocchio/serialization.hpp>
#elif PART == 1
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#elif PART == 2
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#elif PART == 3
#include <pinocchio/algorithm/aba-derivatives.hpp>
#endif
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <vector>

struct State {
  Eigen::VectorXd q, v, a, tau;
};

// Returns the median, over all series of calls, of the mean time of a call (ns).
template <class Call> double median(const std::vector<State> &states, Call call) {
  using Clock = std::chrono::steady_clock;
  auto batch = [&](long calls) {
    auto start = Clock::now();
    for (long i = 0; i < calls; ++i) {
      call(states[i % states.size()]);
      asm volatile("" ::: "memory");
    }
    return std::chrono::duration<double, std::nano>(Clock::now() - start).count() / calls;
  };
  batch(200);
  const long calls = std::max(10L, long(2e6 / batch(50)));
  std::vector<double> times(21);
  for (double &time : times)
    time = batch(calls);
  std::nth_element(times.begin(), times.begin() + 10, times.end());
  return times[10];
}

using Model = pinocchio::Model;
using Data = pinocchio::Data;
void part1(const Model &, Data &, const std::vector<State> &);
void part2(const Model &, Data &, const std::vector<State> &);
void part3(const Model &, Data &, const std::vector<State> &);

static void print(const char *name, double ns) {
  std::printf("%s %.2f\n", name, ns);
  std::fflush(stdout);
}

#if PART == 0
int main(int argc, char **argv) {
  if (argc != 3)
    return std::fprintf(stderr, "usage: pinocchio MODEL STATES\n"), 2;
  Model model;
  model.loadFromBinary(std::string(argv[1]));
  std::ifstream file(argv[2], std::ios::binary);
  std::vector<char> bytes((std::istreambuf_iterator<char>(file)), {});
  const double *next = reinterpret_cast<const double *>(bytes.data());
  std::vector<State> states(bytes.size() / sizeof(double) / (model.nq + 3 * model.nv));
  auto take = [&](int n) { return next += n, Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(next - n, n)); };
  for (State &s : states)
    s.q = take(model.nq), s.v = take(model.nv), s.a = take(model.nv), s.tau = take(model.nv);
  Data data(model);
  part1(model, data, states);
  part2(model, data, states);
  part3(model, data, states);
}
#elif PART == 1
void part1(const Model &model, Data &data, const std::vector<State> &states) {
  using pinocchio::Convention;
  print("rnea", median(states, [&](const State &s) { pinocchio::rnea(model, data, s.q, s.v, s.a); }));
  double local = median(states, [&](const State &s) { pinocchio::aba(model, data, s.q, s.v, s.tau, Convention::LOCAL); });
  double world = median(states, [&](const State &s) { pinocchio::aba(model, data, s.q, s.v, s.tau, Convention::WORLD); });
  print("aba", std::min(local, world));
  local = median(states, [&](const State &s) { pinocchio::crba(model, data, s.q, Convention::LOCAL); });
  world = median(states, [&](const State &s) { pinocchio::crba(model, data, s.q, Convention::WORLD); });
  print("crba", std::min(local, world));
  print("minv", median(states, [&](const State &s) { pinocchio::computeMinverse(model, data, s.q); }));
}
#elif PART == 2
void part2(const Model &model, Data &data, const std::vector<State> &states) {
  print("rnea_derivatives",
        median(states, [&](const State &s) { pinocchio::computeRNEADerivatives(model, data, s.q, s.v, s.a); }));
}
#elif PART == 3
void part3(const Model &model, Data &data, const std::vector<State> &states) {
  print("aba_derivatives",
        median(states, [&](const State &s) { pinocchio::computeABADerivatives(model, data, s.q, s.v, s.tau); }));
}
#endif
