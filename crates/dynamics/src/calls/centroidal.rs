//! Momentum of the whole robot about its centre of mass, and all terms of the equations of motion in one call.

use super::kinematics::{forward_kinematics, forward_velocities};
use crate::data::Data;
use crate::passes::all_terms::{self, AllTerms};
use crate::passes::centroidal::{CentroidalMap, CentroidalMapRate, run_map, run_map_rate};
use crate::passes::frames::{Placements, Velocities};
use condyle_model::Model;
use condyle_spatial::{Constant, Scalar};

/// Computes the centroidal momentum matrix Ag(q), the centre of mass, the Jacobian of the centre of mass, and the
/// inertia about the centre of mass, in O(n) for n bodies.
///
/// q: nq numbers. Bodies fixed to the world are ignored; results are NaN if no moving body has mass. Allocates nothing.
/// Source: Orin, Goswami, Lee (2013).
///
/// ```
/// use condyle_dynamics::{Data, centroidal_map, neutral, robots};
/// let quadruped = robots::quadruped();
/// let mut data = Data::new(&quadruped);
/// let map = centroidal_map(&quadruped, &mut data, &neutral(&quadruped));
/// assert!((map.Ag[(0, 0)] - quadruped.total_mass()).abs() < 1e-12); // pushed forwards, all goes forwards
/// assert!((map.Jcom[(0, 0)] - 1.0).abs() < 1e-15);
/// ```
///
/// # Panics
/// Panics if `q` does not have nq numbers, or `data` was made for a model of another tree.
#[inline(always)]
#[track_caller]
pub fn centroidal_map<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
) -> CentroidalMap<'d, S> {
    forward_kinematics(model, data, q);
    run_map(model, &data.world, &mut data.centroidal);
    data.centroidal.map()
}

/// Computes Ag(q), the rate dAg/dt for the velocity v, the centroidal momentum hg = Ag v, and all results of
/// [`centroidal_map`], in O(n) for n bodies.
///
/// q: nq numbers; v: nv numbers. Bodies fixed to the world are ignored; results are NaN if no moving body has mass.
/// Allocates nothing. Source: Wensing and Orin (2016).
///
/// ```
/// use condyle_dynamics::{Data, centroidal_map_rate, forward_accelerations, robots};
/// use nalgebra::DVector;
/// let arm = robots::arm7();
/// let (mut data, q, v) = (Data::new(&arm), [0.3; 7], [0.5; 7]);
/// let drift = centroidal_map_rate(&arm, &mut data, &q, &v).dAg * DVector::from_row_slice(&v);
/// let rate = forward_accelerations(&arm, &mut data, &q, &v, &[0.0; 7]).centroidal_momentum_rate();
/// assert!((drift - DVector::from_row_slice(&rate.to_array())).amax() < 1e-13);
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, or `data` was made for a model of another tree.
#[track_caller]
pub fn centroidal_map_rate<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
) -> CentroidalMapRate<'d, S> {
    forward_velocities(model, data, q, v);
    run_map_rate(model, &data.world, &data.moving, &mut data.centroidal);
    data.centroidal.map_rate()
}

/// Computes all terms of the equations of motion in two passes, in O(n · depth): M, h, Ag, dAg, hg, the centre of mass
/// and the energies. The result also gives the poses and Jacobians of all frames on request.
///
/// q: nq numbers; v: nv numbers. Up to rounding, the results equal the results of the separate calls
/// [`crba`](crate::crba), [`nonlinear_effects`](crate::nonlinear_effects),
/// [`centroidal_map_rate`](crate::centroidal_map_rate) and [`forward_velocities`](crate::forward_velocities). Allocates
/// nothing. Source: Featherstone, *Rigid Body Dynamics Algorithms* (2008), tables 5.1 and 6.2; Wensing and Orin (2016).
///
/// ```
/// use condyle_dynamics::{Data, ReferenceFrame, compute_all_terms, robots};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let terms = compute_all_terms(&arm, &mut data, &[0.3; 7], &[0.1; 7]);
/// let mut J = nalgebra::DMatrix::zeros(6, 7);
/// terms.kinematics.frame_jacobian(arm.frame("tool")?, ReferenceFrame::Local, &mut J);
/// assert!(terms.M[(0, 0)] > 0.0 && terms.h.len() == 7 && terms.kinetic_energy > 0.0);
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, or `data` was made for a model of another tree.
#[track_caller]
pub fn compute_all_terms<'d, S: Scalar, R: Constant<S>>(
    model: &'d Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
) -> AllTerms<'d, S, R> {
    forward_velocities(model, data, q, v);
    all_terms::run(model, &data.world, &data.moving, &mut data.centroidal, &mut data.all_terms);
    let kinematics = Velocities { placements: Placements { model, world: &data.world }, moving: &data.moving };
    AllTerms {
        kinematics,
        M: &data.all_terms.M,
        h: &data.all_terms.h,
        a: &data.all_terms.a,
        centroidal: data.centroidal.map_rate(),
        kinetic_energy: data.all_terms.kinetic_energy,
        potential_energy: data.all_terms.potential_energy,
    }
}
