//! Centre of mass, momentum and energies of many states, and all terms at once.

use super::results::{Matrices, Take, Taken, results};
use super::table::{NV, batched};
use crate::calls::centroidal::{centroidal_map, centroidal_map_rate, compute_all_terms};
use crate::calls::kinematics::{forward_accelerations, forward_kinematics, forward_velocities};
use condyle_spatial::block::Real;

results! {
    /// The centroidal momentum matrices of many states: see [`CentroidalMap`](crate::CentroidalMap).
    BatchCentroidalMap {
        /// Ag, 6 × nv.
        Ag: Matrices<'b, T>,
        /// The inertia of all moving bodies about their centre of mass, 6 × 6.
        Ig: Matrices<'b, T>,
        /// c, three numbers for each state.
        com: &'b [T],
        /// The Jacobian of c, 3 × nv.
        Jcom: Matrices<'b, T>,
    }

    /// The centroidal momentum and what its rate depends on, in many states: see
    /// [`CentroidalMapRate`](crate::CentroidalMapRate).
    BatchCentroidalMapRate {
        /// Ag, 6 × nv.
        Ag: Matrices<'b, T>,
        /// dAg/dt along v, 6 × nv.
        dAg: Matrices<'b, T>,
        /// The momentum about the centre of mass, six numbers for each state.
        hg: &'b [T],
        /// The inertia of all moving bodies about their centre of mass, 6 × 6.
        Ig: Matrices<'b, T>,
        /// c, three numbers for each state.
        com: &'b [T],
        /// ċ, three numbers for each state.
        com_velocity: &'b [T],
        /// The Jacobian of c, 3 × nv.
        Jcom: Matrices<'b, T>,
    }

    /// All terms of the equations of motion in many states: see [`AllTerms`](crate::AllTerms).
    BatchAllTerms {
        /// M, nv × nv.
        M: Matrices<'b, T>,
        /// h, nv numbers for each state.
        h: &'b [T],
        /// Momentum, its map and the map's rate, centre of mass and its Jacobian.
        centroidal: BatchCentroidalMapRate<'b, T>,
        /// T, a number for each state.
        kinetic_energy: &'b [T],
        /// V, a number for each state.
        potential_energy: &'b [T],
    }
}

batched! {
    /// [`Placements::com`](crate::Placements::com): c of each state, three numbers.
    ///
    /// q: nq numbers a state.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn com(model, data, to; q) -> &[T] [[3]] { to.numbers(&forward_kinematics(model, data, q).com().to_array()); }

    /// [`Velocities::com_velocity`](crate::Velocities::com_velocity): ċ of each state, three numbers.
    ///
    /// q: nq numbers a state; v: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn com_velocity(model, data, to; q, v) -> &[T] [[3]] {
        to.numbers(&forward_velocities(model, data, q, v).com_velocity().to_array());
    }

    /// [`Accelerations::com_acceleration`](crate::Accelerations::com_acceleration): c̈ of each state, three numbers.
    ///
    /// q: nq numbers a state; v, a: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn com_acceleration(model, data, to; q, v, a) -> &[T] [[3]] {
        to.numbers(&forward_accelerations(model, data, q, v, a).com_acceleration().to_array());
    }

    /// The Jacobian of the centre of mass of each state, 3 × nv: a part of [`centroidal_map`](Self::centroidal_map).
    ///
    /// q: nq numbers a state.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn com_jacobian(model, data, to; q) -> Matrices<'_, T> [[3, NV]] { to.matrix(centroidal_map(model, data, q).Jcom); }

    /// [`centroidal_map`](crate::centroidal_map) of each state.
    ///
    /// q: nq numbers a state.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn centroidal_map(model, data, to; q) -> BatchCentroidalMap<'_, T> [[6, NV], [6, 6], [3], [3, NV]] {
        let map = centroidal_map(model, data, q);
        to.matrix(map.Ag);
        to.inertia(&map.Ig);
        to.numbers(&map.com.to_array());
        to.matrix(map.Jcom);
    }

    /// [`centroidal_map_rate`](crate::centroidal_map_rate) of each state.
    ///
    /// q: nq numbers a state; v: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn centroidal_map_rate(model, data, to; q, v) -> BatchCentroidalMapRate<'_, T>
    [[6, NV], [6, NV], [6], [6, 6], [3], [3], [3, NV]] {
        let map = centroidal_map_rate(model, data, q, v);
        to.matrix(map.Ag);
        to.matrix(map.dAg);
        to.numbers(&map.hg.to_array());
        to.inertia(&map.Ig);
        to.numbers(&map.com.to_array());
        to.numbers(&map.com_velocity.to_array());
        to.matrix(map.Jcom);
    }

    /// [`Velocities::centroidal_momentum`](crate::Velocities::centroidal_momentum): hg of each state, six numbers.
    ///
    /// q: nq numbers a state; v: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn centroidal_momentum(model, data, to; q, v) -> &[T] [[6]] {
        to.numbers(&forward_velocities(model, data, q, v).centroidal_momentum().to_array());
    }

    /// [`Accelerations::centroidal_momentum_rate`](crate::Accelerations::centroidal_momentum_rate): dhg of each state, six
    /// numbers.
    ///
    /// q: nq numbers a state; v, a: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn centroidal_momentum_rate(model, data, to; q, v, a) -> &[T] [[6]] {
        to.numbers(&forward_accelerations(model, data, q, v, a).centroidal_momentum_rate().to_array());
    }

    /// [`Velocities::kinetic_energy`](crate::Velocities::kinetic_energy): T of each state.
    ///
    /// q: nq numbers a state; v: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn kinetic_energy(model, data, to; q, v) -> &[T] [[]] {
        to.numbers(&[forward_velocities(model, data, q, v).kinetic_energy()]);
    }

    /// [`Placements::potential_energy`](crate::Placements::potential_energy): V of each state.
    ///
    /// q: nq numbers a state.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn potential_energy(model, data, to; q) -> &[T] [[]] {
        to.numbers(&[forward_kinematics(model, data, q).potential_energy()]);
    }

    /// [`Velocities::mechanical_energy`](crate::Velocities::mechanical_energy): T + V of each state.
    ///
    /// q: nq numbers a state; v: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn mechanical_energy(model, data, to; q, v) -> &[T] [[]] {
        to.numbers(&[forward_velocities(model, data, q, v).mechanical_energy()]);
    }

    /// [`compute_all_terms`](crate::compute_all_terms()) of each state, but for the Jacobians of frames.
    ///
    /// q: nq numbers a state; v: nv.
    ///
    /// # Panics
    /// As [`rnea`](Self::rnea).
    fn compute_all_terms(model, data, to; q, v) -> BatchAllTerms<'_, T>
    [[NV, NV], [NV], [6, NV], [6, NV], [6], [6, 6], [3], [3], [3, NV], [], []] {
        let terms = compute_all_terms(model, data, q, v);
        let map = terms.centroidal;
        to.matrix(terms.M);
        to.numbers(terms.h);
        to.matrix(map.Ag);
        to.matrix(map.dAg);
        to.numbers(&map.hg.to_array());
        to.inertia(&map.Ig);
        to.numbers(&map.com.to_array());
        to.numbers(&map.com_velocity.to_array());
        to.matrix(map.Jcom);
        to.numbers(&[terms.kinetic_energy]);
        to.numbers(&[terms.potential_energy]);
    }
}
