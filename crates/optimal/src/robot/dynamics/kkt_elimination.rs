//! The equations of a knot in contact, solved for what is not chosen: see [`InverseDynamicsForm`].
//!
//! Changes of accelerations a and forces f satisfy
//!
//! ```text
//! J δa            + c_v δv + c_q δq = 0         contacts stay            → the accelerations of the limbs in contact
//! M_b δa − J_bᵀ δf + r_v δv + r_q δq = 0         nothing drives the base  → forces, and accelerations if these cannot
//! M_j δa − J_jᵀ δf + r_v δv + r_q δq = δu        the joints               → δu
//! ```
//!
//! Each of the first two groups of rows is solved for one of its unknowns (Gauss and Jordan), the largest among those
//! that it may best do without. A contact's rows prefer joints that move no other contact; where these are close to
//! singular (a straight knee) any acceleration will do. Rows of the base prefer forces. Only where contacts are
//! redundant is there no pivot, and the knot stays explicit. What the limbs in contact do, and then the base, is mostly
//! solved before, for several knots side by side: see [`limb_elimination`](super::limb_elimination).
#![allow(non_snake_case)] // J, M, T, U, D

use crate::lq::InverseDynamicsForm;
use crate::robot::knot_data::Sensitivities;
use crate::robot::outputs::Output;
use crate::robot::residuals::rows::Row;
use condyle_linalg::{Runs, SLACK, SparseRows, Vector, Vectorized, at_level, copy_scaled, max_abs, subtract_rows};
use core::ops::Range;

/// Pivot among the unknowns that are preferred may be so much smaller than the largest of all.
pub(super) const PREFERENCE: f64 = 1e-2;
/// Pivot that is so much smaller than the row's largest entry was at first counts as zero.
const REDUNDANT: f64 = 1e-7;

/// Size of the tableau of a knot: a row for each contact's row and each coordinate, over (δa, δf, δv, δq).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tableau {
    pub nv: usize,
    /// Number of rows of all contacts.
    pub rows: usize,
}

condyle_spatial::alike!(Tableau);

impl Tableau {
    /// Returns the distance from one row to the next.
    pub(crate) fn stride(self) -> usize {
        3 * self.nv + self.rows + SLACK
    }

    /// Returns the number of its entries.
    pub(crate) fn len(self) -> usize {
        (self.rows + self.nv) * self.stride()
    }
}

/// Elimination for one set of contacts, and its scratch.
#[derive(Debug)]
pub(crate) struct KktElimination {
    tableau: Tableau,
    /// Number of coordinates, the first ones, that are not driven.
    passive: usize,
    /// Coordinates that each contact's row prefers.
    preferred: Vec<Vec<usize>>,
    /// Rows that are solved before, elimination after elimination, each with its column.
    before: Vec<Vec<(usize, usize)>>,
    /// Column that each row was solved for.
    pivots: Vec<usize>,
    /// Rows that are solved here.
    late: Vec<usize>,
    /// Pivots for which places and runs were found.
    laid_out: Vec<usize>,
    /// Place of each column of δa and δf: its unknown, if it is one, or else the row of D or of forces for it.
    place: Vec<Place>,
    /// From the columns of δa, and of δf, to the unknowns that they are.
    runs: [Runs; 2],
    /// Forces that are not unknowns, over (w, δv, δq).
    forces: SparseRows,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    Unknown(usize),
    Row(usize),
}

/// Returns the driven coordinates that move a contact's row r and no other contact's.
pub(super) fn own_coordinates(moved_by: &[Vec<usize>], r: usize, passive: usize) -> Vec<usize> {
    let alone = |k: &usize| moved_by.iter().all(|other| *other == moved_by[r] || !other.contains(k));
    moved_by[r].iter().copied().filter(|k| *k >= passive && alone(k)).collect()
}

