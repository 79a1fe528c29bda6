//! User-defined residuals that are generic over the scalar type. Dual numbers compute their exact Jacobians.

use super::own::{Inputs, OwnResidual, ResidualFunction};
use condyle_dynamics::{
    Data, LaneJacobian, Model, Placements, StateFunction, Velocities, forward_kinematics, forward_velocities,
};
use condyle_spatial::Scalar;
use std::any::Any;
use std::sync::{Arc, Mutex, PoisonError};

/// Residual r(t, x, u) of a robot, generic over the [`Scalar`] type, so that [`OwnResidual::autodiff`] can
/// differentiate it.
///
/// Mark `calc` with `#[inline(always)]`. The compiler then compiles `calc` for the SIMD level at which the Jacobian is
/// computed.
pub trait GenericResidual: Any + Send + Sync {
    /// Returns the number of entries of r.
    fn size(&self) -> usize;

    /// Returns the arguments on which r depends; the default is all arguments. The result must not change. Columns of
    /// the Jacobian for other arguments are zero and are not computed, which saves time.
    fn inputs(&self) -> Inputs {
        Inputs::ALL
    }

    /// Computes r at a knot into `r`, which has [`size`](Self::size) entries.
    fn calc<S: Scalar>(&self, state: &mut RobotState<'_, S>, r: &mut [S]);
}

/// State and controls of a robot at a knot, generic over the scalar type, with the kinematics of this state.
#[derive(Debug)]
pub struct RobotState<'a, S> {
    /// Robot.
    pub model: &'a Model,
    /// Index of the knot.
    pub t: usize,
    /// Position, nq entries.
    pub q: &'a [S],
    /// Velocity, nv entries.
    pub v: &'a [S],
    /// Controls of the knot, nu entries; none at the terminal knot and at an impact.
    pub u: &'a [S],
    data: &'a mut Data<S>,
    /// Whether `data` contains the placements at q.
    placed: bool,
}

impl<'a, S: Scalar> RobotState<'a, S> {
    /// Creates the state of knot t from x = (q, v) and u.
    fn new(model: &'a Model, data: &'a mut Data<S>, t: usize, x: &'a [S], u: &'a [S]) -> Self {
        let (q, v) = x.split_at(model.nq());
        Self { model, t, q, v, u, data, placed: false }
    }

    /// Returns the placements of all bodies and frames at q. The first call computes the placements; later calls return
    /// the stored ones.
    pub fn placements(&mut self) -> Placements<'_, S> {
        if !self.placed {
            forward_kinematics(self.model, self.data, self.q);
            self.placed = true;
        }
        self.data.placements(self.model).expect("bodies were just placed")
    }

    /// Computes the placements and velocities of all bodies and frames at (q, v). The result contains both, so a
    /// residual needs only one call.
    pub fn velocities(&mut self) -> Velocities<'_, S> {
        self.placed = true;
        forward_velocities(self.model, self.data, self.q, self.v)
    }

    /// Returns the workspace of the robot's algorithms, for calls of algorithms other than kinematics.
    pub fn data(&mut self) -> &mut Data<S> {
        self.placed = false;
        self.data
    }
}

impl OwnResidual {
    /// Creates a residual from a function that is generic over the scalar type. Dual numbers compute its exact
    /// Jacobian, in the tangent space of the state. One evaluation in SIMD registers (AVX2, NEON, SIMD128 or AVX-512)
    /// computes four or eight columns. The Hessian of a cost of this residual is the Gauss–Newton approximation.
    ///
    /// Copies of the residual share the function. Each call uses a workspace that no other thread uses. A new workspace
    /// is allocated only if all existing workspaces are in use.
    ///
    /// ```
    /// use condyle_dynamics::robots;
    /// use condyle_optimal::robot::{GenericResidual, Inputs, OwnResidual, Residual, RobotState};
    /// use condyle_spatial::Scalar;
    /// use std::sync::Arc;
    ///
    /// /// The height of the tool above a slope: r = z − 0.1 x.
    /// struct Height { tool: usize }
    /// impl GenericResidual for Height {
    ///     fn size(&self) -> usize { 1 }
    ///     fn inputs(&self) -> Inputs { Inputs::POSITIONS }
    ///     #[inline(always)]
    ///     fn calc<S: Scalar>(&self, state: &mut RobotState<'_, S>, r: &mut [S]) {
    ///         let p = state.placements().frame(self.tool).translation;
    ///         r[0] = p.z - p.x * S::splat(0.1);
    ///     }
    /// }
    ///
    /// let arm = Arc::new(robots::arm7());
    /// let tool = arm.frame("tool")?;
    /// let height = Residual::Own(OwnResidual::autodiff(arm, Height { tool }));
    /// # Ok::<(), condyle_dynamics::Error>(())
    /// ```
    pub fn autodiff(model: Arc<Model>, function: impl GenericResidual) -> Self {
        Self::new(Differentiated { model, function, idle: Mutex::new(Vec::new()) })
    }
}

