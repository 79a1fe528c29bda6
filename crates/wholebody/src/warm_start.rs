//! Last solution. The next solve starts from it, even if the set of contacts has changed.
//!
//! Every unknown and every constraint has a fixed index, from a numbering in which all contacts touch. Forces are
//! stored divided by their contact's activation, so that a force at a ramped limit stays at the limit. When a contact
//! begins, the starting values of its forces are the values at the end of its last contact phase.

use crate::cone_program::{Multipliers, Size};

/// Indices of the unknowns and constraints in use, from a numbering in which all contacts touch.
pub(crate) struct Places {
    pub unknowns: Vec<usize>,
    /// Scale of each unknown in use: the activation of its contact for a force, otherwise 1.
    pub units: Vec<f64>,
    pub equalities: Vec<usize>,
    pub rows: Vec<usize>,
    pub cone_rows: Vec<usize>,
}

impl Places {
    pub(crate) fn new(capacity: Size) -> Self {
        let Size { unknowns, equalities, rows, cone_rows } = capacity;
        Self {
            unknowns: Vec::with_capacity(unknowns),
            units: Vec::with_capacity(unknowns),
            equalities: Vec::with_capacity(equalities),
            rows: Vec::with_capacity(rows),
            cone_rows: Vec::with_capacity(cone_rows),
        }
    }

    pub(crate) fn clear(&mut self) {
        let Self { unknowns, units, equalities, rows, cone_rows } = self;
        units.clear();
        [unknowns, equalities, rows, cone_rows].into_iter().for_each(Vec::clear);
    }
}

/// The last solution with entries for all contacts, and a copy of the entries that the present program needs.
pub(crate) struct WarmStart {
    /// Whether a solution is stored.
    pub known: bool,
    pub all: Point,
    asked: Point,
}

/// x and the multipliers.
pub(crate) struct Point {
    x: Vec<f64>,
    equalities: Vec<f64>,
    rows: Vec<f64>,
    cones: Vec<f64>,
}

impl Point {
    fn new(capacity: Size) -> Self {
        let Size { unknowns, equalities, rows, cone_rows } = capacity;
        Self {
            x: vec![0.0; unknowns],
            equalities: vec![0.0; equalities],
            rows: vec![0.0; rows],
            cones: vec![0.0; cone_rows],
        }
    }

    pub(crate) fn parts(&self) -> [&Vec<f64>; 4] {
        [&self.x, &self.equalities, &self.rows, &self.cones]
    }

    pub(crate) fn parts_mut(&mut self) -> [&mut Vec<f64>; 4] {
        [&mut self.x, &mut self.equalities, &mut self.rows, &mut self.cones]
    }
}

impl WarmStart {
    pub(crate) fn new(capacity: Size) -> Self {
        Self { known: false, all: Point::new(capacity), asked: Point::new(capacity) }
    }

    pub(crate) fn forget(&mut self) {
        self.known = false;
    }

    /// Stores a solution. Equalities that were not passed to the solver have no multipliers.
    pub(crate) fn keep(&mut self, places: &Places, x: &[f64], multipliers: Multipliers<'_>) {
        let Point { x: all_x, equalities, rows, cones } = &mut self.all;
        for (all, places, values) in [
            (all_x, &places.unknowns, x),
            (equalities, &places.equalities, multipliers.equalities),
            (rows, &places.rows, multipliers.rows),
            (cones, &places.cone_rows, multipliers.cones),
        ] {
            places.iter().zip(values).for_each(|(&place, &value)| all[place] = value);
        }
        for (&place, unit) in places.unknowns.iter().zip(&places.units) {
            self.all.x[place] /= unit;
        }
        self.known = true;
    }

    /// Returns the stored x and multipliers for a program, or `None` if no solution is stored.
    pub(crate) fn recall(&mut self, places: &Places) -> Option<(&[f64], Multipliers<'_>)> {
        let Self { known, all, asked } = self;
        let gather = |to: &mut [f64], places: &[usize], all: &[f64]| {
            to.iter_mut().zip(places).for_each(|(to, &place)| *to = all[place]);
        };
        gather(&mut asked.x, &places.unknowns, &all.x);
        gather(&mut asked.equalities, &places.equalities, &all.equalities);
        gather(&mut asked.rows, &places.rows, &all.rows);
        gather(&mut asked.cones, &places.cone_rows, &all.cones);
        let Point { x, equalities, rows, cones } = asked;
        x.iter_mut().zip(&places.units).for_each(|(x, unit)| *x *= unit);
        let multipliers = Multipliers {
            equalities: &equalities[..places.equalities.len()],
            rows: &rows[..places.rows.len()],
            cones: &cones[..places.cone_rows.len()],
        };
        known.then_some((&x[..places.unknowns.len()], multipliers))
    }
}
