//! Islands: independent parts of a robot and of its constraints.
//!
//! M has one block for each tree that is attached to the world. J M⁻¹ Jᵀ has entries for two constraints only if both
//! act on one tree, or on trees that other constraints connect. So constraints that share no body except the world are
//! factorised separately, and the results are zero elsewhere. An island is a range of coordinates with a range of rows,
//! which is empty for a tree without constraints. Islands with overlapping ranges are merged.

use crate::constraints::plan::Plan;
use alloc::vec;
use alloc::vec::Vec;
use condyle_linalg::elimination_tree::{EliminationTree, NONE};
use condyle_model::Model;
use condyle_spatial::{Matrix, Scalar};
use core::ops::Range;

/// Part that is computed independently of all others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Island {
    pub coordinates: Range<usize>,
    /// Indices of its constraints, and their rows.
    pub constraints: Range<usize>,
    pub rows: Range<usize>,
}

/// Returns the smallest range that contains two ranges, each of which may be empty.
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

    /// Returns the islands of a model with some constraints. Their coordinates are the model's, each once and in order.
    pub(crate) fn of<R>(model: &Model<R>, plans: &[Plan]) -> Vec<Self> {
        let (nv, tree) = (model.nv(), EliminationTree::new(model, 1));
        // If joints share coordinates, slots of the factor are not coordinates.
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

    /// Returns the range of its entries in column j of a matrix with n rows, one per coordinate.
    #[inline(always)]
    pub(crate) fn of_column(&self, j: usize, n: usize) -> Range<usize> {
        j * n + self.coordinates.start..j * n + self.coordinates.end
    }

    /// Returns the range of its entries in column j of a matrix with one row per row of J.
    #[inline(always)]
    pub(crate) fn rows_of_column(&self, j: usize, rows: usize) -> Range<usize> {
        j * rows + self.rows.start..j * rows + self.rows.end
    }

    /// Sets the columns of its coordinates to zero outside of its own rows, in a matrix with n rows, one per
    /// coordinate.
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

/// Sets the entries of all islands to zero, in a matrix with one row per row of J and one column per coordinate.
#[inline(always)]
pub(crate) fn clear_rows<S: Scalar>(islands: &[Island], matrix: &mut Matrix<S>) {
    let rows = matrix.nrows();
    for island in islands {
        for j in island.coordinates.clone() {
            matrix.as_mut_slice()[island.rows_of_column(j, rows)].fill(S::zero());
        }
    }
}
