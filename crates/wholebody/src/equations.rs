//! Constraints of the program at one state. A comment at each block of code shows its equation.
//!
//! x = (q̈, forces of active contacts).

use crate::condense::Known;
use crate::cone_program::{ConeProgram, Size};
use crate::contact_rows::ContactRows;
use crate::error::Error;
use crate::kinematics::Kinematics;
use crate::least_squares::{LeastSquares, dot};
use crate::limits::AccelerationBounds;
use crate::references::References;
use crate::separation::Separation;
use crate::settings::Settings;
use crate::warm_start::Places;
use condyle_dynamics::distances::DistancePairs;
use condyle_dynamics::{Joint, Model};
use nalgebra::DMatrix;

/// Activation below which a contact is off: the force that it could carry would be smaller than the solver's tolerance.
const LEAST_ACTIVATION: f64 = 1e-6;

/// Quantities that determine the constraints, and memory for the constraints.
pub(crate) struct Equations {
    pub kinematics: Kinematics,
    pub contacts: Vec<ContactRows>,
    /// Coordinates of free-flyers, which have no motor.
    pub free: Vec<usize>,
    /// Coordinates that are not in `free`.
    pub actuated: Vec<usize>,
    /// Coordinates whose motor has an effort limit, each with its minimum and maximum effort.
    pub limited: Vec<(usize, [f64; 2])>,
    /// Distances of pairs of geometries; their rows of G follow the rows of the efforts.
    separation: Option<Separation>,
    pub bounds: AccelerationBounds,
    /// Coordinates with limits of position or velocity. Each has a row of G for the bounds on its acceleration.
    bounded: Vec<usize>,
    /// Eᵀ of the efforts τ = E x + h with E = [M, −Jᵀ]: a column for each coordinate. M is the inertia matrix, J the
    /// Jacobian of the contacts, and h the bias efforts.
    pub Et: DMatrix<f64>,
    /// Constraints of the whole program; the solver fills in the cost P and c.
    pub program: ConeProgram,
    /// Indices of the unknowns and constraints in the program.
    places: Places,
    /// Weight of the robot: ‖g‖ times the mass (N).
    pub weight: f64,
}

impl Equations {
    /// Allocates all memory, with space for `held` additional equalities.
    pub(crate) fn new(
        kinematics: Kinematics,
        mut contacts: Vec<ContactRows>,
        settings: &Settings,
        held: usize,
    ) -> Result<Self, Error> {
        let model = &kinematics.model;
        let nv = model.nv();
        let free_flyers = model.bodies().iter().skip(1).filter(|b| b.joint == Joint::FreeFlyer);
        let free: Vec<usize> = free_flyers.flat_map(|b| b.idx_v..b.idx_v + 6).collect();
        let actuated: Vec<usize> = (0..nv).filter(|i| !free.contains(i)).collect();
        let [least, greatest] = settings.effort(model);
        let limits = actuated.iter().map(|&i| (i, [least[i], greatest[i]]));
        let limited: Vec<_> = limits.filter(|(_, sides)| sides.iter().any(|x| x.is_finite())).collect();
        let bounds = AccelerationBounds::new(model, settings.joint_limits.as_ref());
        let bounded = bounds.bounds.iter().map(|bound| bound.0).collect();
        let separation = settings.distances.as_ref().map(|limits| Separation::new(model, limits)).transpose()?;
        let pairs = separation.as_ref().map_or(0, Separation::len);
        let rows = limited.len() + pairs + bounds.bounds.len();
        let mut capacity = Size { unknowns: nv, equalities: free.len(), rows, cone_rows: 0 };
        contacts.iter_mut().for_each(|contact| contact.add_to(&mut capacity, settings.friction));
        capacity.equalities += held;
        let weight = kinematics.mass * model.gravity().norm_squared().sqrt();
        let (Et, program) = (DMatrix::zeros(capacity.unknowns, nv), ConeProgram::new(capacity));
        let places = Places::new(capacity);
        Ok(Self {
            free,
            actuated,
            limited,
            separation,
            bounds,
            bounded,
            Et,
            program,
            places,
            weight,
            contacts,
            kinematics,
        })
    }

    /// Returns the pairs of the limits of distances.
    pub(crate) fn pairs_mut(&mut self) -> Option<&mut DistancePairs> {
        self.separation.as_mut().map(Separation::pairs_mut)
    }

    /// Returns the number of rows with few zeros: of the efforts, and of the distances.
    pub(crate) fn dense_rows(&self) -> usize {
        self.limited.len() + self.separation.as_ref().map_or(0, Separation::len)
    }

    /// Returns whether there are limits that may give way.
    pub(crate) fn can_relax(&self) -> bool {
        self.separation.is_some() || !self.bounds.bounds.is_empty()
    }

    pub(crate) fn model(&self) -> &Model {
        &self.kinematics.model
    }

    /// Returns the program and its known structure.
    pub(crate) fn program(&mut self) -> (&mut ConeProgram, Known<'_>) {
        let dense = self.dense_rows();
        (&mut self.program, Known { dense, single: &self.bounded, places: &self.places })
    }

