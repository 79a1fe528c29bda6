//! Islands: parts of a robot, and of its constraints, that know nothing of each other.
//!
//! M has a block for each tree that stands on the world, and J M⁻¹ Jᵀ has entries for two constraints only where both touch
//! one tree, or trees that other constraints tie together. So constraints that share no body, or only the world, are
//! factored apart, and all that is made of them has zeros elsewhere. An island is a range of coordinates with a range of
//! rows, none for a tree without constraints: where the ranges of two would overlap, they are taken for one.

use crate::constraints::plan::Plan;
use alloc::vec;
use alloc::vec::Vec;
use condyle_linalg::elimination_tree::{EliminationTree, NONE};
use condyle_model::Model;
use condyle_spatial::{Matrix, Scalar};
use core::ops::Range;

/// A part that is computed apart from all others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Island {
    pub coordinates: Range<usize>,
    /// Its constraints, by their numbers, and their rows.
    pub constraints: Range<usize>,
    pub rows: Range<usize>,
}

/// What encloses two ranges, of which one may be empty.
fn hull(a: &Range<usize>, b: &Range<usize>) -> Range<usize> {
    match (a.is_empty(), b.is_empty()) {
        (true, _) => b.clone(),
        (_, true) => a.clone(),
        _ => a.start.min(b.start)..a.end.max(b.end),
    }
}

fn overlap(a: &Range<usize>, b: &Range<usize>) -> bool {
    a.start < b.end && b.start < a.end
}

impl Island {
    fn join(&self, other: &Self) -> Self {
        Self {
            coordinates: hull(&self.coordinates, &other.coordinates),
            constraints: hull(&self.constraints, &other.constraints),
            rows: hull(&self.rows, &other.rows),
        }
    }

    fn meets(&self, other: &Self) -> bool {
        overlap(&self.coordinates, &other.coordinates) || overlap(&self.rows, &other.rows)
    }

    /// The islands of a model with some constraints: their coordinates are those of the model, each once and in order.
    pub(crate) fn of<R>(model: &Model<R>, plans: &[Plan]) -> Vec<Self> {
        let (nv, tree) = (model.nv(), EliminationTree::new(model, 1));
        // where joints share coordinates, places are not coordinates
        let roots: Vec<usize> = match tree.swaps.is_empty() {
            true => (0..nv).filter(|&k| tree.parent[k] == NONE).collect(),
            false => vec![0],
        };
        let ends = roots.iter().skip(1).copied().chain([nv]);
        let trees =
            roots.iter().zip(ends).map(|(&start, end)| Self { coordinates: start..end, constraints: 0..0, rows: 0..0 });
        let held = plans.iter().enumerate().map(|(k, plan)| {
            let (least, most) = (plan.coordinates.iter().min(), plan.coordinates.iter().max());
            let coordinates = least.zip(most).map_or(0..0, |(least, most)| *least..most + 1);
            Self { coordinates, constraints: k..k + 1, rows: plan.row..plan.row + plan.rows() }
        });
        let mut islands: Vec<Self> = Vec::new();
        for mut island in trees.chain(held) {
            while let Some(k) = islands.iter().position(|other| other.meets(&island)) {
                island = island.join(&islands.swap_remove(k));
            }
            islands.push(island);
        }
        islands.sort_by_key(|island| island.coordinates.start);
        islands
    }

    /// Its numbers in column j of a matrix with n rows, one for each coordinate.
    #[inline(always)]
    pub(crate) fn of_column(&self, j: usize, n: usize) -> Range<usize> {
        j * n + self.coordinates.start..j * n + self.coordinates.end
    }

    /// Its numbers in column j of a matrix with so many rows, one for each row of J.
    #[inline(always)]
    pub(crate) fn rows_of_column(&self, j: usize, rows: usize) -> Range<usize> {
        j * rows + self.rows.start..j * rows + self.rows.end
    }

    /// Zeros in the columns of its coordinates, but in its own rows, of a matrix with n rows, one for each coordinate.
    #[inline(always)]
    pub(crate) fn clear_beside<T: Copy>(&self, matrix: &mut [T], n: usize, zero: T) {
        if self.coordinates.len() == n {
            return;
        }
        for j in self.coordinates.clone() {
            let own = self.of_column(j, n);
            matrix[j * n..own.start].fill(zero);
            matrix[own.end..(j + 1) * n].fill(zero);
        }
    }
}

/// Zeros in a matrix with a row for each row of J and a column for each coordinate, where there may be something else.
#[inline(always)]
pub(crate) fn clear_rows<S: Scalar>(islands: &[Island], matrix: &mut Matrix<S>) {
    let rows = matrix.nrows();
    for island in islands {
        for j in island.coordinates.clone() {
            matrix.as_mut_slice()[island.rows_of_column(j, rows)].fill(S::zero());
        }
    }
}