impl KktElimination {
    /// Returns the elimination for contacts whose rows are moved by some coordinates each, of a robot whose first
    /// `passive` coordinates are not driven.
    pub(crate) fn new(nv: usize, passive: usize, moved_by: &[Vec<usize>]) -> Self {
        let rows = moved_by.len();
        let preferred = (0..rows).map(|r| {
            let own = own_coordinates(moved_by, r, passive);
            if own.is_empty() { moved_by[r].iter().copied().filter(|k| *k >= passive).collect() } else { own }
        });
        let numbers = || Vec::with_capacity(rows + passive);
        let mut elimination = Self {
            tableau: Tableau { nv, rows },
            passive,
            preferred: preferred.collect(),
            before: Vec::new(),
            pivots: numbers(),
            late: numbers(),
            laid_out: numbers(),
            place: vec![Place::Unknown(0); nv + rows],
            runs: [Runs::with_capacity(nv), Runs::with_capacity(rows)],
            forces: SparseRows::default(),
        };
        elimination.lay_out();
        elimination
    }

    /// Sets the rows that are solved before: see
    /// [`LimbElimination::solved`](super::limb_elimination::LimbElimination::solved).
    pub(crate) fn follow(&mut self, before: Vec<Vec<(usize, usize)>>) {
        self.before = before;
    }

    /// Returns the columns that the rows of the base are best solved for in a tableau whose limbs are solved.
    pub(crate) fn base_pivots(&mut self, tableau: &mut [f64]) -> Option<Vec<usize>> {
        let (mut form, Tableau { nv, rows }) = (InverseDynamicsForm::default(), self.tableau);
        form.reserve(nv, nv - self.passive, [self.most_dependent(), 0]);
        self.run(tableau, 1, 1.0, &mut form).then(|| self.pivots[rows..].to_vec())
    }

    /// Returns the most coordinates that are not unknowns.
    pub(crate) fn most_dependent(&self) -> usize {
        self.tableau.rows + self.passive
    }

    /// Writes U and D for steps of Δt, from a tableau in which a number of eliminations are done; returns whether
    /// pivots exist. Overwrites the tableau.
    pub(crate) fn run(
        &mut self,
        tableau: &mut [f64],
        eliminations: usize,
        dt: f64,
        form: &mut InverseDynamicsForm,
    ) -> bool {
        let mut done = false;
        at_level(Run { elimination: self, T: tableau, eliminations, dt, form, done: &mut done });
        done
    }

    /// Returns the sensitivities of outputs by (w, δv, δq), for a knot whose U and D are these.
    pub(crate) fn sensitivities<'a>(&'a self, form: &'a InverseDynamicsForm, dt: f64) -> Unknowns<'a> {
        Unknowns { elimination: self, form, dt }
    }

    /// Returns the column with the largest entry of a row, and the entry.
    #[inline(always)]
    fn largest(&self, row: &[f64], columns: impl Iterator<Item = usize>) -> (usize, f64) {
        let mut best = (0, 0.0);
        for k in columns {
            if row[k].abs() > f64::abs(best.1) && matches!(self.place[k], Place::Unknown(_)) {
                best = (k, row[k]);
            }
        }
        best
    }

    /// Returns the column to solve row r for.
    #[inline(always)]
    fn choose(&self, r: usize, row: &[f64], scale: [f64; 2]) -> Option<usize> {
        let Tableau { nv, rows } = self.tableau;
        let any = || self.largest(row, 0..nv);
        let ((k, pivot), least) = if r < rows {
            (self.largest(row, self.preferred[r].iter().copied()), PREFERENCE * any().1.abs())
        } else {
            (self.largest(row, nv..nv + rows), PREFERENCE * scale[1])
        };
        if pivot != 0.0 && pivot.abs() >= least && pivot.abs() > REDUNDANT * scale[1] {
            return Some(k);
        }
        let (k, pivot) = any();
        (pivot.abs() > REDUNDANT * scale[0]).then_some(k) // a NaN ends here
    }
}

/// Number of rows that are subtracted at once: the number of coordinates of a base that moves freely.
const TOGETHER: usize = 6;

