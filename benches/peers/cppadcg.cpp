// Times one call of C code that CppADCodeGen generates from Pinocchio's algorithms. The script generated.py builds and
// runs this program.
//
//     cppadcg MODEL STATES FOLDER COMPILER FLAG…
//
// MODEL and STATES are the same as for pinocchio.cpp. The program writes C code to FOLDER, compiles the code, and
// prints a line for each algorithm: its name, the median time of a call in ns, and the seconds for generating and
// compiling. This file is compiled once for each PART.
#include <cppad/cg.hpp>
#include <pinocchio/codegen/cppadcg.hpp>
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
#include <functional>
#include <iterator>
#include <string>
#include <vector>

namespace cg = CppAD::cg;
using Recorded = CppAD::AD<cg::CG<double>>;
using Vector = Eigen::Matrix<Recorded, Eigen::Dynamic, 1>;
using Matrix = Eigen::Matrix<Recorded, Eigen::Dynamic, Eigen::Dynamic>;
using Model = pinocchio::ModelTpl<Recorded>;
using Data = pinocchio::DataTpl<Recorded>;
using Clock = std::chrono::steady_clock;

struct Task {
  const pinocchio::Model &model;
  const std::vector<std::vector<double>> &states; // each state: q, v, a, τ
  std::string folder, compiler;
  std::vector<std::string> flags;
};

void part1(const Task &), part2(const Task &), part3(const Task &);

static double seconds(Clock::time_point since) { return std::chrono::duration<double>(Clock::now() - since).count(); }

// Algorithm to be recorded and timed. Its arguments are the position q, the velocity v, and the acceleration a or the
// effort τ. It writes its results one after the other.
using Algorithm = std::function<void(const Model &, Data &, const Vector &, const Vector &, const Vector &, Vector &)>;
static void measure(const Task &task, const char *name, int outputs, bool takes_tau, const Algorithm &algorithm) {
  const auto start = Clock::now();
  const int nq = task.model.nq, nv = task.model.nv;
  const Model model = task.model.cast<Recorded>();
  Data data(model);
  Vector x = Vector::Zero(nq + 2 * nv), y = Vector::Zero(outputs);
  CppAD::Independent(x);
  algorithm(model, data, x.head(nq), x.segment(nq, nv), x.tail(nv), y);
  CppAD::ADFun<cg::CG<double>> function(x, y);
  function.optimize("no_compare_op");
  cg::ModelCSourceGen<double> source(function, name);
  cg::ModelLibraryCSourceGen<double> library(source);
  cg::DynamicModelLibraryProcessor<double> processor(library, task.folder + "/" + name);
  cg::GccCompiler<double> compiler(task.compiler);
  compiler.setCompileFlags(task.flags);
  compiler.setSourcesFolder(task.folder);
  compiler.setTemporaryFolder(task.folder);
  const auto loaded = processor.createDynamicLibrary(compiler);
  const auto code = loaded->model(name);
  const double took = seconds(start);

  std::vector<std::vector<double>> inputs;
  for (const auto &state : task.states) {
    inputs.emplace_back(state.begin(), state.begin() + nq + 2 * nv);
    if (takes_tau)
      std::copy_n(state.begin() + nq + 2 * nv, nv, inputs.back().begin() + nq + nv);
  }
  std::vector<double> results(outputs);
  auto batch = [&](long calls) {
    const auto begin = Clock::now();
    for (long i = 0; i < calls; ++i)
      code->ForwardZero(CppAD::cg::ArrayView<const double>(inputs[i % inputs.size()]), CppAD::cg::ArrayView<double>(results));
    return 1e9 * seconds(begin) / calls;
  };
  batch(200);
  const long calls = std::max(10L, long(2e6 / batch(50)));
  std::vector<double> times(21);
  for (double &time : times)
    time = batch(calls);
  std::nth_element(times.begin(), times.begin() + 10, times.end());
  std::printf("%s %.2f %.1f\n", name, times[10], took);
  std::fflush(stdout);
}

// Writes three square matrices one after the other. The last matrix is symmetric, and only its upper triangle is given.
static void put(Vector &y, const Matrix &dq, const Matrix &dv, Matrix &last) {
  last.template triangularView<Eigen::StrictlyLower>() = last.transpose();
  y << dq.reshaped(), dv.reshaped(), last.reshaped();
}

#if PART == 0
int main(int argc, char **argv) {
  if (argc < 6)
    return std::fprintf(stderr, "usage: cppadcg MODEL STATES FOLDER COMPILER FLAG…\n"), 2;
  pinocchio::Model model;
  model.loadFromBinary(std::string(argv[1]));
  std::ifstream file(argv[2], std::ios::binary);
  std::vector<char> bytes((std::istreambuf_iterator<char>(file)), {});
  const double *numbers = reinterpret_cast<const double *>(bytes.data());
  const std::size_t each = model.nq + 3 * model.nv;
  std::vector<std::vector<double>> states;
  for (std::size_t k = 0; (k + 1) * each * sizeof(double) <= bytes.size(); ++k)
    states.emplace_back(numbers + k * each, numbers + (k + 1) * each);
  const Task task{model, states, argv[3], argv[4], {argv + 5, argv + argc}};
  part1(task), part2(task), part3(task);
}
#elif PART == 1
void part1(const Task &task) {
  const int nv = task.model.nv;
  measure(task, "rnea", nv, false, [](auto &model, auto &data, auto &q, auto &v, auto &a, auto &y) {
    y = pinocchio::rnea(model, data, q, v, a);
  });
  measure(task, "aba", nv, true, [](auto &model, auto &data, auto &q, auto &v, auto &tau, auto &y) {
    y = pinocchio::aba(model, data, q, v, tau, pinocchio::Convention::LOCAL);
  });
  measure(task, "crba", nv * nv, false, [nv](auto &model, auto &data, auto &q, auto &, auto &, auto &y) {
    Matrix M = pinocchio::crba(model, data, q, pinocchio::Convention::LOCAL);
    M.template triangularView<Eigen::StrictlyLower>() = M.transpose();
    y = Eigen::Map<Vector>(M.data(), nv * nv);
  });
}
#elif PART == 2
void part2(const Task &task) {
  const int nv = task.model.nv;
  measure(task, "rnea_derivatives", 3 * nv * nv, false, [nv](auto &model, auto &data, auto &q, auto &v, auto &a, auto &y) {
    Matrix dq = Matrix::Zero(nv, nv), dv = Matrix::Zero(nv, nv), da = Matrix::Zero(nv, nv);
    pinocchio::computeRNEADerivatives(model, data, q, v, a, dq, dv, da);
    put(y, dq, dv, da);
  });
}
#elif PART == 3
void part3(const Task &task) {
  const int nv = task.model.nv;
  measure(task, "aba_derivatives", 3 * nv * nv, true, [nv](auto &model, auto &data, auto &q, auto &v, auto &tau, auto &y) {
    Matrix dq = Matrix::Zero(nv, nv), dv = Matrix::Zero(nv, nv), dtau = Matrix::Zero(nv, nv);
    pinocchio::computeABADerivatives(model, data, q, v, tau, dq, dv, dtau);
    put(y, dq, dv, dtau);
  });
}
#endif
