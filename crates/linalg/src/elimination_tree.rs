//! Elimination tree: the entries of the factor of a matrix whose zeros follow a tree.
//!
//! If each row of the matrix corresponds to one column of the tree, the elimination tree is that tree. If several
//! columns share a row, branches are coupled. The rows are then eliminated in an order of minimum degree, and the
//! factor follows the elimination tree of this order (Liu, *The role of elimination trees in sparse factorization*,
//! 1990).

use alloc::collections::BTreeSet;
use alloc::vec::Vec;
use core::iter::successors;

/// Tree of columns, and the row of a symmetric matrix to which each column corresponds. An entry of the matrix may
/// differ from zero if one of its two columns is on the path from the other column to the root.
///
/// A robot's model is such a tree: a column is a degree of freedom of a joint, and a row of the inertia matrix is a
/// coordinate.
pub trait ColumnTree {
    /// Returns the number of rows of the matrix.
    fn rows(&self) -> usize;
    /// Returns the number of columns. It exceeds the number of rows if several columns share a row.
    fn columns(&self) -> usize;
    /// Returns the parent of column c on the path to the root. The index of the parent is smaller than c.
    fn parent(&self, c: usize) -> Option<usize>;
    /// Returns the row to which column c corresponds.
    fn row(&self, c: usize) -> usize;
}

/// Tree given by the parent of each column; column c corresponds to row c.
impl ColumnTree for [Option<usize>] {
    fn rows(&self) -> usize {
        self.len()
    }
    fn columns(&self) -> usize {
        self.len()
    }
    fn parent(&self, c: usize) -> Option<usize> {
        self[c]
    }
    fn row(&self, c: usize) -> usize {
        c
    }
}

/// Parent of a root.
pub const NONE: usize = usize::MAX;

/// Pattern of the factor L: the entries that may differ from zero. The pattern is a tree of positions, numbered depth
/// first, parents before children.
#[derive(Clone, Debug)]
pub struct EliminationTree {
    /// Row of the matrix that is moved to each position. Length: the number of rows.
    pub order: Vec<usize>,
    /// Exchanges that move rows to their positions, in the order of execution; empty if each column has its own row.
    pub swaps: Vec<(usize, usize)>,
    /// Parent of each position on the path to the root, or [`NONE`]. Length: the number of rows.
    pub parent: Vec<usize>,
    /// Depth of each position: the number of steps to the root of its tree. Length: the number of rows.
    pub depth: Vec<usize>,
    /// First position of the run that ends with each position. A run consists of consecutive positions on a path to the
    /// root. Length: the number of rows.
    pub run: Vec<usize>,
    /// Offset of each row in `Ltdl::rows`, a multiple of the step to which rows are padded. The last entry is the total
    /// length of the rows. Length: the number of rows plus 1.
    pub first: Vec<usize>,
}

impl EliminationTree {
    /// Computes the elimination tree of a tree of columns. The factor's rows are padded to a multiple of `step`
    /// numbers.
    pub fn new(columns: &(impl ColumnTree + ?Sized), step: usize) -> Self {
        let n = columns.rows();
        if columns.columns() == n {
            let (order, parent): (Vec<_>, Vec<_>) =
                (0..n).map(|c| (columns.row(c), columns.parent(c).unwrap_or(NONE))).unzip();
            return Self::depth_first(&order, &parent, step);
        }
        // For each row, collects the rows with which it shares an entry of the matrix.
        let mut coupled = vec![BTreeSet::new(); n];
        for c in 0..columns.columns() {
            let k = columns.row(c);
            for ancestor in successors(columns.parent(c), |&c| columns.parent(c)) {
                let i = columns.row(ancestor);
                if i != k {
                    coupled[i].insert(k);
                    coupled[k].insert(i);
                }
            }
        }
        let order = minimum_degree(coupled.clone());
        let mut place = vec![0; n];
        for (k, &row) in order.iter().enumerate() {
            place[row] = k;
        }
        // Computes the parents by the algorithm of Liu (1990), from the last position to the first.
        let mut parent = vec![NONE; n];
        for i in (0..n).rev() {
            for k in coupled[order[i]].iter().map(|&k| place[k]).filter(|&k| k > i) {
                let mut root = k;
                while parent[root] != NONE && parent[root] != i {
                    root = parent[root];
                }
                if root != i {
                    parent[root] = i;
                }
            }
        }
        Self::depth_first(&order, &parent, step)
    }

    /// Numbers the positions of a tree depth first. This does not change the rows of the factor.
    fn depth_first(order: &[usize], parent: &[usize], step: usize) -> Self {
        let n = order.len();
        let mut children = vec![Vec::new(); n];
        let mut stack = Vec::new();
        for k in (0..n).rev() {
            if parent[k] == NONE { stack.push((k, NONE)) } else { children[parent[k]].push(k) }
        }
        let mut tree = Self {
            order: Vec::with_capacity(n),
            swaps: Vec::new(),
            parent: Vec::with_capacity(n),
            depth: Vec::with_capacity(n),
            run: Vec::with_capacity(n),
            first: vec![0],
        };
        while let Some((k, parent)) = stack.pop() {
            let place = tree.order.len();
            tree.order.push(order[k]);
            tree.parent.push(parent);
            tree.depth.push(if parent == NONE { 0 } else { tree.depth[parent] + 1 });
            tree.run.push(if parent != NONE && parent + 1 == place { tree.run[parent] } else { place });
            tree.first.push(tree.first[place] + (tree.depth[place] + 1).next_multiple_of(step));
            stack.extend(children[k].iter().map(|&child| (child, place))); // puts the first child on top
        }
        let mut at: Vec<usize> = (0..n).collect(); // row at each position, while the exchanges are recorded
        for place in 0..n {
            let other = (place..n).find(|&k| at[k] == tree.order[place]).expect("the order is a permutation");
            if other != place {
                at.swap(place, other);
                tree.swaps.push((place, other));
            }
        }
        tree
    }
}

/// Returns the rows in an order of minimum degree. The last row is the row that is coupled with the fewest other rows.
/// The row before it is coupled with the fewest of the remaining rows, and so on. Source: Tinney and Walker, *Direct
/// solutions of sparse network equations by optimally ordered triangular factorization* (1967).
///
/// Among rows with the same number of couplings, the row with the fewest initial couplings comes last. So a row that
/// several branches share comes before a row of only one branch.
fn minimum_degree(mut coupled: Vec<BTreeSet<usize>>) -> Vec<usize> {
    let at_first: Vec<usize> = coupled.iter().map(BTreeSet::len).collect();
    let mut left: BTreeSet<usize> = (0..coupled.len()).collect();
    let mut order = Vec::new();
    while let Some(&k) = left.iter().rev().min_by_key(|&&k| (coupled[k].len(), at_first[k])) {
        left.remove(&k);
        order.push(k);
        let others = core::mem::take(&mut coupled[k]);
        for &i in &others {
            coupled[i].extend(&others);
            coupled[i].remove(&i);
            coupled[i].remove(&k);
        }
    }
    order.reverse();
    order
}
