//! Adjoints of many solutions of one shape.

use super::adjoint::Adjoint;
use super::lanes::Group;
use super::{Sensitivity, wrong};
use crate::error::Error;
use crate::lq::DynamicsStructure;
use crate::problem::Shape;

/// Derivatives of many solutions, whose adjoint problems are solved several at a time in the lanes of SIMD registers.
///
/// The problems have the same numbers of knots, states and controls. Their solutions may have different controls at a
/// bound. The adjoint of a solution with active constraints is computed alone, because its method of multipliers takes
/// its own number of passes; [`in_lanes`](Self::in_lanes) returns the number of the others. The results equal the ones
/// of [`Sensitivity::adjoint`] up to rounding.
///
/// # Examples
/// ```
/// use condyle_optimal::{Fddp, LqKnot, Lqr, Problem, Sensitivities, Sensitivity, SensitivitySettings};
/// // problems x⁺ = x + u with the cost ½ (x² + w u²)
/// let sensitivity = |w: f64| -> Result<Sensitivity, condyle_optimal::Error> {
///     let (mut knot, mut end) = (LqKnot::zeros(1, 1), LqKnot::zeros(1, 0));
///     (knot.A[0], knot.B[0], knot.Q[0], knot.R[0], end.Q[0]) = (1.0, 1.0, 1.0, w, 1.0);
///     let (knot, end) = (Lqr::new(knot), Lqr::new(end));
///     let mut problem = Problem::new(vec![1.0], vec![Box::new(knot)], vec![0; 30], Box::new(end))?;
///     let solution = Fddp::new(&problem).solve(&mut problem, &[0.0; 31], &[0.0; 30])?.clone();
///     Sensitivity::new(&mut problem, &solution, None, SensitivitySettings::default())
/// };
/// let (mut first, second) = (sensitivity(1.0)?, sensitivity(2.0)?);
/// let mut both = Sensitivities::new([&first, &second])?;
/// both.adjoints(&[0.0; 2 * 31], &[1.0; 2 * 30])?; // the loss is the sum of all controls
/// let alone = first.adjoint(&[0.0; 31], &[1.0; 30])?;
/// assert!((both.adjoint(0).x0[0] - alone.x0[0]).abs() < 1e-12);
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Sensitivities {
    shape: Shape,
    members: Vec<Member>,
    groups: Vec<Group>,
}

/// Solution of the batch: the adjoint of one in a lane, or the sensitivity of one with active constraints.
#[derive(Debug, Clone)]
enum Member {
    InLane(Box<Adjoint>),
    Alone(Box<Sensitivity>),
}

