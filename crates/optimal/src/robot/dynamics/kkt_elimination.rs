//! Elimination of the dependent unknowns from the equations of motion of a knot in contact: see
//! [`InverseDynamicsForm`].
//!
//! Changes of accelerations a and forces f satisfy the following equations. The right column names what each group of
//! rows is solved for:
//!
//! ```text
//! J δa            + c_v δv + c_q δq = 0         contacts do not accelerate   → accelerations of the limbs in contact
//! M_b δa − J_bᵀ δf + r_v δv + r_q δq = 0         the base has no motor        → forces, or else accelerations
//! M_j δa − J_jᵀ δf + r_v δv + r_q δq = δu        motors drive the joints      → δu
//! ```
//!
//! Gauss–Jordan elimination solves each row of the first two groups for one unknown. It chooses the unknown with the
//! largest entry among the row's preferred unknowns. Rows of a contact prefer joints that move no other contact. If the
//! entries of these joints are too small (a straight knee), any acceleration may be chosen. Rows of the base prefer
//! forces. A pivot is missing only if contacts are redundant; the knot is then not written in inverse-dynamics form. In
//! most cases, the limbs in contact and then the base have been eliminated before, for several knots together: see
//! [`limb_elimination`](super::limb_elimination).
#![allow(non_snake_case)] // names follow the literature: J, M, T, U, D

use crate::lq::InverseDynamicsForm;
use crate::robot::knot_data::Sensitivities;
use crate::robot::outputs::Output;
use crate::robot::residuals::rows::Row;
use condyle_linalg::{Runs, SLACK, SparseRows, Vector, Vectorized, at_level, copy_scaled, max_abs, subtract_rows};
use core::ops::Range;

/// Smallest accepted pivot among the preferred unknowns, relative to the row's largest entry.
pub(super) const PREFERENCE: f64 = 1e-2;
/// Largest pivot that counts as zero, relative to the row's largest entry before the elimination.
const REDUNDANT: f64 = 1e-7;

/// Size of the tableau of a knot. The tableau has a row for each row of a contact and for each coordinate, and columns
/// for (δa, δf, δv, δq).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tableau {
    pub nv: usize,
    /// Number of constraint rows of all contacts.
    pub rows: usize,
}

condyle_spatial::same_layout!(Tableau);

impl Tableau {
    /// Returns the stride of the tableau: the distance from one row to the next.
    pub(crate) fn stride(self) -> usize {
        3 * self.nv + self.rows + SLACK
    }

    /// Returns the number of entries of the tableau.
    pub(crate) fn len(self) -> usize {
        (self.rows + self.nv) * self.stride()
    }
}

/// Elimination for one set of contacts, with its workspace.
#[derive(Debug)]
pub(crate) struct KktElimination {
    tableau: Tableau,
    /// Number of coordinates without motor, which are the first coordinates.
    passive: usize,
    /// Preferred columns of each contact row: coordinates for which the row is solved if the pivot is large enough.
    preferred: Vec<Vec<usize>>,
    /// Rows that earlier eliminations have solved, each with its column, in the order of these eliminations.
    before: Vec<Vec<(usize, usize)>>,
    /// Column for which each row was solved.
    pivots: Vec<usize>,
    /// Rows that remain for this elimination.
    late: Vec<usize>,
    /// Pivots for which `place` and `runs` are valid.
    laid_out: Vec<usize>,
    /// Location of each column of δa and δf: the index of an unknown, or else a row of D or `forces`, which gives the
    /// value.
    place: Vec<Place>,
    /// Map from the columns of δa, and map from the columns of δf, to the indices of unknowns.
    runs: [Runs; 2],
    /// Forces that are not unknowns, as rows with columns for (w, δv, δq).
    forces: SparseRows,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    Unknown(usize),
    Row(usize),
}

/// Returns the coordinates with motor that move the contact of row r and no other contact.
pub(super) fn own_coordinates(moved_by: &[Vec<usize>], r: usize, passive: usize) -> Vec<usize> {
    let alone = |k: &usize| moved_by.iter().all(|other| *other == moved_by[r] || !other.contains(k));
    moved_by[r].iter().copied().filter(|k| *k >= passive && alone(k)).collect()
}

impl KktElimination {
    /// Creates the elimination for a robot in contact whose first `passive` coordinates have no motor. `moved_by`
    /// lists, for each contact row, the coordinates that move the contact.
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

    /// Sets the rows that earlier eliminations solve: see
    /// [`LimbElimination::solved`](super::limb_elimination::LimbElimination::solved).
    pub(crate) fn follow(&mut self, before: Vec<Vec<(usize, usize)>>) {
        self.before = before;
    }

    /// Returns the best columns for solving the rows of the base, in a tableau whose limbs have been eliminated.
    pub(crate) fn base_pivots(&mut self, tableau: &mut [f64]) -> Option<Vec<usize>> {
        let (mut form, Tableau { nv, rows }) = (InverseDynamicsForm::default(), self.tableau);
        form.reserve(nv, nv - self.passive, [self.most_dependent(), 0]);
        self.run(tableau, 1, 1.0, &mut form).then(|| self.pivots[rows..].to_vec())
    }

