//! Centre of mass, momentum and energies of many states, and all terms at once.

use super::places::{Places, Put};
use super::results::{Matrices, Take, Taken, results};
use super::table::{NV, batched};
use crate::calls::centroidal::{centroidal_map, centroidal_map_rate, compute_all_terms};
use crate::calls::kinematics::{forward_accelerations, forward_kinematics, forward_velocities};
use crate::passes::all_terms::AllTerms;
use crate::passes::centroidal::{CentroidalMap, CentroidalMapRate};
use condyle_spatial::block::Real;

results! {
    /// The centroidal momentum matrices of many states: see [`CentroidalMap`](crate::CentroidalMap).
    BatchCentroidalMap of CentroidalMap {
        /// Ag, 6 × nv.
        Ag: Matrices<'b, T> = [6, NV];
        /// The inertia of all moving bodies about their centre of mass, 6 × 6.
        Ig: Matrices<'b, T> = [6, 6];
        /// c, three numbers for each state.
        com: &'b [T] = [3];
        /// The Jacobian of c, 3 × nv.
        Jcom: Matrices<'b, T> = [3, NV];
    }

    /// The centroidal momentum and what its rate depends on, in many states: see
    /// [`CentroidalMapRate`](crate::CentroidalMapRate).
    BatchCentroidalMapRate of CentroidalMapRate {
        /// Ag, 6 × nv.
        Ag: Matrices<'b, T> = [6, NV];
        /// dAg/dt along v, 6 × nv.
        dAg: Matrices<'b, T> = [6, NV];
        /// The momentum about the centre of mass, six numbers for each state.
        hg: &'b [T] = [6];
        /// The inertia of all moving bodies about their centre of mass, 6 × 6.
        Ig: Matrices<'b, T> = [6, 6];
        /// c, three numbers for each state.
        com: &'b [T] = [3];
        /// ċ, three numbers for each state.
        com_velocity: &'b [T] = [3];
        /// The Jacobian of c, 3 × nv.
        Jcom: Matrices<'b, T> = [3, NV];
    }

    /// All terms of the equations of motion in many states: see [`AllTerms`](crate::AllTerms).
    BatchAllTerms of AllTerms {
        /// M, nv × nv.
        M: Matrices<'b, T> = [NV, NV];
        /// h, nv numbers for each state.
        h: &'b [T] = [NV];
        /// Momentum, its map and the map's rate, centre of mass and its Jacobian.
        centroidal: BatchCentroidalMapRate<'b, T> = [6, NV], [6, NV], [6], [6, 6], [3], [3], [3, NV];
        /// T, a number for each state.
        kinetic_energy: &'b [T] = [];
        /// V, a number for each state.
        potential_energy: &'b [T] = [];
    }
}

batched! {
    /// [`Placements::com`](crate::Placements::com): c of each state, three numbers.
    ///
    /// q: nq numbers a state.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn com(model, data; q) -> &[T] [[3]] { forward_kinematics(model, data, q).com() }

    /// [`Velocities::com_velocity`](crate::Velocities::com_velocity): ċ of each state, three numbers.
    ///
    /// q: nq numbers a state; v: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn com_velocity(model, data; q, v) -> &[T] [[3]] { forward_velocities(model, data, q, v).com_velocity() }

    /// [`Accelerations::com_acceleration`](crate::Accelerations::com_acceleration): c̈ of each state, three numbers.
    ///
    /// q: nq numbers a state; v, a: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn com_acceleration(model, data; q, v, a) -> &[T] [[3]] {
        forward_accelerations(model, data, q, v, a).com_acceleration()
    }

    /// The Jacobian of the centre of mass of each state, 3 × nv: a part of [`centroidal_map`](Self::centroidal_map).
    ///
    /// q: nq numbers a state.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn com_jacobian(model, data; q) -> Matrices<'_, T> [[3, NV]] { centroidal_map(model, data, q).Jcom }

    /// [`centroidal_map`](crate::centroidal_map) of each state.
    ///
    /// q: nq numbers a state.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn centroidal_map(model, data; q) -> BatchCentroidalMap<'_, T> { centroidal_map(model, data, q) }

    /// [`centroidal_map_rate`](crate::centroidal_map_rate) of each state.
    ///
    /// q: nq numbers a state; v: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn centroidal_map_rate(model, data; q, v) -> BatchCentroidalMapRate<'_, T> {
        centroidal_map_rate(model, data, q, v)
    }

    /// [`Velocities::centroidal_momentum`](crate::Velocities::centroidal_momentum): hg of each state, six numbers.
    ///
    /// q: nq numbers a state; v: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn centroidal_momentum(model, data; q, v) -> &[T] [[6]] {
        forward_velocities(model, data, q, v).centroidal_momentum()
    }

    /// [`Accelerations::centroidal_momentum_rate`](crate::Accelerations::centroidal_momentum_rate): dhg of each state, six
    /// numbers.
    ///
    /// q: nq numbers a state; v, a: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn centroidal_momentum_rate(model, data; q, v, a) -> &[T] [[6]] {
        forward_accelerations(model, data, q, v, a).centroidal_momentum_rate()
    }

    /// [`Velocities::kinetic_energy`](crate::Velocities::kinetic_energy): T of each state.
    ///
    /// q: nq numbers a state; v: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn kinetic_energy(model, data; q, v) -> &[T] [[]] { forward_velocities(model, data, q, v).kinetic_energy() }

    /// [`Placements::potential_energy`](crate::Placements::potential_energy): V of each state.
    ///
    /// q: nq numbers a state.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn potential_energy(model, data; q) -> &[T] [[]] { forward_kinematics(model, data, q).potential_energy() }

    /// [`Velocities::mechanical_energy`](crate::Velocities::mechanical_energy): T + V of each state.
    ///
    /// q: nq numbers a state; v: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn mechanical_energy(model, data; q, v) -> &[T] [[]] { forward_velocities(model, data, q, v).mechanical_energy() }

    /// [`compute_all_terms`](crate::compute_all_terms()) of each state, but for the Jacobians of frames.
    ///
    /// q: nq numbers a state; v: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn compute_all_terms(model, data; q, v) -> BatchAllTerms<'_, T> { compute_all_terms(model, data, q, v) }
}
