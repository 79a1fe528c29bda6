//! A user's own cost with exact derivatives. The cost takes three lines of code, and gradient and Hessian take one
//! line.
//!
//! The tool should be near a target, with small efforts, and the arm should stay near its present position. The cost is
//! written once, for any number type. Newton's method with the exact Hessian then needs only a few steps.
#![allow(non_snake_case)]

use condyle::{Data, Error, Model, Scalar, Vec3, forward_kinematics, hessian, integrate, robots, terms::gravity};

/// Computes ½ (|p(q) − target|² + 1e-4 |g(q)|² + 1e-2 |q − q₀|²), with terms in m², (N m)² and rad². p is the tool's
/// position, and g are the efforts that gravity requires.
fn cost<S: Scalar>(arm: &Model, data: &mut Data<S>, tool: usize, q: &[S]) -> S {
    let off = forward_kinematics(arm, data, q).frame(tool).translation - Vec3::new(0.4, 0.3, 0.4).lift();
    let efforts = gravity(arm, data, q).iter().fold(S::zero(), |sum, &g| g.mul_add(g, sum));
    let moved = q.iter().fold(S::zero(), |sum, &q| sum + (q - S::splat(0.3)) * (q - S::splat(0.3)));
    (off.dot(off) + efforts * S::splat(1e-4) + moved * S::splat(1e-2)) * S::splat(0.5)
}

fn main() -> Result<(), Error> {
    let arm = robots::arm7();
    let (tool, mut data, mut q) = (arm.frame("tool")?, Data::new(&arm), vec![0.3; 7]);
    println!("step          cost    |gradient|");
    for step in 0..50 {
        let (value, g, mut H) = hessian(&arm, &q, |q| cost(&arm, &mut data, tool, q));
        println!("{step:4} {value:13.9} {:13.3e}", g.norm());
        if g.norm() < 1e-12 {
            break;
        }
        // If the Hessian is not positive definite, add a multiple of the identity to make it so.
        let lowest = H.symmetric_eigenvalues().min();
        H.iter_mut().step_by(8).for_each(|x| *x += (1e-2 - lowest).max(0.0));
        let mut step = H.cholesky().expect("it is positive now").solve(&-g);
        let here = q.clone();
        for _ in 0..20 {
            integrate(&arm, &here, step.as_slice(), &mut q);
            if cost(&arm, &mut Data::new(&arm), tool, &q) <= value {
                break;
            }
            step *= 0.5;
        }
    }
    Ok(())
}
