//! Optimal control problem over a horizon of knots.

mod evaluation;
mod knots;

use super::action::ActionModel;
use super::action_view::{ActionView, Actions};
use super::group::innermost;
use super::models::{Models, check, reserve, share};
use super::shape::Shape;
use super::threads::Copies;
use crate::error::{Error, assert_length};
use crate::lq::LqKnot;
use std::any::Any;
use std::ops::Range;

/// Optimal control problem in discrete time, with N knots and a terminal knot:
///
/// ```text
/// minimise   ℓ_N(x_N) + Σₜ ℓₜ(xₜ, uₜ)      subject to   x₀ = x̂₀,   xₜ₊₁ = φₜ(xₜ, uₜ),   t = 0 … N − 1
/// ```
///
/// A problem contains action models, and for each knot the index of its model. Consecutive knots with the same model
/// are evaluated as one group. Models of a robot that differ only in costs, references and weights belong to the same
/// group. One model per knot therefore takes no more time than one model for all knots. All models have the same nx and
/// ndx; nu may differ from model to model.
///
/// Trajectories are flat: `xs` contains x₀ … x_N one after the other, (N + 1)·nx entries. `us` contains u₀ … u_{N−1},
/// each with the nu entries of its knot.
///
/// # Examples
/// ```
/// use condyle_optimal::{ActionModel, LqKnot, Problem};
///
/// /// x⁺ = x + u, ℓ = ½ (x² + u²); as a terminal action (nu = 0): ℓ = ½ x².
/// struct Integrator { nu: usize }
/// impl ActionModel for Integrator {
///     fn nx(&self) -> usize { 1 }
///     fn nu(&self) -> usize { self.nu }
///     fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
///         let u: f64 = u.iter().sum();
///         next[0] = x[0] + u;
///         0.5 * (x[0] * x[0] + u * u)
///     }
///     fn calc_diff(&mut self, _: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
///         (knot.A[0], knot.Q[0], knot.q[0]) = (1.0, 1.0, x[0]);
///         knot.B.fill(1.0);
///         knot.S.fill(0.0);
///         knot.R.fill(1.0);
///         knot.r.copy_from_slice(u);
///     }
/// }
///
/// let models: Vec<Box<dyn ActionModel>> = vec![Box::new(Integrator { nu: 1 })];
/// let mut problem = Problem::new(vec![2.0], models, vec![0; 3], Box::new(Integrator { nu: 0 }))?;
/// assert_eq!(problem.rollout(&[1.0, 0.0, -1.0])?, [2.0, 3.0, 3.0, 2.0]);
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
pub struct Problem {
    x0: Vec<f64>,
    models: Models,
    knot_models: Vec<usize>,
    terminal: Box<dyn ActionModel>,
    shape: Shape,
    /// Runs of consecutive knots with the same action, as long as possible: (index of the action, knots).
    runs: Vec<(usize, Range<usize>)>,
    /// Indices 0, 1, …, N of the knots. A group passes a slice of this vector as its indices.
    knots: Vec<usize>,
    /// Copies of the models, for other threads.
    copies: Copies,
    /// Output buffer for the next state of the terminal action, which is never read.
    unread: Vec<f64>,
    /// Scratch of predictions.
    scratch: Vec<f64>,
    /// Number of calls that may have changed the problem.
    revision: u64,
}

