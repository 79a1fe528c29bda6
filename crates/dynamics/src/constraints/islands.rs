//! Islands: groups of trees and constraints that are independent of each other.
//!
//! The inertia matrix M has one block for each tree that is attached to the world. The Delassus matrix J M⁻¹ Jᵀ has a
//! nonzero entry for two constraints only if both act on the same tree. An island consists of trees that constraints
//! connect, and of these constraints. Each island is factorised separately. Entries of a row in one island and a column
//! in another island are zero. An island has a range of coordinates and a range of rows. The range of rows is empty for
//! a tree without constraints. Islands with overlapping ranges are merged.

use crate::constraints::plan::Plan;
use alloc::vec;
use alloc::vec::Vec;
use condyle_linalg::elimination_tree::{EliminationTree, NONE};
use condyle_model::Model;
use condyle_spatial::{Matrix, Scalar};
use core::ops::Range;

/// Island: trees and constraints that are computed independently of all other trees and constraints.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Island {
    pub coordinates: Range<usize>,
    /// Indices of the island's constraints (`constraints`), and the rows of these constraints (`rows`).
    pub constraints: Range<usize>,
    pub rows: Range<usize>,
}

/// Returns the smallest range that contains both a and b. The ranges a and b may be empty.
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

    /// Returns the islands of a model with planned constraints. Each coordinate of the model is in one island, and the
    /// islands are sorted by coordinates.
    pub(crate) fn of<R>(model: &Model<R>, plans: &[Plan]) -> Vec<Self> {
        let (nv, tree) = (model.nv(), EliminationTree::new(model, 1));
        // If joints share coordinates, the slots of M's factor differ from the coordinates. Then all trees form one
        // island.
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

    /// Returns the range of the island's entries in column j of a matrix that is stored by columns. The matrix has n
    /// rows, one per coordinate.
    #[inline(always)]
    pub(crate) fn of_column(&self, j: usize, n: usize) -> Range<usize> {
        j * n + self.coordinates.start..j * n + self.coordinates.end
    }

    /// Returns the range of the island's entries in column j of a matrix that is stored by columns. The matrix has one
    /// row per row of J.
    #[inline(always)]
    pub(crate) fn rows_of_column(&self, j: usize, rows: usize) -> Range<usize> {
        j * rows + self.rows.start..j * rows + self.rows.end
    }

    /// Sets the entries in the island's columns that are not in the island's rows to zero. The matrix has n rows, one
    /// per coordinate.
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

/// Sets the entries of all islands in `matrix` to zero. The matrix has one row per row of J and one column per
/// coordinate.
#[inline(always)]
pub(crate) fn clear_rows<S: Scalar>(islands: &[Island], matrix: &mut Matrix<S>) {
    let rows = matrix.nrows();
    for island in islands {
        for j in island.coordinates.clone() {
            matrix.as_mut_slice()[island.rows_of_column(j, rows)].fill(S::zero());
        }
    }
}
