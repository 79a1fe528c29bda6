//! Random constraints for tests.

use super::{State, all_models, normal3, random_pose, rng};
use condyle_dynamics::{
    ConstraintKind, ConstraintSet, ContactConstraint, Data, Mat3, Model, Motion, ReferenceFrame, Target,
    constrained_dynamics_derivatives,
};
use rand::RngExt;
use rand::rngs::StdRng;

/// Maximum condition number of the constraint inertia Λ = (J M⁻¹ Jᵀ)⁻¹. With a larger condition number, rounding errors
/// are too large for a test of the algorithm.
const WORST_CONDITION: f64 = 1e4;

const KINDS: [ConstraintKind; 4] =
    [ConstraintKind::Point, ConstraintKind::Rigid, ConstraintKind::Line, ConstraintKind::Plane];

/// Returns a random contact or loop constraint, in a random reference frame, with random gains and targets.
pub(crate) fn random_constraint(model: &Model, rng: &mut StdRng) -> ContactConstraint {
    let frames = model.frames().len();
    let motion = |rng: &mut StdRng| Motion::new(normal3(rng), normal3(rng));
    let gain = |rng: &mut StdRng| if rng.random::<bool>() { 5.0 * rng.random::<f64>() } else { 0.0 };
    let kind = KINDS[rng.random_range(0..KINDS.len())];
    let axes = match kind {
        ConstraintKind::Line | ConstraintKind::Plane => random_pose(rng).rotation,
        _ => Mat3::identity(),
    };
    let mut constraint = ContactConstraint {
        frame: rng.random_range(0..frames),
        other: rng.random::<bool>().then(|| rng.random_range(0..frames)),
        kind,
        axes,
        reference: if rng.random::<bool>() { ReferenceFrame::Local } else { ReferenceFrame::LocalWorldAligned },
        kp: gain(rng),
        kp_axes: None,
        kd: gain(rng),
        target: Target { placement: random_pose(rng), velocity: motion(rng), acceleration: motion(rng) },
    };
    if constraint.kp > 3.0 {
        // gains for each axis, which need no random numbers
        constraint.kp_axes = Some(core::array::from_fn(|k| constraint.kp * (0.4 * k as f64)));
    }
    constraint
}

/// Returns random constraints that the robot can satisfy at a state. The constraint forces are unique.
pub(crate) fn random_constraints(model: &Model, state: &State, rng: &mut StdRng) -> Vec<ContactConstraint> {
    let mut chosen = Vec::new();
    let mut data = Data::new(model);
    for _ in 0..12 {
        chosen.push(random_constraint(model, rng));
        let regular = ConstraintSet::new(model, &chosen).is_ok_and(|mut set| {
            let d = constrained_dynamics_derivatives(model, &mut data, &mut set, &state.q, &state.v, &state.tau, &[]);
            let inertias = d.inertia.clone().symmetric_eigenvalues();
            d.redundant == 0.0 && inertias.max() < WORST_CONDITION * inertias.min()
        });
        if !regular {
            chosen.pop();
        }
    }
    chosen
}

/// Returns models, each with a state and constraints that the model can satisfy at this state. The constraint forces
/// are unique.
pub(crate) fn cases(trees: u64) -> Vec<(Model, State, Vec<ContactConstraint>)> {
    let with_constraints = |(seed, model): (usize, Model)| {
        let mut rng = rng(seed as u64);
        let state = State::random(&model, &mut rng);
        let constraints = random_constraints(&model, &state, &mut rng);
        (model, state, constraints)
    };
    all_models(trees).into_iter().enumerate().map(with_constraints).collect()
}
