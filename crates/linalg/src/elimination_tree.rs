//! The elimination tree: where the factor of a matrix with the zeros of a tree has entries.
//!
//! If each row of the matrix stands for one column of the tree, that is the tree itself. Where several columns share a row,
//! branches are coupled; the rows are then eliminated in the order of least coupling, and the factor follows the elimination
//! tree of that order (Liu, *The role of elimination trees in sparse factorization*, 1990).

use alloc::collections::BTreeSet;
use alloc::vec::Vec;
use core::iter::successors;

/// A tree of columns, and the rows of a symmetric matrix for which they stand: the matrix may differ from zero where one of
/// two columns is on the other's way to the root.
///
/// A robot's model is one: a column is a degree of freedom of a joint, a row of M a coordinate.
pub trait ColumnTree {
    /// The number of rows of the matrix.
    fn rows(&self) -> usize;
    /// The number of columns: as many as rows, or more if several stand for the same row.
    fn columns(&self) -> usize;
    /// The column before c on the way to the root; its number is smaller than c.
    fn parent(&self, c: usize) -> Option<usize>;
    /// The row for which column c stands.
    fn row(&self, c: usize) -> usize;
}

/// The parents of columns that stand for a row each, in order.
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

/// Stands for the parent of a root.
pub const NONE: usize = usize::MAX;

/// The entries of the factor L that may differ from zero: a tree on *places*, numbered depth first, parents before children.
#[derive(Clone, Debug)]
pub struct EliminationTree {
    /// The row of the matrix that each place stands for. Shape: n.
    pub order: Vec<usize>,
    /// The exchanges that take rows to places, one after the other; none if each column has a row of its own.
    pub swaps: Vec<(usize, usize)>,
    /// The place before it on the way to the root. Shape: n.
    pub parent: Vec<usize>,
    /// The number of places between each and the root. Shape: n.
    pub depth: Vec<usize>,
    /// The first of the consecutive places that are all on its way to the root and end with it. Shape: n.
    pub run: Vec<usize>,
    /// The beginning of each row in `Ltdl::rows`, a multiple of the step, and at the end their length. Shape: n + 1.
    pub first: Vec<usize>,
}

impl EliminationTree {
    /// The elimination tree for some columns, with the factor's rows stored in steps of `step` numbers.
    pub fn new(columns: &(impl ColumnTree + ?Sized), step: usize) -> Self {
        let n = columns.rows();
        if columns.columns() == n {
            let (order, parent): (Vec<_>, Vec<_>) =
                (0..n).map(|c| (columns.row(c), columns.parent(c).unwrap_or(NONE))).unzip();
            return Self::depth_first(&order, &parent, step);
        }
        let mut coupled = vec![BTreeSet::new(); n]; // of each row, those with which it shares an entry of the matrix
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
        // Liu (1990), from the last place to the first
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

    /// The same tree with its places numbered depth first, which does not change the rows.
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
            stack.extend(children[k].iter().map(|&child| (child, place))); // the first child on top
        }
        let mut at: Vec<usize> = (0..n).collect(); // which row stands where, as the exchanges go on
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

/// The rows, last the one that is coupled with the fewest others, before it the one that then is, and so on (Tinney
/// and Walker, *Direct solutions of sparse network equations by optimally ordered triangular factorization*, 1967). Of
/// equals, the one that was coupled with the fewest at first is later, so that a shared row comes before those of
/// one branch.
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
