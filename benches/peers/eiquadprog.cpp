// C function for eiquadprog's fast solver, which the library TSID uses. The script wholebody_theirs.py calls this
// function by ctypes.
#include <eiquadprog/eiquadprog-fast.hpp>

using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;

static eiquadprog::solvers::EiquadprogFast solver;

// Solves min ½ xᵀ P x + cᵀ x with A x + a = 0 and C x + b ≥ 0. Matrices are stored column by column. Returns 0 on
// success.
extern "C" int solve(int n, int equalities, int rows, const double *P, const double *c, const double *A,
                     const double *a, const double *C, const double *b, double *x) {
  static MatrixXd hessian, CE, CI;
  static VectorXd g0, ce0, ci0, solution;
  hessian = Map<const MatrixXd>(P, n, n);
  g0 = Map<const VectorXd>(c, n);
  CE = Map<const MatrixXd>(A, equalities, n);
  ce0 = Map<const VectorXd>(a, equalities);
  CI = Map<const MatrixXd>(C, rows, n);
  ci0 = Map<const VectorXd>(b, rows);
  solution.resize(n);
  solver.reset(n, equalities, rows);
  int status = solver.solve_quadprog(hessian, g0, CE, ce0, CI, ci0, solution);
  Map<VectorXd>(x, n) = solution;
  return status;
}