/// Generic residual, with the workspaces for its evaluation.
struct Differentiated<F> {
    model: Arc<Model>,
    function: F,
    /// Workspaces that no thread uses at the moment.
    idle: Mutex<Vec<Scratch>>,
}

/// Workspace of one thread, for knots with nu controls.
struct Scratch {
    nu: usize,
    data: Box<Data<f64>>,
    /// Vector (q, v, u). Written by: `calc_diff`.
    state: Vec<f64>,
    jacobian: LaneJacobian,
    /// Indices of the computed columns of the Jacobian with respect to (δq, δv, δu).
    columns: Vec<usize>,
}

impl Scratch {
    fn new(model: &Model, nu: usize, size: usize, inputs: Inputs) -> Self {
        let (n, nv) = (model.nq() + model.nv() + nu, model.nv());
        let Inputs { positions, velocities, controls } = inputs;
        let parts = [(positions, 0..nv), (velocities, nv..2 * nv), (controls, 2 * nv..2 * nv + nu)];
        let columns = parts.into_iter().filter(|(wanted, _)| *wanted).flat_map(|(_, columns)| columns).collect();
        let jacobian = LaneJacobian::new(model, n, size);
        Self { nu, data: Box::new(Data::new(model)), state: vec![0.0; n], jacobian, columns }
    }
}

impl<F: GenericResidual> Differentiated<F> {
    /// Calls `f` with a workspace for nu controls that no other thread uses.
    fn with_scratch<T>(&self, nu: usize, f: impl FnOnce(&mut Scratch) -> T) -> T {
        let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let found = idle.iter().position(|scratch| scratch.nu == nu).map(|k| idle.swap_remove(k));
        drop(idle);
        let make = || Scratch::new(&self.model, nu, self.function.size(), self.function.inputs());
        let mut scratch = found.unwrap_or_else(make);
        let result = f(&mut scratch);
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).push(scratch);
        result
    }
}

/// Generic residual at a fixed knot, as a function of the vector (q, v, u).
struct AtKnot<'a, F> {
    model: &'a Model,
    function: &'a F,
    t: usize,
}

impl<F: GenericResidual> StateFunction for AtKnot<'_, F> {
    fn len(&self) -> usize {
        self.function.size()
    }

    #[inline(always)]
    fn call<S: Scalar>(&mut self, data: &mut Data<S>, x: &[S], r: &mut [S]) {
        let (x, u) = x.split_at(self.model.nq() + self.model.nv());
        self.function.calc(&mut RobotState::new(self.model, data, self.t, x, u), r);
    }
}

impl<F: GenericResidual> ResidualFunction for Differentiated<F> {
    fn size(&self) -> usize {
        self.function.size()
    }

    fn inputs(&self) -> Inputs {
        self.function.inputs()
    }

    fn check(&self, model: &Model, nu: usize) -> Result<(), String> {
        let (found, expected) = ([model.nq(), model.nv()], [self.model.nq(), self.model.nv()]);
        if found != expected {
            let [[nq, nv], [own_nq, own_nv]] = [found, expected];
            return Err(format!("it is of a robot of nq = {own_nq}, nv = {own_nv}; this one has nq = {nq}, nv = {nv}"));
        }
        self.with_scratch(nu, |_| ()); // allocates a workspace, so that the first solve does not allocate one
        Ok(())
    }

    fn calc(&self, t: usize, x: &[f64], u: &[f64], r: &mut [f64]) {
        self.with_scratch(u.len(), |scratch| {
            self.function.calc(&mut RobotState::new(&self.model, &mut scratch.data, t, x, u), r);
        });
    }

    fn calc_diff(&self, t: usize, x: &[f64], u: &[f64], by_x: &mut [f64], by_u: &mut [f64]) {
        let Self { model, function, .. } = self;
        self.with_scratch(u.len(), |Scratch { state, jacobian, columns, .. }| {
            state[..x.len()].copy_from_slice(x);
            state[x.len()..].copy_from_slice(u);
            let (_, J) = jacobian.along(model, state, &mut AtKnot { model, function, t }, columns);
            let ndx = 2 * model.nv();
            for (k, column) in J.column_iter().enumerate() {
                let (to, width, k) = if k < ndx { (&mut *by_x, ndx, k) } else { (&mut *by_u, u.len(), k - ndx) };
                to.iter_mut().skip(k).step_by(width).zip(&column).for_each(|(to, slope)| *to = *slope);
            }
        });
    }
}
