//! Derivatives of user-defined functions of the state, by dual numbers.
//!
//! A state x begins with a position q of nq numbers. A step δ changes the state to x ⊕ δ: its first nv numbers move q
//! in the tangent space, and its other numbers are added to the other numbers of x (velocity, effort, …). So a state of
//! n numbers has n − nq + nv directions. The derivative of a function f is the derivative of f(x ⊕ δ) with respect to
//! δ, at δ = 0.
//!
//! A function written for any scalar can be evaluated for eight or four directions at once, in vector registers
//! ([`LaneJacobian`]). A dual number carries one direction, and a hyper-dual number carries two (Fike and Alonso, *The
//! development of hyper-dual numbers for exact second-derivative calculations*, 2011). Derivatives are exact and cost
//! one evaluation of f per direction or pair of directions. The analytical derivatives of this crate's own algorithms
//! are many times faster.

use crate::data::Data;
use crate::workspace::{Narrow, Wide};
use alloc::boxed::Box;
use alloc::vec::Vec;
use condyle_linalg::check;
use condyle_model::Model;
use condyle_model::integrate;
use condyle_spatial::block::Block;
use condyle_spatial::lane_dual::LaneDual;
use condyle_spatial::level::{Level, level};
use condyle_spatial::simd::Kernel;
use condyle_spatial::{Constant, Scalar};
use nalgebra::{DMatrix, DVector};
use num_dual::{Dual64, HyperDual64};

/// Returns x ⊕ δ, where the numbers of δ have a dual part.
fn moved<S: Scalar, R>(model: &Model<R>, x: &[f64], delta: &[S]) -> Vec<S> {
    let mut out: Vec<S> = x.iter().map(|&x| S::splat(x)).collect();
    let (q, rest) = out.split_at_mut(model.nq());
    let here = q.to_vec();
    integrate(model, &here, &delta[..model.nv()], q);
    rest.iter_mut().zip(&delta[model.nv()..]).for_each(|(x, &d)| *x += d);
    out
}

/// Returns the number of directions of a state.
#[track_caller]
fn directions<R>(model: &Model<R>, x: &[f64]) -> usize {
    assert!(x.len() >= model.nq(), "x: expected at least {} numbers, found {}", model.nq(), x.len());
    x.len() - model.nq() + model.nv()
}

/// Computes f(x) and its exact Jacobian ∂f(x ⊕ δ)/∂δ, in one evaluation of f per direction.
///
/// x: n numbers, the first nq of which are a position. δ has n − nq + nv numbers. Returns the m numbers of f(x), and
/// the m × (n − nq + nv) matrix of the Jacobian.
///
/// ```
/// use condyle_dynamics::{Data, forward_kinematics, jacobian, robots};
/// let arm = robots::arm7();
/// let (tool, mut data) = (arm.frame("tool")?, Data::new(&arm));
/// let (p, J) = jacobian(&arm, &[0.3; 7], |q| {
///     forward_kinematics(&arm, &mut data, q).frame(tool).translation.to_array().to_vec()
/// });
/// assert_eq!((p.len(), J.shape()), (3, (3, 7)));
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// Panics if x has fewer than nq numbers, or two evaluations of f give different numbers of results.
#[track_caller]
pub fn jacobian<R>(
    model: &Model<R>,
    x: &[f64],
    mut f: impl FnMut(&[Dual64]) -> Vec<Dual64>,
) -> (DVector<f64>, DMatrix<f64>) {
    let n = directions(model, x);
    let mut delta = vec![Dual64::from(0.0); n];
    let value = f(&moved(model, x, &delta));
    let mut J = DMatrix::zeros(value.len(), n);
    for k in 0..n {
        delta[k].eps = 1.0;
        let along = f(&moved(model, x, &delta));
        delta[k].eps = 0.0;
        assert!(along.len() == value.len(), "f: gave {} results, then {}", value.len(), along.len());
        J.column_mut(k).iter_mut().zip(&along).for_each(|(to, from)| *to = from.eps);
    }
    (DVector::from_iterator(value.len(), value.iter().map(|x| x.re)), J)
}

