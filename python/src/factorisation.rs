//! Factors of the inertia matrix, and forward dynamics by divide and conquer: one Python type for each type of the
//! library.

use crate::arrays::{Give, class, matrix, vector};
use crate::exceptions::within;
use crate::functions::{Argument, Forces, Position, Tangent, regular, rows};
use crate::made_for::MadeFor;
use crate::model::Model;
use crate::signals::{self, Signals};
use nalgebra::DMatrix;
use pyo3::exceptions::{PyIndexError, PyRuntimeError};
use pyo3::prelude::*;

/// Defines the class of a factor of a matrix. The macro writes the methods that all such classes have. The constructor
/// and the methods of only one class are arguments of the macro.
macro_rules! factor {
    ($(#[$doc:meta])* $class:ident { $($own:tt)* }) => {
        $(#[$doc])*
        #[pyclass(module = "condyle")]
        pub(crate) struct $class {
            inner: condyle::dynamics::$class<f64>,
            size: usize,
            /// Whether `factorize` has computed the factor.
            done: bool,
        }

        impl $class {
            fn factor(&self) -> PyResult<&condyle::dynamics::$class<f64>> {
                let nothing = || PyRuntimeError::new_err("nothing to solve with: call `factorize` first");
                self.done.then_some(&self.inner).ok_or_else(nothing)
            }
        }

        #[pymethods]
        impl $class {
            $($own)*

            /// Returns the class and the size of M.
            fn __repr__(&self) -> String {
                format!("<condyle.{} of a matrix ({n}, {n})>", stringify!($class), n = self.size)
            }

            /// Computes the factor of M, a symmetric positive definite matrix. The docstring of the class states the
            /// cost.
            ///
            /// M is not checked: if M is not positive definite, solutions are wrong or not finite. An exception of a
            /// signal handler, such as KeyboardInterrupt, stops the computation between rows. After that no factor is
            /// available.
            fn factorize(&mut self, M: &Bound<'_, PyAny>) -> PyResult<()> {
                let (py, M) = (M.py(), matrix("M", M, [self.size, self.size])?.to_matrix());
                self.done = false;
                let (inner, mut signals) = (&mut self.inner, Signals::new(signals::SHORT));
                let done = py.detach(|| inner.factorize_while(&M, || signals.go_on().is_continue()));
                signals.finish()?;
                self.done = done;
                Ok(())
            }

            /// Solves M x = b; returns x, one number for each row of M.
            ///
            /// b: one number for each row of M.
            #[pyo3(signature = (b, out=None))]
            fn solve<'py>(
                &self,
                b: &Bound<'py, PyAny>,
                out: Option<&Bound<'py, PyAny>>,
            ) -> PyResult<Bound<'py, PyAny>> {
                let factor = self.factor()?;
                let mut x = vector("b", b, self.size)?.to_vec();
                factor.solve(&mut x);
                x.give(b.py(), out)
            }

            /// Solves M X = B; returns X, column by column.
            ///
            /// B: a matrix with as many rows as M.
            #[pyo3(signature = (B, out=None))]
            fn solve_matrix<'py>(
                &self,
                B: &Bound<'py, PyAny>,
                out: Option<&Bound<'py, PyAny>>,
            ) -> PyResult<Bound<'py, PyAny>> {
                let (py, factor, mut X) = (B.py(), self.factor()?, rows::<f64>("B", B, self.size)?);
                let mut signals = Signals::new(signals::SHORT);
                py.detach(|| {
                    for column in X.as_mut_slice().chunks_exact_mut(self.size.max(1)) {
                        if signals.go_on().is_break() {
                            return;
                        }
                        factor.solve(column);
                    }
                });
                signals.finish()?;
                X.give(py, out)
            }

            /// Returns the inverse M⁻¹, both triangles filled.
            #[pyo3(signature = (out=None))]
            fn inverse<'py>(
                &self,
                py: Python<'py>,
                out: Option<&Bound<'py, PyAny>>,
            ) -> PyResult<Bound<'py, PyAny>> {
                let (factor, mut X) = (self.factor()?, DMatrix::zeros(self.size, self.size));
                let mut signals = Signals::new(signals::SHORT);
                py.detach(|| factor.inverse_while(&mut X, || signals.go_on().is_continue()));
                signals.finish()?;
                X.give(py, out)
            }
        }
    };
}

factor! {
/// A factor M = Lᵀ D L of a robot's inertia matrix: L is unit lower triangular with the zeros of the tree, D is
/// diagonal.
///
/// With n = nv and the depth d of the tree (the largest number of columns on a path to the root), `factorize` costs O(n
/// d²), `solve` O(n d), `inverse` O(n² d). For a chain, d = n. Source: Featherstone, Efficient factorization of the
/// joint-space inertia matrix for branched kinematic trees (2005).
///
/// model: the robot whose tree defines the zeros of M.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> M = condyle.crba(quadruped, condyle.Data(quadruped), condyle.neutral(quadruped))
/// >>> factor = condyle.Ltdl(quadruped)
/// >>> factor.factorize(M)
/// >>> np.allclose(M @ factor.solve(np.ones(18)), 1.0)
/// True
/// >>> factor.nonzeros  # the base, and three joints of each leg: not 171
/// 117
Ltdl {
    #[new]
    fn new(model: &Bound<'_, Model>) -> Self {
        let model = &*model.get().inner;
        Self { inner: condyle::factors::Ltdl::new(model), size: model.nv(), done: false }
    }

    /// The number of entries of L and D that may differ from zero. The diagonal of L, which is one, is not counted.
    #[getter]
    fn nonzeros(&self) -> usize {
        self.inner.nonzeros()
    }

    /// The coordinates in order from the root to the tips; the factorisation eliminates them in reverse order.
    ///
    /// The order is 0, 1, 2, and so on, unless joints share coordinates.
    #[getter]
    fn order(&self) -> Vec<usize> {
        self.inner.order().to_vec()
    }

    /// Returns the off-diagonal entries of row k of L, from the diagonal to the root, as (index, value). Rows and
    /// columns are numbered as in `order`.
    fn row(&self, k: usize) -> PyResult<Vec<(usize, f64)>> {
        if k >= self.size {
            return Err(PyIndexError::new_err(format!("k: expected less than {}, found {k}", self.size)));
        }
        Ok(self.factor()?.row(k).collect())
    }

    /// The diagonal D, in the `order` of the coordinates.
    #[getter]
    fn diagonal<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.factor()?.diagonal().collect::<Vec<_>>().give(py, None)
    }
}
}

