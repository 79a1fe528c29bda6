//! Batch functions for the centre of mass, the momentum, the energies and all terms of the equations of motion of many
//! states.

use super::places::{Places, Put};
use super::results::{Matrices, Take, Taken, results};
use super::table::{NV, batched};
use crate::calls::centroidal::{centroidal_map, centroidal_map_rate, compute_all_terms};
use crate::calls::kinematics::{forward_accelerations, forward_kinematics, forward_velocities};
use crate::passes::all_terms::AllTerms;
use crate::passes::centroidal::{CentroidalMap, CentroidalMapRate};
use condyle_spatial::block::Real;

results! {
    /// Centroidal momentum matrices of many states: see [`CentroidalMap`](crate::CentroidalMap).
    BatchCentroidalMap of CentroidalMap {
        /// Centroidal momentum matrix Ag, 6 × nv.
        Ag: Matrices<'b, T> = [6, NV];
        /// Inertia of all moving bodies about their centre of mass, 6 × 6.
        Ig: Matrices<'b, T> = [6, 6];
        /// Centre of mass c, three numbers per state.
        com: &'b [T] = [3];
        /// Jacobian of the centre of mass, 3 × nv.
        Jcom: Matrices<'b, T> = [3, NV];
    }

    /// Centroidal momentum and the terms of its rate, of many states: see
    /// [`CentroidalMapRate`](crate::CentroidalMapRate).
    BatchCentroidalMapRate of CentroidalMapRate {
        /// Centroidal momentum matrix Ag, 6 × nv.
        Ag: Matrices<'b, T> = [6, NV];
        /// Time derivative dAg/dt of the centroidal momentum matrix for the velocity v, 6 × nv.
        dAg: Matrices<'b, T> = [6, NV];
        /// Momentum hg of the robot about its centre of mass, six numbers per state.
        hg: &'b [T] = [6];
        /// Inertia of all moving bodies about their centre of mass, 6 × 6.
        Ig: Matrices<'b, T> = [6, 6];
        /// Centre of mass c, three numbers per state.
        com: &'b [T] = [3];
        /// Velocity ċ of the centre of mass, three numbers per state.
        com_velocity: &'b [T] = [3];
        /// Jacobian of the centre of mass, 3 × nv.
        Jcom: Matrices<'b, T> = [3, NV];
    }

    /// All terms of the equations of motion in many states: see [`AllTerms`](crate::AllTerms).
    BatchAllTerms of AllTerms {
        /// Inertia matrix M, nv × nv.
        M: Matrices<'b, T> = [NV, NV];
        /// Nonlinear effects h = C v + g, nv numbers per state.
        h: &'b [T] = [NV];
        /// Centroidal momentum, the centroidal momentum matrix Ag, the time derivative of Ag, the centre of mass c, and
        /// the Jacobian of c.
        centroidal: BatchCentroidalMapRate<'b, T> = [6, NV], [6, NV], [6], [6, 6], [3], [3], [3, NV];
        /// Kinetic energy T, one number per state.
        kinetic_energy: &'b [T] = [];
        /// Potential energy V, one number per state.
        potential_energy: &'b [T] = [];
    }
}

batched! {
    /// Computes [`Placements::com`](crate::Placements::com) for each state: the centre of mass c, three numbers.
    ///
    /// q: nq numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn com(model, data; q) -> &[T] [[3]] { forward_kinematics(model, data, q).com() }

    /// Computes [`Velocities::com_velocity`](crate::Velocities::com_velocity) for each state: the velocity ċ of the
    /// centre of mass, three numbers.
    ///
    /// q: nq numbers per state; v: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn com_velocity(model, data; q, v) -> &[T] [[3]] { forward_velocities(model, data, q, v).com_velocity() }

    /// Computes [`Accelerations::com_acceleration`](crate::Accelerations::com_acceleration) for each state: the
    /// acceleration c̈ of the centre of mass, three numbers.
    ///
    /// q: nq numbers per state; v and a: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn com_acceleration(model, data; q, v, a) -> &[T] [[3]] {
        forward_accelerations(model, data, q, v, a).com_acceleration()
    }

    /// Computes the Jacobian of the centre of mass for each state, 3 × nv. The Jacobian is one of the results of
    /// [`centroidal_map`](Self::centroidal_map).
    ///
    /// q: nq numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn com_jacobian(model, data; q) -> Matrices<'_, T> [[3, NV]] { centroidal_map(model, data, q).Jcom }

    /// Computes [`centroidal_map`](crate::centroidal_map) for each state.
    ///
    /// q: nq numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn centroidal_map(model, data; q) -> BatchCentroidalMap<'_, T> { centroidal_map(model, data, q) }

    /// Computes [`centroidal_map_rate`](crate::centroidal_map_rate) for each state.
    ///
    /// q: nq numbers per state; v: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn centroidal_map_rate(model, data; q, v) -> BatchCentroidalMapRate<'_, T> {
        centroidal_map_rate(model, data, q, v)
    }

    /// Computes [`Velocities::centroidal_momentum`](crate::Velocities::centroidal_momentum) for each state: the
    /// momentum hg, six numbers.
    ///
    /// q: nq numbers per state; v: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn centroidal_momentum(model, data; q, v) -> &[T] [[6]] {
        forward_velocities(model, data, q, v).centroidal_momentum()
    }

    /// Computes [`Accelerations::centroidal_momentum_rate`](crate::Accelerations::centroidal_momentum_rate) for each
    /// state: the rate dhg of the momentum, six numbers.
    ///
    /// q: nq numbers per state; v and a: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn centroidal_momentum_rate(model, data; q, v, a) -> &[T] [[6]] {
        forward_accelerations(model, data, q, v, a).centroidal_momentum_rate()
    }

    /// Computes [`Velocities::kinetic_energy`](crate::Velocities::kinetic_energy) for each state: the kinetic energy T.
    ///
    /// q: nq numbers per state; v: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn kinetic_energy(model, data; q, v) -> &[T] [[]] { forward_velocities(model, data, q, v).kinetic_energy() }

    /// Computes [`Placements::potential_energy`](crate::Placements::potential_energy) for each state: the potential
    /// energy V.
    ///
    /// q: nq numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn potential_energy(model, data; q) -> &[T] [[]] { forward_kinematics(model, data, q).potential_energy() }

    /// Computes [`Velocities::mechanical_energy`](crate::Velocities::mechanical_energy) for each state: the sum T + V
    /// of kinetic and potential energy.
    ///
    /// q: nq numbers per state; v: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn mechanical_energy(model, data; q, v) -> &[T] [[]] { forward_velocities(model, data, q, v).mechanical_energy() }

    /// Computes [`compute_all_terms`](crate::compute_all_terms()) for each state, except the Jacobians of frames.
    ///
    /// q: nq numbers per state; v: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn compute_all_terms(model, data; q, v) -> BatchAllTerms<'_, T> { compute_all_terms(model, data, q, v) }
}