/// Function of a robot's state, written for any scalar type, so that [`LaneJacobian`] can differentiate it.
pub trait StateFunction {
    /// Returns the number of results.
    fn len(&self) -> usize;

    /// Returns whether the function has no results.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Computes f(x) and stores it in `y`. `data` is scratch for the algorithms, made for the robot with state x.
    fn call<S: Scalar>(&mut self, data: &mut Data<S>, x: &[S], y: &mut [S]);
}

/// Exact Jacobians of functions of one robot's state. One evaluation of f computes the derivatives along eight
/// (AVX-512) or four (AVX2, NEON, SIMD128) directions, whereas [`jacobian`] computes one direction. Apart from f, a
/// call allocates nothing.
///
/// The last digits of results differ between SIMD levels ([`level`](mod@crate::level)).
///
/// ```
/// use condyle_dynamics::{Data, LaneJacobian, Model, Scalar, StateFunction, forward_kinematics, robots};
///
/// /// Where the tool is.
/// struct Tool<'m>(&'m Model);
///
/// impl StateFunction for Tool<'_> {
///     fn len(&self) -> usize { 3 }
///     fn call<S: Scalar>(&mut self, data: &mut Data<S>, q: &[S], p: &mut [S]) {
///         let tool = self.0.frame("tool").expect("an arm has a tool");
///         p.copy_from_slice(&forward_kinematics(self.0, data, q).frame(tool).translation.to_array());
///     }
/// }
///
/// let arm = robots::arm7();
/// let mut by_lanes = LaneJacobian::new(&arm, 7, 3);
/// let (p, J) = by_lanes.of(&arm, &[0.3; 7], &mut Tool(&arm));
/// assert_eq!((p.len(), J.shape()), (3, (3, 7)));
/// ```
#[derive(Debug)]
pub struct LaneJacobian {
    width: Width,
    value: DVector<f64>,
    J: DMatrix<f64>,
}

#[derive(Debug)]
enum Width {
    Wide(Box<Directions<Wide>>),
    Narrow(Box<Directions<Narrow>>),
    One(Box<Directions<f64>>),
}

impl LaneJacobian {
    /// Allocates memory for states of n numbers, the first nq of which are a position, and for functions with `results`
    /// results. Uses the SIMD level that is current at this call.
    ///
    /// # Panics
    /// Panics if n is less than nq.
    #[track_caller]
    pub fn new<R: 'static>(model: &Model<R>, n: usize, results: usize) -> Self {
        assert!(n >= model.nq(), "n: expected at least {}, found {n}", model.nq());
        let width = match level() {
            Level::Avx512 => Width::Wide(Box::new(Directions::new(model, n, results))),
            Level::Simd128 | Level::Neon | Level::Avx2 => Width::Narrow(Box::new(Directions::new(model, n, results))),
            Level::Baseline => Width::One(Box::new(Directions::new(model, n, results))),
        };
        Self { width, value: DVector::zeros(results), J: DMatrix::zeros(results, n - model.nq() + model.nv()) }
    }

    /// Computes f(x), m numbers, and the Jacobian ∂f(x ⊕ δ)/∂δ. x has n numbers, the first nq of which are a position.
    /// δ has n − nq + nv numbers: nv numbers that move the position, and one for each other number of x. So the
    /// Jacobian is m × (n − nq + nv).
    ///
    /// # Panics
    /// Panics if the number of entries of x or of results of f differs from the number given to [`new`](Self::new), or
    /// if the robot is not the robot given to `new`.
    #[track_caller]
    pub fn of<R: Constant<f64>>(
        &mut self,
        model: &Model<R>,
        x: &[f64],
        f: &mut impl StateFunction,
    ) -> (&DVector<f64>, &DMatrix<f64>) {
        self.run(model, x, f, None)
    }

    /// Computes f(x) and the columns of its Jacobian whose indices are in `directions`. Column k is the derivative
    /// along entry k of δ. The other columns are not overwritten: a column is zero until a call computes it.
    ///
    /// ```
    /// # use condyle_dynamics::{Data, LaneJacobian, Scalar, StateFunction, robots};
    /// struct Square;
    /// impl StateFunction for Square {
    ///     fn len(&self) -> usize { 1 }
    ///     fn call<S: Scalar>(&mut self, _: &mut Data<S>, q: &[S], y: &mut [S]) { y[0] = q[0] * q[0] + q[1]; }
    /// }
    /// let arm = robots::arm7();
    /// let mut by_lanes = LaneJacobian::new(&arm, 7, 1);
    /// let (_, J) = by_lanes.along(&arm, &[3.0; 7], &mut Square, &[0]);
    /// assert_eq!((J[0], J[1]), (6.0, 0.0));
    /// ```
    ///
    /// # Panics
    /// Panics in the same cases as [`of`](Self::of), or if a direction is not below the number of entries of δ.
    #[track_caller]
    pub fn along<R: Constant<f64>>(
        &mut self,
        model: &Model<R>,
        x: &[f64],
        f: &mut impl StateFunction,
        directions: &[usize],
    ) -> (&DVector<f64>, &DMatrix<f64>) {
        let n = self.J.ncols();
        if let Some(&k) = directions.iter().find(|&&k| k >= n) {
            panic!("directions: found {k}, expected less than {n}");
        }
        self.run(model, x, f, Some(directions))
    }

    #[track_caller]
    fn run<R: Constant<f64>>(
        &mut self,
        model: &Model<R>,
        x: &[f64],
        f: &mut impl StateFunction,
        columns: Option<&[usize]>,
    ) -> (&DVector<f64>, &DMatrix<f64>) {
        let Self { width, value, J } = self;
        assert!(f.len() == value.len(), "f: expected {} results, found {}", value.len(), f.len());
        match width {
            Width::Wide(d) => d.run(model, x, f, columns, value, J),
            Width::Narrow(d) => d.run(model, x, f, columns, value, J),
            Width::One(d) => d.run(model, x, f, columns, value, J),
        }
        (value, J)
    }
}