impl KktElimination {
    /// Solves the rows that have no pivot yet; returns whether all have one now.
    #[inline(always)]
    fn eliminate<V: Vector>(&mut self, T: &mut [f64], motion: &mut [f64]) -> bool {
        let (Tableau { nv, rows }, stride) = (self.tableau, self.tableau.stride());
        let mut force_scale = 0.0_f64;
        for row in T.chunks_exact(stride).skip(rows) {
            force_scale = force_scale.max(max_abs(&row[nv..][..rows]));
        }
        self.laid_out.clear(); // what follows writes to the places
        self.place.fill(Place::Unknown(0));
        for (r, &k) in self.pivots.iter().enumerate().filter(|(_, k)| **k != usize::MAX) {
            self.place[k] = Place::Row(r);
        }
        self.late.clear();
        for r in 0..self.pivots.len() {
            if self.pivots[r] != usize::MAX {
                continue;
            }
            let (before, rest) = T.split_at_mut(r * stride);
            let (row, after) = rest.split_at_mut(stride);
            // what the entries of a row that depends on others are compared with: a contact's are of order one
            let scale = if r < rows { [1.0, 1.0] } else { [max_abs(&row[..nv]), force_scale] };
            let Some(k) = self.choose(r, row, scale) else { return false };
            self.place[k] = Place::Row(r);
            self.pivots[r] = k;
            let inverse = row[k].recip();
            for x in row.iter_mut() {
                *x *= inverse;
            }
            row[k] = 1.0;
            for others in [before, after] {
                for other in others.chunks_exact_mut(stride) {
                    let factor = other[k];
                    if factor != 0.0 {
                        subtract_rows::<V, 1>(other, [row], [factor]);
                    }
                }
            }
            self.late.push(r);
        }
        // what the rows were solved for goes out of the joints' rows, several at once
        for other in motion.chunks_exact_mut(stride) {
            let (mut x, mut a, mut count) = ([&T[..stride]; TOGETHER], [0.0; TOGETHER], 0);
            for &r in &self.late {
                let factor = other[self.pivots[r]];
                if factor == 0.0 {
                    continue;
                }
                (x[count], a[count], count) = (&T[r * stride..][..stride], factor, count + 1);
                if count == TOGETHER {
                    subtract_rows::<V, TOGETHER>(other, x, a);
                    (a, count) = ([0.0; TOGETHER], 0);
                }
            }
            if count > 0 {
                subtract_rows::<V, TOGETHER>(other, x, a);
            }
        }
        true
    }

    /// Finds the place of each column: the columns without a row are the unknowns.
    fn lay_out(&mut self) {
        let Self { tableau: Tableau { nv, rows }, pivots, place, runs, .. } = self;
        runs.iter_mut().for_each(Runs::clear);
        place.fill(Place::Unknown(0));
        let (mut solved, mut unknowns) = ([0, 0], 0);
        for &k in &*pivots {
            let count = &mut solved[usize::from(k >= *nv)];
            place[k] = Place::Row(*count);
            *count += 1;
        }
        for k in 0..*nv + *rows {
            if let Place::Unknown(place) = &mut place[k] {
                *place = unknowns;
                runs[usize::from(k >= *nv)].push(k, unknowns);
                unknowns += 1;
            }
        }
        self.laid_out.clone_from(pivots);
    }
}

struct Run<'a> {
    elimination: &'a mut KktElimination,
    T: &'a mut [f64],
    eliminations: usize,
    dt: f64,
    form: &'a mut InverseDynamicsForm,
    done: &'a mut bool,
}

