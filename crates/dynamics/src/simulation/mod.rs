//! Simulation of robots: each step computes (q, v) at the next instant. Positions are elements of the joints' Lie
//! groups.
//!
//! The position is q(t) = q₀ ⊕ ξ(t). The equations of motion are q̇ = v (in the body's frame) and v̇ = aba(q, v, τ).
//! One of three [`Integrator`]s computes the steps. A [`Simulation`] owns the state and all scratch.
//!
//! ```
//! use condyle_dynamics::{neutral, robots};
//! use condyle_dynamics::simulation::{Settings, Simulation};
//! let quadruped = robots::quadruped();
//! let mut simulation = Simulation::new(&quadruped, Settings::default());
//! simulation.set_state(&neutral(&quadruped), &[0.0; 18])?;
//! let status = simulation.run(100, |now| now.tau[8] = -0.5 * now.v[8]); // a control law, once per step
//! assert!(status.is_done());
//! assert!((simulation.q()[2] + 0.5 * 9.81 * 0.1f64.powi(2)).abs() < 2e-3); // the base has fallen ½ g t²
//! # Ok::<(), condyle_dynamics::Error>(())
//! ```
//!
//! With a [`Ground`], the robot can stand, slide, land and lift off. Joint limits are not enforced; a control law can
//! enforce them.

mod contact_solver;
mod contacts;
mod euler;
mod ground;
mod lagrangian;
mod lu;
mod runge_kutta;
mod state;
mod status;
mod tangent;
mod variational;

use crate::calls::forward_dynamics::aba;
use crate::data::{Data, check_forces};
use crate::passes::passive::passive_torque;
use crate::workspace::Size;
use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use condyle_linalg::check;
use condyle_model::{Error, Model};
use condyle_spatial::{Constant, Force, Scalar};
use core::any::Any;

pub use ground::{Ground, GroundContact, GroundPoint};
pub use state::State;
pub use status::Status;

/// Method that computes a step. τ and the external forces are constant during a step; an external force is constant in
/// the frame of the body on which it acts. [Passive torques](crate::passive_torque) change with position and velocity
/// during the step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Integrator {
    /// Semi-implicit Euler with the step length h: v' = v + h aba(q, v, τ), q' = q ⊕ h v'. Order 1, one evaluation of
    /// aba per step. If M is constant, the method is symplectic. Otherwise, the Coriolis forces are evaluated at the
    /// beginning of the step, and bodies that spin fast without damping gain energy. The energy of light links can grow
    /// without bound. Suitable for damped robots and short horizons.
    SemiImplicitEuler,
    /// Classical Runge–Kutta method for ξ̇ = J_log(ξ) v, v̇ = aba(q₀ ⊕ ξ, v, τ) (Munthe-Kaas, *Runge-Kutta methods on
    /// Lie groups*, 1998). Order 4, four evaluations of aba per step. The energy drifts by O(h⁴) per second.
    RungeKutta4,
    /// Variational integrator of the midpoint Lagrangian, solved by Newton's method with exact derivatives. Order 2,
    /// symmetric and symplectic: the energy oscillates by O(h²) without drift, and momentum is conserved up to
    /// rounding. If a velocity changes by a large multiple of its value, the equation of the step has no solution
    /// ([`Status::NotConverged`]). Source: Marsden and West, *Discrete mechanics and variational integrators*, 2001; on
    /// groups: Bou-Rabee and Marsden, *Hamilton–Pontryagin integrators on Lie groups*, 2009.
    Variational,
}

/// Integrator, step length and tolerances of a simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Settings {
    /// Integrator that computes the steps.
    pub integrator: Integrator,
    /// Length h of a step (s), above 0.
    pub dt: f64,
    /// Smoothing ε of [`passive_torque`](crate::passive_torque()) (rad/s, m/s). `None` switches off damping, friction,
    /// springs and gravity compensation of the joints.
    pub passive: Option<f64>,
    /// Tolerance of Newton's method: relative error of the momentum balance. When the error is below this tolerance,
    /// one last iteration follows, which squares the error.
    pub tolerance: f64,
    /// Maximum number of iterations of Newton's method.
    pub max_iterations: usize,
}