/// Scratch of a `LaneJacobian`: each lane of S computes one direction.
#[derive(Debug)]
struct Directions<S> {
    data: Data<LaneDual<S>>,
    /// Step δ. Shape: number of directions.
    delta: Vec<LaneDual<S>>,
    /// State x (`x`), and the state x ⊕ δ (`moved`).
    x: Vec<LaneDual<S>>,
    moved: Vec<LaneDual<S>>,
    y: Vec<LaneDual<S>>,
}

impl<S: Block<Number = f64>> Directions<S> {
    fn new<R: 'static>(model: &Model<R>, n: usize, results: usize) -> Self {
        let zeros = |n: usize| vec![LaneDual::<S>::zero(); n];
        let data = Data::new(model);
        Self { data, delta: zeros(n - model.nq() + model.nv()), x: zeros(n), moved: zeros(n), y: zeros(results) }
    }

    #[track_caller]
    fn run<R: Constant<f64>>(
        &mut self,
        model: &Model<R>,
        x: &[f64],
        f: &mut impl StateFunction,
        columns: Option<&[usize]>,
        value: &mut DVector<f64>,
        J: &mut DMatrix<f64>,
    ) {
        self.data.check(model);
        check("x", x.len(), self.x.len());
        S::enter(SideBySide { directions: self, model, x, f, columns, value, J });
    }
}

/// Jacobian to compute: a function, a state, and the memory for results.
struct SideBySide<'a, S, R, F> {
    directions: &'a mut Directions<S>,
    model: &'a Model<R>,
    x: &'a [f64],
    f: &'a mut F,
    /// Columns to compute; `None` for all.
    columns: Option<&'a [usize]>,
    value: &'a mut DVector<f64>,
    J: &'a mut DMatrix<f64>,
}

/// Maximum number of lanes.
const WIDEST: usize = 8;