    /// Computes all constraints at the state (q, v).
    pub(crate) fn update(&mut self, q: &[f64], v: &[f64], references: &References, settings: &Settings) {
        let dense = self.dense_rows();
        let Self { kinematics, contacts, separation, bounds, Et, program, .. } = self;
        kinematics.update(q, v);
        let nv = v.len();
        let mut unknowns = nv;
        for (contact, target) in contacts.iter_mut().zip(&references.contacts) {
            contact.active = target.activation > LEAST_ACTIVATION;
            if contact.active {
                contact.column = unknowns;
                unknowns += contact.geometry.unknowns();
                contact.update(&kinematics.frames[contact.frame], target, settings, self.weight);
            }
        }
        program.size = Size { unknowns, equalities: 0, rows: 0, cone_rows: 0 };
        program.cones.clear();

        let most = Et.nrows();
        for (E, M) in Et.as_mut_slice().chunks_exact_mut(most).zip(kinematics.M.as_slice().chunks_exact(nv)) {
            let (motion, forces) = E[..unknowns].split_at_mut(nv);
            motion.copy_from_slice(M);
            forces.fill(0.0);
        }
        for contact in contacts.iter().filter(|contact| contact.active) {
            contact.add_effort(&kinematics.frames[contact.frame].support, Et);
        }

        let E = |i: usize| &Et.as_slice()[i * most..][..unknowns];
        for &i in &self.free {
            let e = program.size.equalities;
            program.equality_mut(e)[..unknowns].copy_from_slice(E(i));
            program.b[e] = -kinematics.h[i]; // M q̈ − Jᵀ f = −h for the base, on which no motor acts
            program.size.equalities += 1;
        }
        for contact in contacts.iter().filter(|contact| contact.active) {
            contact.add_equalities(program); // J q̈ = a* − J̇ v
        }

        for (row, &(i, [least, greatest])) in self.limited.iter().enumerate() {
            program.row_mut(row)[..unknowns].copy_from_slice(E(i));
            let h = kinematics.h[i];
            (program.lower[row], program.upper[row]) = (least - h, greatest - h); // τ_min ≤ E x + h ≤ τ_max
        }
        if let Some(separation) = separation {
            separation.write(&kinematics.model, q, v, program, self.limited.len()); // g q̈ ≥ bound − ġ v
        }
        bounds.update(q, v);
        for (k, &(i, lower, upper)) in bounds.bounds.iter().enumerate() {
            let row = dense + k;
            let coefficients = program.row_mut(row);
            coefficients[..unknowns].fill(0.0);
            coefficients[i] = 1.0; // position and velocity, as bounds on q̈
            (program.lower[row], program.upper[row]) = (lower, upper);
        }
        program.size.rows = dense + bounds.bounds.len();
        self.places.clear();
        self.places.unknowns.extend(0..nv);
        self.places.units.resize(nv, 1.0);
        self.places.equalities.extend(0..self.free.len());
        self.places.rows.extend(0..program.size.rows);
        for contact in contacts.iter().filter(|contact| contact.active) {
            contact.add_force_rows(program, settings.friction);
            contact.add_places(&mut self.places, settings.friction);
        }
    }

    /// Computes the efforts τ = E x + h of the actuated coordinates.
    pub(crate) fn effort(&self, x: &[f64], tau: &mut [f64]) {
        for &i in &self.actuated {
            tau[i] = self.kinematics.h[i] + dot(&self.Et.as_slice()[i * self.Et.nrows()..], x);
        }
    }

    /// Removes the limits of joints and distances from the rows. If the bounds exclude zero acceleration, the joint or
    /// pair gets a task of this weight for the nearest allowed acceleration.
    pub(crate) fn relax(&mut self, objective: &mut LeastSquares, weight: f64) {
        let dense = self.dense_rows();
        if let Some(separation) = &self.separation {
            separation.relax(&mut self.program, self.limited.len(), objective, weight);
        }
        for (k, &(i, lower, upper)) in self.bounds.bounds.iter().enumerate() {
            let row = dense + k;
            (self.program.lower[row], self.program.upper[row]) = (f64::NEG_INFINITY, f64::INFINITY);
            if lower > 0.0 || upper < 0.0 {
                objective.add_single(i, weight, if lower > 0.0 { lower } else { upper });
            }
        }
    }

    /// Returns the largest violation of rows, cones and equalities by x, in the units of each constraint.
    pub(crate) fn violation(&self, x: &[f64]) -> f64 {
        let p = &self.program;
        let stride = p.At.nrows();
        let product = |matrix: &DMatrix<f64>, column: usize| -> f64 { dot(&matrix.as_slice()[column * stride..], x) };
        let unit = self.dense_rows()..self.dense_rows() + self.bounds.bounds.len();
        let larger = |worst: f64, x: f64| if x > worst || x.is_nan() { x } else { worst };
        let mut worst = 0.0;
        for e in 0..p.size.equalities {
            worst = larger(worst, (product(&p.At, e) - p.b[e]).abs());
        }
        for r in 0..p.size.rows {
            let y = if unit.contains(&r) { x[self.bounds.bounds[r - unit.start].0] } else { product(&p.Gt, r) };
            worst = larger(larger(worst, y - p.upper[r]), p.lower[r] - y);
        }
        let mut first = 0;
        for &dimension in &p.cones {
            let s = |i: usize| p.h[first + i] + product(&p.Ft, first + i);
            let tail = (1..dimension).map(|i| s(i) * s(i)).sum::<f64>().sqrt();
            worst = larger(worst, tail - s(0));
            first += dimension;
        }
        worst
    }
}