impl Default for Settings {
    /// Returns settings for semi-implicit Euler at 1 kHz, without passive torques, with a tolerance of 1e-9 and at most
    /// 20 iterations.
    fn default() -> Self {
        Self { integrator: Integrator::SemiImplicitEuler, dt: 1e-3, passive: None, tolerance: 1e-9, max_iterations: 20 }
    }
}

/// State that a control law reads before a step, and the efforts and forces that it sets.
#[derive(Debug)]
pub struct Control<'a, S> {
    /// Time at which the step begins (s).
    pub time: f64,
    /// Position, nq numbers.
    pub q: &'a [S],
    /// Velocity, nv numbers.
    pub v: &'a [S],
    /// Joint efforts during the step, nv numbers (N m, N). All efforts are 0 when the control law is called.
    pub tau: &'a mut [S],
    /// External force on each body during the step (N, N m), in the frame of the body and at the origin of this frame.
    /// Index 0 is the world. All forces are 0 when the control law is called.
    pub f_ext: &'a mut [Force<S>],
}

/// Efforts and forces that act during a step.
#[derive(Clone, Copy)]
struct Input<'a, S> {
    h: S,
    tau: &'a [S],
    f_ext: &'a [Force<S>],
    passive: Option<f64>,
}

/// State of a robot, and all memory to compute the next states. After [`new`](Self::new) and
/// [`set_ground`](Self::set_ground), nothing is allocated.
///
/// A simulation shares its model, so it may be stored, cloned and sent to another thread. If the scalar has several
/// lanes, each lane is a separate simulation, and Newton's method iterates until all lanes have converged. If the
/// scalar is a dual number, the simulation computes derivatives of its states. Only simulations of `f64` can have a
/// ground.
#[derive(Clone, Debug)]
pub struct Simulation<S: Scalar = f64, R = f64> {
    /// Integrator, step length and tolerances. They may be changed between steps.
    pub settings: Settings,
    model: Arc<Model<R>>,
    data: Data<S>,
    time: f64,
    q: Vec<S>,
    v: Vec<S>,
    /// State after the step that is being computed.
    q_next: Vec<S>,
    v_next: Vec<S>,
    /// Efforts and forces that the control law sets.
    tau: Vec<S>,
    f_ext: Vec<Force<S>>,
    euler: euler::Workspace<S>,
    runge_kutta: runge_kutta::Workspace<S>,
    variational: variational::Workspace<S>,
    ground: Option<Box<contacts::Contacts>>,
}

impl Simulation<f64> {
    /// Sets the ground; replaces the previous ground. A ground without points removes the previous ground.
    ///
    /// The state is kept, even if points are below the ground. Allocates memory for the contacts with the ground.
    ///
    /// # Errors
    /// Returns [`Error::Ground`] if the integrator is not [`SemiImplicitEuler`](Integrator::SemiImplicitEuler), a frame
    /// does not exist or is fixed to the world, or the normal does not define a direction. The same error is returned
    /// if the restitution is not in 0..=1, the friction or the tolerance is negative, or a number is not finite.
    pub fn set_ground(&mut self, ground: Ground) -> Result<(), Error> {
        if self.settings.integrator != Integrator::SemiImplicitEuler {
            let what =
                format!("it acts with the integrator SemiImplicitEuler only, found {:?}", self.settings.integrator);
            return Err(Error::Ground { what });
        }
        let contacts = contacts::Contacts::new(&self.model, ground)?;
        self.ground = (!contacts.ground.points.is_empty()).then(|| Box::new(contacts));
        Ok(())
    }

    /// Returns the ground; `None` if the simulation has no ground.
    pub fn ground(&self) -> Option<&Ground> {
        self.ground.as_ref().map(|contacts| &contacts.ground)
    }

    /// Returns the contact of each point with the ground in the last step, in the order of the points. Before the first
    /// step, no point touches.
    pub fn contacts(&self) -> &[GroundContact] {
        self.ground.as_ref().map_or(&[], |contacts| &contacts.results)
    }
}