impl<S: Block<Number = f64>, R, F: StateFunction> Kernel for SideBySide<'_, S, R, F> {
    #[inline(always)]
    fn run(self) {
        let Self { directions: Directions { data, delta, x: from, moved, y }, model, x, f, columns, value, J } = self;
        let (n, nq, nv) = (columns.map_or(delta.len(), <[usize]>::len), model.nq(), model.nv());
        let column = |k: usize| columns.map_or(k, |columns| columns[k]);
        for (to, &x) in from.iter_mut().zip(x) {
            *to = LaneDual::splat(x);
        }
        let mut first = 0;
        while first == 0 || first < n {
            let count = S::LANES.min(n - first);
            for k in 0..count {
                let mut direction = [0.0; WIDEST];
                direction[k] = 1.0;
                delta[column(first + k)].eps = S::load(&direction);
            }
            integrate(model, &from[..nq], &delta[..nv], &mut moved[..nq]);
            for k in nq..from.len() {
                moved[k] = from[k] + delta[k - nq + nv];
            }
            f.call(data, moved, y);
            for (row, y) in y.iter().enumerate() {
                let (mut re, mut eps) = ([0.0; WIDEST], [0.0; WIDEST]);
                y.re.store(&mut re);
                y.eps.store(&mut eps);
                value[row] = re[0];
                for k in 0..count {
                    J[(row, column(first + k))] = eps[k];
                }
            }
            for k in 0..count {
                delta[column(first + k)].eps = S::zero();
            }
            first += S::LANES;
        }
    }
}

/// Computes f(x) and its exact gradient ∂f(x ⊕ δ)/∂δ, in one evaluation of f per direction.
///
/// x: n numbers, the first nq of which are a position. Returns f(x), and the gradient, one number for each of the n −
/// nq + nv entries of δ.
///
/// ```
/// use condyle_dynamics::{Data, gradient, rnea, robots};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let (q, v, a) = ([0.3; 7], [0.1; 7], [0.2; 7]);
/// // what the motors heat up by, as a function of position, velocity and acceleration
/// let (heat, by_all) = gradient(&arm, &[q, v, a].concat(), |x| {
///     rnea(&arm, &mut data, &x[..7], &x[7..14], &x[14..], &[]).iter().map(|&tau| tau * tau).sum()
/// });
/// assert!(heat > 0.0);
/// assert_eq!(by_all.len(), 21);
/// ```
///
/// # Panics
/// Panics if x has fewer than nq numbers.
#[track_caller]
pub fn gradient<R>(model: &Model<R>, x: &[f64], mut f: impl FnMut(&[Dual64]) -> Dual64) -> (f64, DVector<f64>) {
    let (value, J) = jacobian(model, x, |x| vec![f(x)]);
    (value[0], J.row(0).transpose())
}

/// Computes f(x), its exact gradient and its exact Hessian ∂²f(x ⊕ δ)/∂δ∂δ, in one evaluation of f per pair of
/// directions.
///
/// x: n numbers, the first nq of which are a position. Returns f(x), the d = n − nq + nv numbers of the gradient, and
/// the d × d Hessian.
///
/// ```
/// use condyle_dynamics::{Data, forward_kinematics, hessian, robots, static_torque_derivative};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let (_, g, stiffness) = hessian(&arm, &[0.3; 7], |q| forward_kinematics(&arm, &mut data, q).potential_energy());
/// let mut data = Data::new(&arm);
/// assert!((stiffness - static_torque_derivative(&arm, &mut data, &[0.3; 7], &[])).amax() < 1e-12);
/// assert_eq!(g.len(), 7);
/// ```
///
/// # Panics
/// Panics if x has fewer than nq numbers.
#[track_caller]
pub fn hessian<R>(
    model: &Model<R>,
    x: &[f64],
    mut f: impl FnMut(&[HyperDual64]) -> HyperDual64,
) -> (f64, DVector<f64>, DMatrix<f64>) {
    let n = directions(model, x);
    let mut delta = vec![HyperDual64::from(0.0); n];
    let mut value = f(&moved(model, x, &delta)).re;
    let (mut g, mut H) = (DVector::zeros(n), DMatrix::zeros(n, n));
    for j in 0..n {
        delta[j].eps1 = 1.0;
        for k in 0..=j {
            delta[k].eps2 = 1.0;
            let along = f(&moved(model, x, &delta));
            delta[k].eps2 = 0.0;
            (value, g[j]) = (along.re, along.eps1);
            (H[(j, k)], H[(k, j)]) = (along.eps1eps2, along.eps1eps2);
        }
        delta[j].eps1 = 0.0;
    }
    (value, g, H)
}