    /// Returns the maximum number of coordinates that are not unknowns.
    pub(crate) fn most_dependent(&self) -> usize {
        self.tableau.rows + self.passive
    }

    /// Writes U and D for steps of Δt, from a tableau in which earlier eliminations have been done. Returns whether all
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

    /// Returns the sensitivities of the outputs with respect to (w, δv, δq). The matrices U and D of the knot are in
    /// `form`.
    pub(crate) fn sensitivities<'a>(&'a self, form: &'a InverseDynamicsForm, dt: f64) -> Unknowns<'a> {
        Unknowns { elimination: self, form, dt }
    }

    /// Returns the column with the row's largest entry among `columns`, and this entry.
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

    /// Returns the column for which row r will be solved; `None` without a pivot.
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
        (pivot.abs() > REDUNDANT * scale[0]).then_some(k) // a NaN is no pivot
    }
}

/// Number of rows that are subtracted in one call: the six coordinates of a free base.
const TOGETHER: usize = 6;

impl KktElimination {
    /// Solves the rows that have no pivot yet. Returns whether all rows then have a pivot.
    #[inline(always)]
    fn eliminate<V: Vector>(&mut self, T: &mut [f64], motion: &mut [f64]) -> bool {
        let (Tableau { nv, rows }, stride) = (self.tableau, self.tableau.stride());
        let mut force_scale = 0.0_f64;
        for row in T.chunks_exact(stride).skip(rows) {
            force_scale = force_scale.max(max_abs(&row[nv..][..rows]));
        }
        self.laid_out.clear(); // the next lines overwrite `place`
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
            // a row whose pivot is small relative to `scale` depends on other rows; contact rows have the scale 1
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
        // eliminates the solved unknowns from the rows of the joints, several solved rows per call
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

    /// Computes `place` for each column. The unknowns are the columns for which no row was solved.
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
        let mut is_laid_out = e.laid_out.len() == solved;
        for r in 0..if is_laid_out { solved } else { 0 } {
            is_laid_out &= e.pivots[r] == e.laid_out[r];
        }
        if !is_laid_out {
            e.lay_out();
        }
        let size = form.stride;
        let gather = Gather { runs: &e.runs, states: nv + rows..3 * nv + rows, m: nv - e.passive };

        // writes the rows of U, then the rows of D for dependent coordinates, then the rows of dependent forces
        form.own.clear();
        form.own.extend(e.runs[0].iter());
        form.efforts.resize(gather.m, size);
        for k in 0..gather.m {
            let to = &mut form.efforts.numbers[k * size..(k + 1) * size];
            gather.row::<V>(&motion[k * stride..(k + 1) * stride], [1.0 / dt, 1.0, 1.0], to);
        }
        form.has_masks = solved > 0; // an arm without solved rows rarely needs masks
        if form.has_masks {
            form.efforts.mark(size); // while the rows are in the cache
        }
        form.dependent.clear();
        form.dependent.extend(e.pivots.iter().copied().filter(|k| *k < nv));
        form.steps.resize(form.dependent.len(), size);
        e.forces.resize(solved - form.dependent.len(), size);
        let (mut steps, mut forces) = (0, 0); // numbers of rows that are written
        for r in 0..solved {
            let (to, count, by) = match e.pivots[r] < nv {
                true => (&mut form.steps, &mut steps, [-1.0, -dt, -dt]),
                false => (&mut e.forces, &mut forces, [-1.0 / dt, -1.0, -1.0]),
            };
            let to = &mut to.numbers[*count * size..(*count + 1) * size];
            gather.row::<V>(&T[r * stride..(r + 1) * stride], by, to);
            *count += 1;
        }
        form.steps.mark(size);
        *done = true;
    }
}

/// Map that copies the columns (δa, δf, δv, δq) of a row to the columns (w, δv, δq).
struct Gather<'a> {
    runs: &'a [Runs; 2],
    /// Range of the columns of (δv, δq).
    states: Range<usize>,
    m: usize,
}

impl Gather<'_> {
    /// Copies the columns of the unknowns and of the states of a row. A copy may write entries beyond its end; the next
    /// copy overwrites these entries.
    #[inline(always)]
    fn row<V: Vector>(&self, row: &[f64], [by_a, by_f, by_x]: [f64; 3], to: &mut [f64]) {
        self.runs[0].copy_scaled::<V>(row, by_a, to);
        self.runs[1].copy_scaled::<V>(row, by_f, to);
        copy_scaled::<V>(&mut to[self.m..], &row[self.states.clone()], by_x);
    }
}

/// Sensitivities of a knot's outputs with respect to (w, δv, δq); see [`KktElimination::sensitivities`].
pub(crate) struct Unknowns<'a> {
    elimination: &'a KktElimination,
    form: &'a InverseDynamicsForm,
    dt: f64,
}

impl Unknowns<'_> {
    /// Adds c times row k of `rows` to g.
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