impl<S: Scalar, R: Constant<S>> Simulation<S, R> {
    /// Allocates all memory and sets the robot to [`neutral`](crate::neutral), at rest, at time 0.
    ///
    /// model: an [`Arc`] of a model, which the simulation then shares; a model, which is moved; or a reference to a
    /// model, which is copied.
    pub fn new(model: impl Into<Arc<Model<R>>>, settings: Settings) -> Self {
        let model = model.into();
        let q: Vec<S> = crate::neutral(&model).into_iter().map(S::splat).collect();
        let (size, zero) = (Size::new(&model), vec![S::zero(); model.nv()]);
        Self {
            settings,
            data: Data::new(&model),
            time: 0.0,
            q_next: q.clone(),
            q,
            v: zero.clone(),
            v_next: zero.clone(),
            tau: zero,
            f_ext: vec![Force::zero(); model.nodes().len()],
            euler: euler::Workspace::new(size),
            runge_kutta: runge_kutta::Workspace::new(size),
            variational: variational::Workspace::new(size, &model),
            ground: None,
            model,
        }
    }

    /// Returns the robot's model.
    pub fn model(&self) -> &Arc<Model<R>> {
        &self.model
    }

    /// Returns the position, nq numbers.
    pub fn q(&self) -> &[S] {
        &self.q
    }

    /// Returns the velocity, nv numbers.
    pub fn v(&self) -> &[S] {
        &self.v
    }

    /// Returns the time since the state was set: the sum of all step lengths (s).
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Sets the position to q, the velocity to v and the time to 0. Allocates nothing.
    ///
    /// q: nq numbers; v: nv numbers. The numbers are checked only if the scalar is `f64`.
    ///
    /// # Errors
    /// Returns [`Error::Position`] if a number of q is not finite, or a quaternion or a pair (cos, sin) in q does not
    /// have length 1 up to 1e-3; [`Error::Velocity`] if a number of v is not finite. In this case, the old state is
    /// kept.
    ///
    /// # Panics
    /// Panics if an argument has the wrong length.
    #[track_caller]
    pub fn set_state(&mut self, q: &[S], v: &[S]) -> Result<(), Error> {
        check("q", q.len(), self.model.nq());
        check("v", v.len(), self.model.nv());
        self.q_next.copy_from_slice(q);
        self.v_next.copy_from_slice(v);
        let model = (&*self.model as &dyn Any).downcast_ref::<Model>();
        if let (Some(model), Some(q), Some(v)) = (model, doubles(&self.q_next), doubles(&self.v_next)) {
            model.check_state(q, v)?;
        }
        core::mem::swap(&mut self.q, &mut self.q_next);
        core::mem::swap(&mut self.v, &mut self.v_next);
        self.time = 0.0;
        if let Some(ground) = &mut self.ground {
            ground.reset();
        }
        Ok(())
    }

    /// Computes one step of length `settings.dt` under constant efforts and forces.
    ///
    /// tau: nv numbers (N m, N); f_ext: one force per body as in [`aba`](crate::aba()), or empty for none. For n
    /// bodies, the explicit integrators cost O(n). The variational integrator needs about three iterations, each of
    /// which costs O(n³). Allocates nothing.
    ///
    /// ```
    /// use condyle_dynamics::{robots, simulation::{Integrator, Settings, Simulation}};
    /// let settings = Settings { integrator: Integrator::Variational, ..Settings::default() };
    /// let mut simulation = Simulation::new(robots::arm7(), settings);
    /// assert!(simulation.step(&[0.1; 7], &[]).is_done());
    /// assert!(simulation.v().iter().any(|&v: &f64| v != 0.0));
    /// ```
    ///
    /// # Panics
    /// Panics if an argument has the wrong length, the smoothing of passive torques is not positive, or `settings.dt`
    /// is not a finite number above 0. The function also panics if the simulation has a ground and
    /// `settings.integrator` is not semi-implicit Euler.
    #[track_caller]
    pub fn step(&mut self, tau: &[S], f_ext: &[Force<S>]) -> Status {
        check("tau", tau.len(), self.model.nv());
        check_forces(f_ext.len(), self.model.nodes().len());
        let Settings { integrator, dt, passive, .. } = self.settings;
        assert!(dt > 0.0 && dt.is_finite(), "settings.dt: expected a finite number above 0, found {dt}");
        assert!(
            passive.is_none_or(|smoothing| smoothing > 0.0),
            "settings.passive: expected a smoothing above 0, found {passive:?}"
        );
        let input = Input { h: S::splat(dt), tau, f_ext, passive };
        let euler = integrator == Integrator::SemiImplicitEuler;
        assert!(
            euler || self.ground.is_none(),
            "settings.integrator: the ground acts with SemiImplicitEuler only, found {integrator:?}"
        );
        let (model, data, state) = (&*self.model, &mut self.data, (&self.q[..], &self.v[..]));
        let (q, v) = (&mut self.q_next, &mut self.v_next);
        let status = match integrator {
            Integrator::SemiImplicitEuler => {
                euler::velocity(model, data, &mut self.euler, input, state, v);
                let status = on_ground(self.ground.as_deref_mut(), (model, data), dt, (&self.q, &self.v), v);
                let correction = self.ground.as_ref().map_or(&[][..], |ground| &ground.correction);
                euler::position(model, &mut self.euler, input.h, (state.0, v, correction), q);
                status
            }
            Integrator::RungeKutta4 => runge_kutta::step(model, data, &mut self.runge_kutta, input, state, (q, v)),
            Integrator::Variational => {
                variational::step(model, data, &mut self.variational, &self.settings, input, state, (q, v))
            }
        };
        if !self.v_next.iter().chain(&self.q_next).all(|x| S::all(x.abs().lt(S::splat(f64::MAX)))) {
            return if status.is_taken() { Status::NotFinite } else { status };
        }
        if status.is_taken() {
            core::mem::swap(&mut self.q, &mut self.q_next);
            core::mem::swap(&mut self.v, &mut self.v_next);
            self.time += dt;
        }
        status
    }