impl Sensitivities {
    /// Creates a batch from sensitivities, in their order. The factors of each solution are copied. Allocates.
    ///
    /// # Errors
    /// [`Error::Sensitivity`] for an empty batch; [`Error::Length`] or [`Error::Dimension`] if a problem has another
    /// shape than the first one.
    pub fn new<'a>(of: impl IntoIterator<Item = &'a Sensitivity>) -> Result<Self, Error> {
        let mut of = of.into_iter();
        let first = of.next().ok_or_else(|| wrong("the batch is empty, expected at least one sensitivity"))?;
        let mut this = Self { shape: first.point.shape.clone(), members: Vec::new(), groups: Vec::new() };
        this.add(first)?;
        of.try_for_each(|one| this.add(one))?;
        Ok(this)
    }

    /// Adds a sensitivity at the end of the batch. Allocates.
    ///
    /// # Errors
    /// [`Error::Length`] or [`Error::Dimension`] if the problem has another shape than the first one.
    pub fn add(&mut self, one: &Sensitivity) -> Result<(), Error> {
        let Sensitivity { point, system, .. } = one;
        self.shape.check(&point.shape)?;
        if point.has_rows() {
            self.members.push(Member::Alone(Box::new(one.clone())));
            return Ok(());
        }
        let structures: Vec<&DynamicsStructure> = point.knots.iter().map(|knot| &knot.structure).collect();
        let index = self.members.len();
        if !self.groups.iter_mut().any(|group| group.add(index, system.factors(), &structures)) {
            let mut group = Group::new(system.factors(), &structures, &self.shape);
            group.add(index, system.factors(), &structures);
            self.groups.push(group);
        }
        self.members.push(Member::InLane(Box::new(Adjoint::new(point))));
        Ok(())
    }

    /// Returns the number of solutions.
    #[allow(clippy::len_without_is_empty)] // a batch is never empty
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// Returns the number of solutions whose adjoints are computed in lanes. The others have active constraints.
    pub fn in_lanes(&self) -> usize {
        self.groups.iter().map(|group| group.members.len()).sum()
    }

    /// Solves the adjoint problem of each solution for the gradients of its loss. `by_states` contains the gradients
    /// with respect to the states of the first problem, then of the second one: (N + 1) · ndx numbers for each.
    /// `by_controls` contains the gradients with respect to the controls in the same order.
    ///
    /// # Errors
    /// [`Error::Length`] or [`Error::NotFinite`] for a wrong argument; [`Error::Sensitivity`] if the active constraints
    /// of a problem contradict each other.
    pub fn adjoints(&mut self, by_states: &[f64], by_controls: &[f64]) -> Result<(), Error> {
        let Self { shape, members, groups } = self;
        let (states, controls) = ((shape.horizon() + 1) * shape.ndx, shape.offsets[shape.horizon()]);
        Error::check("by_states", by_states, members.len() * states)?;
        Error::check("by_controls", by_controls, members.len() * controls)?;
        let by_states = |i: usize| &by_states[i * states..][..states];
        let by_controls = |i: usize| &by_controls[i * controls..][..controls];
        for (i, member) in members.iter_mut().enumerate() {
            if let Member::Alone(sensitivity) = member {
                sensitivity.adjoint(by_states(i), by_controls(i))?;
            }
        }
        let mut free: Vec<Option<&mut Adjoint>> = members.iter_mut().map(Member::in_lane).collect();
        for group in groups {
            let indices = group.members.clone();
            let mut adjoints: Vec<&mut Adjoint> = indices.iter().filter_map(|&i| free[i].take()).collect();
            let rows: [Vec<&[f64]>; 2] =
                [indices.iter().map(|&i| by_states(i)).collect(), indices.iter().map(|&i| by_controls(i)).collect()];
            let held = adjoints.iter().enumerate().flat_map(|(lane, one)| one.held().map(move |i| (lane, i)));
            group.solve(&rows[0], &rows[1], held);
            let (mut xs, mut us, mut costates) = (Vec::new(), Vec::new(), Vec::new());
            for one in &mut adjoints {
                let [x, u, eta] = one.solution_mut();
                xs.push(x);
                us.push(u);
                costates.push(eta);
            }
            group.write([&mut xs, &mut us, &mut costates]);
            for (one, &i) in adjoints.iter_mut().zip(&indices) {
                one.write_bounds(by_controls(i));
            }
        }
        Ok(())
    }

    /// Returns the adjoint of solution i, for the losses of the last call of [`adjoints`](Self::adjoints).
    ///
    /// # Panics
    /// If the batch does not have solution i.
    #[track_caller]
    pub fn adjoint(&self, i: usize) -> &Adjoint {
        assert!(i < self.members.len(), "`i`: expected an index below {}, found {i}", self.members.len());
        match &self.members[i] {
            Member::InLane(adjoint) => adjoint,
            Member::Alone(sensitivity) => &sensitivity.adjoint,
        }
    }
}

impl Member {
    /// Returns the adjoint, if it is computed in a lane.
    fn in_lane(&mut self) -> Option<&mut Adjoint> {
        match self {
            Self::InLane(adjoint) => Some(adjoint),
            Self::Alone(_) => None,
        }
    }
}