impl Problem {
    /// Creates a problem that starts at x̂₀. Knot t has the model `models[knot_models[t]]`, t = 0 … N − 1, and the
    /// terminal knot has the model `terminal`.
    ///
    /// # Errors
    /// [`Error`] if
    /// - the horizon or the state is empty, an index in `knot_models` has no model, or nx or ndx differ between models,
    /// - the terminal model has controls, or a model that has [no next state](ActionModel::is_terminal) serves a knot,
    /// - x̂₀ has a wrong length, has an entry that is not finite, or is an invalid state,
    /// - a state or the controls of a knot have more than 4096 entries, or
    /// - there are more than 2²⁰ knots, or the matrices \[A B\] of all knots have more than 2²⁸ entries.
    pub fn new(
        x0: Vec<f64>,
        models: Vec<Box<dyn ActionModel>>,
        knot_models: Vec<usize>,
        mut terminal: Box<dyn ActionModel>,
    ) -> Result<Self, Error> {
        let (nx, ndx, horizon) = (terminal.nx(), terminal.ndx(), knot_models.len());
        check(&models, &knot_models, &*terminal)?;
        Error::check("x0", &x0, nx)?;
        terminal.check_state(&x0).map_err(|what| Error::State { name: "x0", knot: 0, what })?;
        let shape = Shape { nx, ndx, offsets: Vec::with_capacity(horizon + 1) };
        let (runs, knots) = (Vec::with_capacity(horizon), (0..=horizon).collect());
        let (models, copies, unread) = (Models::new(models), Copies::default(), vec![0.0; nx]);
        share(&*models.actions[0], &mut *terminal);
        reserve(&mut *terminal);
        let (scratch, revision) = (Vec::new(), 0);
        let mut problem =
            Self { x0, models, knot_models, terminal, shape, runs, knots, copies, unread, scratch, revision };
        problem.arrange();
        Ok(problem)
    }

    /// Computes the offsets of the controls, and the runs of consecutive knots with the same action, from
    /// `knot_models`.
    fn arrange(&mut self) {
        self.mark_changed();
        let Self { models, knot_models, shape: Shape { offsets, .. }, runs, copies, .. } = self;
        runs.clear();
        offsets.clear();
        offsets.push(0);
        for (knot, &index) in knot_models.iter().enumerate() {
            let [action, own] = models.place(index);
            if let Some(group) = models.actions[action].knot_group_mut() {
                group.serve(knot, knot_models.len(), own);
            }
            copies.serve(action, knot, knot_models.len(), own);
            offsets.push(offsets[knot] + models.actions[action].nu());
            match runs.last_mut() {
                Some((last, knots)) if *last == action => knots.end = knot + 1,
                _ => runs.push((action, knot..knot + 1)),
            }
        }
    }

    /// Moves the horizon by one knot, as model predictive control (MPC) does after each step. Knot t becomes knot t − 1
    /// and keeps the costs and limits that belong to this single knot. The new last knot has the model `last`, with the
    /// costs that this model has for all knots. The models are [notified](ActionModel::shift) of the shift and of the
    /// new indices of their knots. Allocates nothing.
    ///
    /// The solver's trajectory is moved by [`Fddp::shift`](crate::Fddp::shift).
    ///
    /// # Errors
    /// [`Error::UnknownModel`] if the model does not exist, [`Error::NoNextState`] if the model may serve only the
    /// terminal knot. The problem is then unchanged.
    pub fn shift(&mut self, last: usize) -> Result<(), Error> {
        let horizon = self.horizon();
        if last >= self.models.len() {
            return Err(Error::UnknownModel { knot: horizon - 1, index: last, models: self.models.len() });
        }
        if self.models.of(last).is_terminal() {
            return Err(Error::NoNextState { knot: horizon - 1, index: last });
        }
        self.knot_models.rotate_left(1);
        self.knot_models[horizon - 1] = last;
        self.models.actions.iter_mut().for_each(|action| action.shift());
        self.copies.shift();
        self.arrange();
        Ok(())
    }