    /// Computes several steps and calls a control law before each step. If a step fails, the function stops at this
    /// step and returns the status of this step. Otherwise, if a step reported
    /// [`ContactsNotConverged`](Status::ContactsNotConverged), the function returns this status with the largest error.
    ///
    /// Allocates nothing, unless the control law allocates.
    ///
    /// # Panics
    /// Panics in the same cases as [`step`](Self::step).
    #[track_caller]
    pub fn run(&mut self, steps: usize, mut control: impl FnMut(&mut Control<S>)) -> Status {
        let (mut tau, mut f_ext) = (core::mem::take(&mut self.tau), core::mem::take(&mut self.f_ext));
        let mut status = Status::Done;
        for _ in 0..steps {
            tau.fill(S::zero());
            f_ext.fill(Force::zero());
            control(&mut Control { time: self.time, q: &self.q, v: &self.v, tau: &mut tau, f_ext: &mut f_ext });
            let step = self.step(&tau, &f_ext);
            status = status.and(step);
            if !step.is_taken() {
                break;
            }
        }
        (self.tau, self.f_ext) = (tau, f_ext);
        status
    }
}

/// Returns the numbers of `x` if it is a vector of `f64`.
fn doubles(x: &dyn Any) -> Option<&[f64]> {
    x.downcast_ref::<Vec<f64>>().map(Vec::as_slice)
}

/// Replaces the velocity after a step without contacts by the velocity after a step with contacts. Only simulations of
/// `f64` can have a ground.
fn on_ground(
    ground: Option<&mut contacts::Contacts>,
    (model, data): (&dyn Any, &mut dyn Any),
    h: f64,
    (q, v): (&dyn Any, &dyn Any),
    v_next: &mut dyn Any,
) -> Status {
    let Some(ground) = ground else { return Status::Done };
    let (model, data, v_next) = (model.downcast_ref(), data.downcast_mut(), v_next.downcast_mut::<Vec<f64>>());
    match (model, data, doubles(q), doubles(v), v_next) {
        (Some(model), Some(data), Some(q), Some(v), Some(v_next)) => {
            (ground.step)(ground, model, data, h, (q, v), v_next)
        }
        _ => unreachable!("`set_ground` is a function of simulations of f64"),
    }
}

/// Returns the acceleration aba(q, v, τ + passive torque).
#[inline(always)]
#[track_caller]
fn acceleration<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    input: Input<S>,
    (q, v): (&[S], &[S]),
    effort: &mut [S],
) -> &'d [S] {
    match input.passive {
        None => aba(model, data, q, v, input.tau, input.f_ext),
        Some(smoothing) => {
            passive_torque(model, q, v, smoothing, effort);
            for (effort, &tau) in effort.iter_mut().zip(input.tau) {
                *effort += tau;
            }
            aba(model, data, q, v, effort, input.f_ext)
        }
    }
}