impl Vectorized for Run<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { elimination: e, T, eliminations, dt, form, done } = self;
        let (Tableau { nv, rows }, stride) = (e.tableau, e.tableau.stride());
        let solved = rows + e.passive;
        e.pivots.clear();
        e.pivots.resize(solved, usize::MAX);
        e.before[..eliminations].iter().flatten().for_each(|(r, k)| e.pivots[*r] = *k);
        let (T, motion) = T.split_at_mut(solved * stride);
        if e.pivots.contains(&usize::MAX) && !e.eliminate::<V>(T, motion) {
            return;
        }
        if e.pivots != e.laid_out {
            e.lay_out();
        }
        let size = form.stride;
        let gather = Gather { runs: &e.runs, states: nv + rows..3 * nv + rows, m: nv - e.passive };

        // U; the dependent steps D; the dependent forces
        form.own.clear();
        form.own.extend(e.runs[0].iter());
        form.efforts.resize(gather.m, size);
        for (row, to) in motion.chunks_exact(stride).zip(form.efforts.numbers.chunks_exact_mut(size)) {
            gather.row::<V>(row, [1.0 / dt, 1.0, 1.0], to);
        }
        form.dependent.clear();
        form.dependent.extend(e.pivots.iter().copied().filter(|k| *k < nv));
        form.steps.resize(form.dependent.len(), size);
        e.forces.resize(solved - form.dependent.len(), size);
        let [mut steps, mut forces] = [&mut form.steps, &mut e.forces].map(|to| to.numbers.chunks_exact_mut(size));
        for (row, &k) in T.chunks_exact(stride).zip(&e.pivots) {
            let (to, by) = match k < nv {
                true => (&mut steps, [-1.0, -dt, -dt]),
                false => (&mut forces, [-1.0 / dt, -1.0, -1.0]),
            };
            gather.row::<V>(row, by, to.next().expect("a row for each pivot"));
        }
        form.steps.mark(size);
        *done = true;
    }
}

/// From the columns (δa, δf, δv, δq) to (w, δv, δq).
struct Gather<'a> {
    runs: &'a [Runs; 2],
    /// Columns of (δv, δq).
    states: Range<usize>,
    m: usize,
}

impl Gather<'_> {
    /// Writes a row's unknowns and states: what one part writes too much, the next goes over.
    #[inline(always)]
    fn row<V: Vector>(&self, row: &[f64], [by_a, by_f, by_x]: [f64; 3], to: &mut [f64]) {
        self.runs[0].copy_scaled::<V>(row, by_a, to);
        self.runs[1].copy_scaled::<V>(row, by_f, to);
        copy_scaled::<V>(&mut to[self.m..], &row[self.states.clone()], by_x);
    }
}

/// Sensitivities of a knot by (w, δv, δq); see [`KktElimination::sensitivities`].
pub(crate) struct Unknowns<'a> {
    elimination: &'a KktElimination,
    form: &'a InverseDynamicsForm,
    dt: f64,
}

impl Unknowns<'_> {
    /// g += c times row k of some rows.
    fn add(&self, rows: &SparseRows, k: usize, c: f64, g: &mut Row<'_>) {
        let row = &rows.numbers[k * self.form.stride..];
        let (u, x) = row.split_at(g.u.len());
        let (v, q) = x.split_at(g.v.len());
        for (g, row) in [(&mut *g.u, u), (&mut *g.v, v), (&mut *g.q, q)] {
            g.iter_mut().zip(row).for_each(|(g, x)| *g += c * x);
        }
    }
}

impl Sensitivities for Unknowns<'_> {
    fn add_control(&self, k: usize, c: f64, g: &mut Row<'_>) {
        self.add(&self.form.efforts, k, c, g); // each control drives one coordinate
    }

    fn add_row(&self, output: Output, row: usize, c: f64, g: &mut Row<'_>) {
        let KktElimination { tableau, passive, place, forces, .. } = self.elimination;
        let per_step = c / self.dt; // δa = (y − δv) / Δt
        match (output, row) {
            (Output::ContactAcceleration, _) => {} // J q̈ + γ = 0
            (Output::Effort, row) if row < *passive => {}
            (Output::Effort, row) => self.add(&self.form.efforts, row - passive, c, g),
            (Output::Acceleration, row) => match place[row] {
                Place::Unknown(k) => g.u[k] += per_step,
                Place::Row(k) => self.add(&self.form.steps, k, per_step, g),
            },
            (Output::Force, row) => match place[tableau.nv + row] {
                Place::Unknown(k) => g.u[k] += c,
                Place::Row(k) => self.add(forces, k, c, g),
            },
        }
    }
}