    /// Replaces the model of knot t, as model predictive control does when a contact begins earlier than planned. The
    /// solver can continue without changes, and its next iterations do not allocate. This function allocates. If an
    /// earlier call gave a model to knot t, that model is dropped. The models given to [`new`](Self::new) are kept for
    /// [`shift`](Self::shift).
    ///
    /// If the model has costs and limits for a single knot, these keep the index of that knot.
    ///
    /// # Errors
    /// [`Error::Dimension`] if nx, ndx or nu differ from the sizes of the old model, [`Error::NoNextState`] for a
    /// terminal model; the problem is then unchanged.
    ///
    /// # Panics
    /// If t ≥ N.
    #[track_caller]
    pub fn set_knot(&mut self, t: usize, model: Box<dyn ActionModel>) -> Result<(), Error> {
        self.assert_running(t);
        let Self { models, knot_models, shape, copies, .. } = self;
        let sizes = [("nx", shape.nx, model.nx()), ("ndx", shape.ndx, model.ndx()), ("nu", shape.nu(t), model.nu())];
        for (name, expected, found) in sizes {
            if expected != found {
                return Err(Error::Dimension { knot: t, name, expected, found });
            }
        }
        if model.is_terminal() {
            return Err(Error::NoNextState { knot: t, index: models.len() });
        }
        let uses = |index: usize| knot_models.iter().enumerate().any(|(knot, own)| *own == index && knot != t);
        let unused = models.added().find(|&index| !uses(index));
        knot_models[t] = models.add(model, unused);
        copies.forget(models.place(knot_models[t])[0]);
        self.arrange();
        Ok(())
    }