factor! {
/// The factor M = L Lᵀ of any symmetric positive definite matrix.
///
/// `factorize` and `inverse` cost O(n³), `solve` O(n²). For the inertia matrix of a robot, use `Ltdl`, which has the
/// same methods and skips the zeros of the tree. Source: Golub and Van Loan, Matrix Computations (4th edition),
/// algorithm 4.2.1.
///
/// n: the number of rows of M, at most 4096.
///
/// >>> factor = condyle.Cholesky(2)
/// >>> factor.factorize([[4.0, 2.0], [2.0, 5.0]])
/// >>> factor.solve([8.0, 12.0])
/// array([1., 2.])
Cholesky {
    #[new]
    fn new(n: usize) -> PyResult<Self> {
        within("n", n, 0, condyle::factors::Cholesky::<f64>::MOST_ROWS)?;
        Ok(Self { inner: condyle::factors::Cholesky::new(n), size: n, done: false })
    }

    /// The factor L, lower triangular.
    #[getter]
    fn lower<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.factor()?.lower().lower_triangle().give(py, None)
    }
}
}

/// Forward dynamics by the divide-and-conquer articulated-body algorithm: the plan for one model, and scratch memory.
///
/// The robot is assembled from runs: groups of at most `grain` adjacent bodies, which are eliminated one after the
/// other. With `grain` = 1 the algorithm takes O(log n) steps for n bodies. But joining two parts of the robot costs
/// about six times as much as eliminating a body. With two threads and two runs, the algorithm is faster than `aba`
/// from about 200 bodies on. With one thread it is always slower. For a robot with mimic joints, the passes run once
/// with all joints free, and once more for each joint that shares a coordinate. The results are bit-identical for any
/// number of threads. Source: Featherstone, A divide-and-conquer articulated-body algorithm for parallel O(log(n))
/// calculation of rigid-body dynamics (1999).
///
/// model: the robot; grain: the maximum number of bodies in a run.
///
/// >>> arm = condyle.robots.arm7()
/// >>> divided = condyle.DivideConquer(arm, grain=1)
/// >>> q, v, tau = [0.3] * 7, [0.1] * 7, [1.0] * 7
/// >>> np.allclose(divided.aba(arm, q, v, tau), condyle.aba(arm, condyle.Data(arm), q, v, tau))
/// True
/// >>> divided.size
/// AssemblySize(bodies=7, runs=7, longest_run=1, joins=6, gathers=0, depth=4)
#[pyclass(module = "condyle")]
pub(crate) struct DivideConquer {
    inner: condyle::divide_conquer::DivideConquer<f64>,
    made_for: MadeFor,
}

#[pymethods]
impl DivideConquer {
    #[new]
    fn new(model: &Bound<'_, Model>, grain: usize) -> Self {
        let model = model.get();
        Self {
            inner: condyle::divide_conquer::DivideConquer::new(&model.inner, grain),
            made_for: MadeFor::with_geometry(model),
        }
    }

    /// Returns the robot's name, and the numbers of bodies and runs.
    fn __repr__(&self) -> String {
        let size = self.inner.size();
        format!("<condyle.DivideConquer of '{}': {} bodies in {} runs>", self.made_for.name, size.bodies, size.runs)
    }

    /// The numbers of operations of the assembly, and the number of steps that must be computed one after the other, as
    /// `AssemblySize`.
    #[getter]
    fn size<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let s = self.inner.size();
        let numbers = (s.bodies, s.runs, s.longest_run, s.joins, s.gathers, s.depth);
        class!(py, "AssemblySize")?.call1(numbers)
    }

    /// Computes the acceleration q̈, nv numbers, equal to the result of `aba` up to rounding. For n bodies, the work is
    /// O(n) and the number of steps O(log n + grain).
    ///
    /// model: the planned model, or another model with the same bodies and joints; q: position, nq numbers; v, tau:
    /// velocity and efforts, nv numbers each;
    /// f_ext: as for `rnea`.
    #[pyo3(signature = (model, q, v, tau, f_ext=None, out=None))]
    fn aba<'py>(
        &mut self,
        model: &Bound<'py, Model>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        tau: &Bound<'py, PyAny>,
        f_ext: Option<&Bound<'py, PyAny>>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.made_for.check("DivideConquer", model.get())?;
        let (py, model) = (model.py(), &model.get().inner);
        regular(model)?;
        let a = {
            let (q, v) = (Position::read("q", q, model)?, Tangent::read("v", v, model)?);
            let (tau, f_ext) = (Tangent::read("tau", tau, model)?, Forces::read("f_ext", f_ext, model)?);
            self.inner.aba(model, &q, &v, &tau, &f_ext)
        };
        a.give(py, out)
    }
}
