//! Knots that are computed together in SIMD lanes, whose results have the same bits as the results of single knots.

use super::{DT, contact_costs, feet, random, random_state, rotation};
use condyle_dynamics::{Model, ReferenceFrame, Vec3, robots};
use condyle_optimal::robot::{
    Activation, ContactDynamics, Cost, FrameName, FreeDynamics, FreeInverseDynamics, Limit, Residual,
};
use condyle_optimal::{GroupModel, LqKnot};
use rand::{RngExt, SeedableRng, rngs::StdRng};
use std::sync::Arc;

/// Checks that a group of knots, computed in SIMD lanes, has the same bits as single calls. This includes the last
/// knots, which do not fill a register.
#[test]
fn knots_side_by_side_are_single_knots() {
    let mut rng = StdRng::seed_from_u64(18);
    let model = Arc::new(robots::quadruped().with_limbs(false)); // parallel branches change the order of sums
    let contacts = feet(&model, ReferenceFrame::LocalWorldAligned);
    let costs = contact_costs(&model, &contacts, 12, &mut rng);
    let free = costs.iter().filter(|cost| !["force", "cone"].contains(&cost.name.as_str())).cloned().collect();
    let stance = ContactDynamics::running(model.clone(), &contacts, DT, costs).unwrap();
    let flight = FreeDynamics::running(model.clone(), DT, free).unwrap();
    check_group(stance, &model, &mut rng);
    check_group(flight, &model, &mut rng);
    let quadratic = |name: &str, residual| Cost::new(name, 0.3, residual, Activation::Quadratic);
    let given = vec![
        quadratic("effort", Residual::JointEffort { reference: random(18, 5.0, &mut rng) }),
        quadratic("acceleration", Residual::JointAcceleration { reference: random(18, 5.0, &mut rng) }),
        quadratic("gravity", Residual::ControlGravity),
        quadratic("com", Residual::CenterOfMass { target: Vec3::new(0.1, 0.2, 0.3) }),
    ];
    check_group(FreeInverseDynamics::running(model.clone(), DT, given).unwrap(), &model, &mut rng);
}

/// Checks that a group has the same bits as single calls if its knots differ in targets, in weights, and in their sets
/// of costs.
#[test]
fn knots_with_costs_of_their_own_are_single_knots() {
    let mut rng = StdRng::seed_from_u64(19);
    let model = Arc::new(robots::quadruped().with_limbs(false));
    let contacts = feet(&model, ReferenceFrame::LocalWorldAligned);
    let costs = contact_costs(&model, &contacts, 12, &mut rng);
    let mut stance = ContactDynamics::running(model.clone(), &contacts, DT, costs.clone()).unwrap();
    let foot = || FrameName::from("LH_foot");
    let mut other = |knot: usize, turn: bool| {
        let mut own = costs.clone();
        for cost in &mut own {
            match &mut cost.residual {
                Residual::CenterOfMass { target } => *target = Vec3::new(rng.random(), rng.random(), 0.3),
                Residual::FrameRotation { target, .. } => *target = rotation(&mut rng),
                Residual::FrameVelocity { frame: own, .. } if turn => *own = foot(),
                Residual::CentroidalMomentum { .. } if knot == 5 => cost.weight = 0.0,
                _ => {}
            }
        }
        own
    };
    for (knot, turn) in [(1, false), (4, true), (5, false), (6, true), (9, true), (13, false)] {
        stance.set_costs(knot, other(knot, turn)).unwrap();
    }
    let lift = vec![Cost::new(
        "lift",
        1.0,
        Residual::FrameTranslation { frame: foot(), target: Vec3::zero() },
        Activation::Quadratic,
    )];
    stance.set_costs(2, lift).unwrap();
    let height = Residual::FrameTranslation { frame: foot(), target: Vec3::new(0.0, 0.0, 0.1) };
    stance.set_limits(3, vec![Limit::equality("height", height)]).unwrap();
    check_group(stance, &model, &mut rng);
}

pub(super) fn check_group(mut action: impl GroupModel, model: &Model, rng: &mut StdRng) {
    for count in [0, 1, 2, 3, 8, 21] {
        let knots: Vec<usize> = (0..count).collect();
        let xs = knots.iter().flat_map(|_| random_state(model, rng)).collect::<Vec<_>>();
        let us = random(count * action.nu(), 5.0, rng);
        let (nx, ndx, nu) = (action.nx(), action.ndx(), action.nu());
        let (mut next, mut costs) = (vec![0.0; count * nx], vec![0.0; count]);
        let mut lq_knots = vec![LqKnot::zeros(ndx, nu); count];
        action.calc_group(&knots, &xs, &us, &mut next, &mut costs);
        action.calc_diff_group(&knots, &xs, &us, &mut lq_knots);
        for t in knots {
            let (x, u) = (&xs[t * nx..][..nx], &us[t * nu..][..nu]);
            let (mut alone, mut knot) = (vec![0.0; nx], LqKnot::zeros(ndx, nu));
            assert_eq!(action.calc(t, x, u, &mut alone), costs[t], "{count}");
            assert_eq!(alone, next[t * nx..][..nx]);
            action.calc_diff(t, x, u, &mut knot);
            assert!(knot == lq_knots[t], "knot {t} of {count} has other derivatives");
        }
    }
}