    /// Sets the duration Δt (s) of knot t. The model of knot t keeps its duration at all other knots. The solver's next
    /// iterations do not allocate.
    ///
    /// # Errors
    /// [`Error::TimeStep`] if Δt is not above 0, [`Error::NoDuration`] if the knot has no duration; the problem is then
    /// unchanged.
    ///
    /// # Panics
    /// If t ≥ N.
    #[track_caller]
    pub fn set_duration(&mut self, t: usize, dt: f64) -> Result<(), Error> {
        self.assert_running(t);
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(Error::TimeStep { dt });
        }
        let index = self.knot_models[t];
        match self.chosen(index).and_then(innermost).is_some_and(|group| group.set_duration(t, dt)) {
            true => Ok(()),
            false => Err(Error::NoDuration { knot: t }),
        }
    }

    /// Returns the duration (s) of knot t of a robot, 0 for an impact. Returns `None` for an action without a duration,
    /// such as a user-defined one.
    ///
    /// # Panics
    /// If t ≥ N.
    #[track_caller]
    pub fn duration(&self, t: usize) -> Option<f64> {
        self.assert_running(t);
        self.action(t).knot_group()?.duration(t)
    }

    /// Returns the index of the model of each knot. Models added by [`set_knot`](Self::set_knot) have the indices after
    /// the models with which the problem was created.
    pub fn knot_models(&self) -> &[usize] {
        &self.knot_models
    }

    /// Returns the number N of knots before the terminal one.
    pub fn horizon(&self) -> usize {
        self.knot_models.len()
    }

    /// Returns the number of entries of a state.
    pub fn nx(&self) -> usize {
        self.shape.nx
    }

    /// Returns the number of entries of a change of state.
    pub fn ndx(&self) -> usize {
        self.shape.ndx
    }

    /// Returns the number of controls of knot t; 0 for the terminal knot, t = N.
    ///
    /// # Panics
    /// If t > N.
    #[track_caller]
    pub fn nu(&self, t: usize) -> usize {
        self.assert_knot(t);
        self.shape.nu(t)
    }

    /// Returns the index range of uₜ in the flat controls.
    ///
    /// # Panics
    /// If t > N.
    #[track_caller]
    pub fn control_range(&self, t: usize) -> Range<usize> {
        self.assert_knot(t);
        self.shape.u(t)
    }

    /// Returns the initial state x̂₀.
    pub fn x0(&self) -> &[f64] {
        &self.x0
    }

    /// Sets the initial state, as model predictive control does before each solve.
    ///
    /// # Errors
    /// [`Error`] if the length of `x0` is not nx, an entry is not finite, or the state is invalid; the old state is
    /// then kept.
    pub fn set_x0(&mut self, x0: &[f64]) -> Result<(), Error> {
        self.check_x0(x0)?;
        self.mark_changed();
        self.x0.copy_from_slice(x0);
        Ok(())
    }

    /// Returns `Ok` if the state may be an initial state.
    pub(crate) fn check_x0(&self, x0: &[f64]) -> Result<(), Error> {
        Error::check("x0", x0, self.nx())?;
        self.terminal.check_state(x0).map_err(|what| Error::State { name: "x0", knot: 0, what })
    }

    /// Returns the action model `index` as a `T`, so that a reference can be changed between solves. Returns `None` if
    /// the model does not exist or has another type. The dimensions of the model must not change. If one action
    /// represents several models, only this model is changed.
    pub fn model_mut<T: ActionModel>(&mut self, index: usize) -> Option<&mut T> {
        let model: &mut dyn Any = self.chosen(index)?;
        model.downcast_mut()
    }

    /// Returns the action that represents model `index`. Later changes of the action affect only this model.
    pub(crate) fn chosen(&mut self, index: usize) -> Option<&mut dyn ActionModel> {
        self.mark_changed();
        if index < self.models.len() {
            self.copies.forget(self.models.place(index)[0]);
        }
        self.models.chosen(index)
    }

    /// Calls `visit` for the action of knot t, then for the copies of this action that other threads use, if `visit`
    /// returns no error. Later changes of these actions affect only the model of knot t. If `visit` changes all in the
    /// same way, the copies stay equal to the action.
    pub(crate) fn each_action_of<E>(
        &mut self,
        t: usize,
        visit: &mut dyn FnMut(&mut dyn ActionModel) -> Result<(), E>,
    ) -> Result<(), E> {
        self.mark_changed();
        let Some(&index) = self.knot_models.get(t) else { return visit(&mut *self.terminal) };
        let [action, own] = self.models.place(index);
        visit(self.models.chosen(index).expect("a knot has an existing model"))?;
        self.copies.each_of(action, own, visit)
    }

    /// Calls `visit` for each action, the terminal one last, and for the copies that other threads use, until `visit`
    /// returns an error.
    pub(crate) fn each_action<E>(
        &mut self,
        visit: &mut dyn FnMut(&mut dyn ActionModel) -> Result<(), E>,
    ) -> Result<(), E> {
        self.mark_changed();
        for (k, action) in self.models.actions.iter_mut().enumerate() {
            visit(&mut **action)?;
            self.copies.each_of(k, 0, visit)?;
        }
        visit(&mut *self.terminal)
    }

    /// Calls `visit` for each action, the terminal one last, until `visit` returns an error. Copies that other threads
    /// use are dropped.
    pub(crate) fn each_own_action<E>(
        &mut self,
        visit: &mut dyn FnMut(&mut dyn ActionModel) -> Result<(), E>,
    ) -> Result<(), E> {
        (0..self.models.actions.len()).for_each(|k| self.copies.forget(k));
        self.each_action(visit)
    }

    /// Makes all actions share their scratch memory, and allocates it.
    pub(crate) fn share_scratch(&mut self) {
        self.models.share();
        share(&*self.models.actions[0], &mut *self.terminal);
        self.models.actions.iter_mut().for_each(|action| reserve(&mut **action));
        reserve(&mut *self.terminal);
    }

    /// Counts a call that may change the problem.
    pub(crate) fn mark_changed(&mut self) {
        self.revision += 1;
    }

    /// Returns the number of calls that may have changed the problem. If the number is the same as before, so is the
    /// problem, except for actions of one's own that change by themselves.
    #[doc(hidden)]
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Returns the number of models.
    pub(crate) fn model_count(&self) -> usize {
        self.models.len()
    }

    /// Copies the problem, with all current costs, limits, references and weights, so that another thread can solve the
    /// copy. The copies share the robot's [`Model`](condyle_dynamics::Model) and the user-defined functions. Allocates.
    ///
    /// A problem does not implement [`Clone`], because a user-defined action can be copied only if its
    /// [`try_clone`](ActionModel::try_clone) returns a copy. All actions of this crate can be copied, except
    /// [`NumDiff`](crate::NumDiff). [`AutoDiff`](crate::AutoDiff) and [`Constrained`](crate::Constrained) can be copied
    /// if the actions and constraints in them can be copied.
    ///
    /// # Errors
    /// [`Error::NoCopy`] for an action that cannot be copied.
    pub fn try_clone(&self) -> Result<Self, Error> {
        self.copy(None)
    }

    /// Copies the problem as [`try_clone`](Self::try_clone) does. The copy uses scratch memory of `other`, which the
    /// same thread must use.
    pub(crate) fn try_clone_beside(&self, other: &Self) -> Result<Self, Error> {
        self.copy(Some(&*other.models.actions[0]))
    }

    fn copy(&self, beside: Option<&dyn ActionModel>) -> Result<Self, Error> {
        let Self { x0, models, knot_models, terminal, shape, runs: own_runs, knots, unread, .. } = self;
        let (x0, knot_models, shape) = (x0.clone(), knot_models.clone(), shape.clone());
        let models = models.try_clone(beside)?;
        let mut terminal = terminal.try_clone().ok_or(Error::NoCopy { model: None })?;
        share(&*models.actions[0], &mut *terminal);
        reserve(&mut *terminal);
        let mut runs = Vec::with_capacity(knot_models.len()); // `shift` may need this capacity and must not allocate
        runs.extend_from_slice(own_runs);
        let (knots, unread, copies) = (knots.clone(), unread.clone(), Copies::default());
        let (scratch, revision) = (Vec::new(), 0);
        Ok(Self { x0, models, knot_models, terminal, shape, runs, knots, copies, unread, scratch, revision })
    }

    /// Returns the terminal model as a `T`, if it has that type.
    pub fn terminal_mut<T: ActionModel>(&mut self) -> Option<&mut T> {
        self.mark_changed();
        let model: &mut dyn Any = self.terminal.as_mut();
        model.downcast_mut()
    }

    /// Computes the difference x₁ ⊖ x₀ of two states into `out` (ndx).
    ///
    /// # Panics
    /// If a length is wrong.
    #[track_caller]
    pub fn difference(&self, x0: &[f64], x1: &[f64], out: &mut [f64]) {
        for (name, found, expected) in
            [("x0", x0.len(), self.nx()), ("x1", x1.len(), self.nx()), ("out", out.len(), self.ndx())]
        {
            assert_length(name, found, expected);
        }
        self.terminal.difference(x0, x1, out);
    }

    /// Creates LQ knots of zeros with the dimensions of this problem's knots, the terminal knot last.
    pub fn lq_knots(&self) -> Vec<LqKnot> {
        (0..=self.horizon()).map(|t| LqKnot::zeros(self.ndx(), self.shape.nu(t))).collect()
    }

    /// Returns the maximum length of a knot's motion: the accelerations and forces that a rollout stores for the
    /// derivatives.
    pub(crate) fn motion_size(&self) -> usize {
        self.inverse_dynamics().map(|(size, _)| size).max().unwrap_or(0)
    }

    /// Returns the sizes of the equations of inverse dynamics, for all actions that support these equations.
    fn inverse_dynamics(&self) -> impl Iterator<Item = (usize, [usize; 2])> {
        self.models.actions.iter().filter_map(|action| action.knot_group()?.inverse_dynamics())
    }

    /// Allocates memory in LQ knots for the equations of inverse dynamics. The memory suffices for any order of the
    /// actions in the horizon. Returns whether an action supports these equations.
    pub(crate) fn reserve_inverse_dynamics(&self, lq_knots: &mut [LqKnot]) -> bool {
        let sizes = self.inverse_dynamics().map(|(_, sizes)| sizes);
        let Some(most) = sizes.reduce(|a, b| [a[0].max(b[0]), a[1].max(b[1])]) else { return false };
        let (nv, horizon) = (self.ndx() / 2, self.horizon());
        for knot in &mut lq_knots[..horizon] {
            let nu = knot.nu();
            knot.inverse_dynamics.reserve(nv, nu, most);
        }
        true
    }

    pub(crate) fn shape(&self) -> &Shape {
        &self.shape
    }

    /// Returns scratch memory that keeps its size between calls.
    pub(crate) fn scratch(&mut self) -> &mut Vec<f64> {
        &mut self.scratch
    }

    /// Returns the model of knot t; for t = N, the terminal model.
    pub(crate) fn action(&self, t: usize) -> &dyn ActionModel {
        self.knot_models.get(t).map_or(&*self.terminal, |&model| self.models.of(model))
    }

    /// Returns the model of knot t, as a mutable reference for evaluations.
    pub(crate) fn action_mut(&mut self, t: usize) -> &mut dyn ActionModel {
        self.knot_models.get(t).map_or(&mut *self.terminal, |&model| self.models.of_mut(model))
    }

    /// Returns the actions of all knots.
    pub(crate) fn action_view(&mut self) -> ActionView<'_> {
        let Self { x0, models, knot_models, terminal, .. } = self;
        let (actions, places) = models.parts();
        ActionView { x0, knot_models, places, actions: Actions::Own(actions, &mut **terminal) }
    }

    /// Returns two views of the actions, for two threads: the actions of all knots, and copies of all actions except
    /// the terminal one. The copies compute the same results. Returns `None` if an action cannot be copied, or no
    /// copies exist yet.
    pub(crate) fn two(&mut self) -> Option<[ActionView<'_>; 2]> {
        let Self { x0, models, knot_models, terminal, copies, .. } = self;
        let copies = copies.first().filter(|copies| copies.iter().all(Option::is_some))?;
        let (actions, places) = models.parts();
        let with = |actions| ActionView { x0, knot_models, places, actions };
        Some([with(Actions::Own(actions, &mut **terminal)), with(Actions::Copied(copies))])
    }

    /// Returns whether the controls of any knot are bounded.
    ///
    /// # Errors
    /// [`Error`] if the bounds of a knot have a wrong length or no control satisfies them.
    pub(crate) fn check_bounds(&self) -> Result<bool, Error> {
        let mut bounded = false;
        for knot in 0..self.horizon() {
            let Some((lower, upper)) = self.action(knot).bounds(knot) else { continue };
            let expected = self.shape.nu(knot);
            for (name, found) in [("lower bounds", lower.len()), ("upper bounds", upper.len())] {
                if found != expected {
                    return Err(Error::Dimension { knot, name, expected, found });
                }
            }
            for (control, (&lower, &upper)) in lower.iter().zip(upper).enumerate() {
                // the negated condition is true for NaN, so NaN is an error
                if !(lower <= upper && lower < f64::INFINITY && upper > f64::NEG_INFINITY) {
                    return Err(Error::Bounds { knot, control, lower, upper });
                }
                bounded |= lower.is_finite() || upper.is_finite();
            }
        }
        Ok(bounded)
    }

    /// Returns whether each knot of both problems can be computed in one batch: the problems have the same shape, and
    /// differ only in durations, weights, targets, bounds, and targets of contacts. Actions without groups are always
    /// computed one by one.
    pub(crate) fn matches(&self, other: &Self) -> bool {
        let knot_matches = |t: usize| match (self.action(t).knot_group(), other.action(t).knot_group()) {
            (Some(own), Some(_)) => own.matches(other.action(t), t),
            (None, None) => true,
            _ => false,
        };
        self.shape.check(&other.shape).is_ok() && (0..=self.horizon()).all(knot_matches)
    }

    /// Returns the largest number of lanes among all models.
    pub(crate) fn lanes(&self) -> usize {
        self.models.lanes.iter().copied().max().unwrap_or(1)
    }

    /// Panics if t > N.
    #[track_caller]
    pub(crate) fn assert_knot(&self, t: usize) {
        assert!(t <= self.horizon(), "`t` is {t}, expected at most the horizon {}", self.horizon());
    }

    /// Panics if t ≥ N.
    #[track_caller]
    fn assert_running(&self, t: usize) {
        assert!(t < self.horizon(), "`t` is {t}, expected less than the horizon {}", self.horizon());
    }
}

impl std::fmt::Debug for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Problem")
            .field("x0", &self.x0)
            .field("models", &self.models.len())
            .field("knot_models", &self.knot_models)
            .field("shape", &self.shape)
            .finish()
    }
}
