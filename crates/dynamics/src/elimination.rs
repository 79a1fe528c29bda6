//! Where the factor of an inertia matrix has entries.
//!
//! Without shared coordinates that is the tree of the joints' columns. Joints that share a coordinate (mimic) couple
//! branches; the coordinates are then eliminated in the order of least coupling, and the rows follow the elimination tree
//! of that order (Liu, *The role of elimination trees in sparse factorization*, 1990).

use condyle_model::tree::Column;
use std::collections::BTreeSet;

/// Stands for the parent of a root.
pub(crate) const NONE: usize = usize::MAX;

/// Where L may differ from zero: a tree on *places*, numbered depth first, parents before children.
#[derive(Clone, Debug)]
pub(crate) struct Tree {
    /// The coordinate that each place stands for. Shape: nv.
    pub order: Vec<usize>,
    /// The exchanges that take coordinates to places, one after the other; none without shared coordinates.
    pub swaps: Vec<(usize, usize)>,
    /// The place before it on the way to the root. Shape: nv.
    pub parent: Vec<usize>,
    /// How many places are between it and the root. Shape: nv.
    pub depth: Vec<usize>,
    /// The first of the consecutive places that are all on its way to the root and end with it. Shape: nv.
    pub run: Vec<usize>,
    /// Where its row begins in `Ltdl::rows`, a multiple of the step, and at the end their length. Shape: nv + 1.
    pub first: Vec<usize>,
}

impl Tree {
    /// The tree of a model's columns, for rows stored in steps of `step` numbers.
    pub(crate) fn new(columns: &[Column], nv: usize, step: usize) -> Self {
        if columns.len() == nv {
            let (order, parent): (Vec<_>, Vec<_>) =
                columns.iter().map(|c| (c.coordinate, c.parent.unwrap_or(NONE))).unzip();
            return Self::depth_first(&order, &parent, step);
        }
        let mut coupled = vec![BTreeSet::new(); nv]; // of each coordinate, those with which it shares an entry of M
        for column in columns {
            let (mut e, k) = (column.parent, column.coordinate);
            while let Some(ancestor) = e {
                let i = columns[ancestor].coordinate;
                if i != k {
                    coupled[i].insert(k);
                    coupled[k].insert(i);
                }
                e = columns[ancestor].parent;
            }
        }
        let order = minimum_degree(coupled.clone());
        let mut place = vec![0; nv];
        for (k, &coordinate) in order.iter().enumerate() {
            place[coordinate] = k;
        }
        // Liu (1990), from the last place to the first
        let mut parent = vec![NONE; nv];
        for i in (0..nv).rev() {
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
        let nv = order.len();
        let mut children = vec![Vec::new(); nv];
        let mut stack = Vec::new();
        for k in (0..nv).rev() {
            if parent[k] == NONE { stack.push((k, NONE)) } else { children[parent[k]].push(k) }
        }
        let mut tree = Self {
            order: Vec::with_capacity(nv),
            swaps: Vec::new(),
            parent: Vec::with_capacity(nv),
            depth: Vec::with_capacity(nv),
            run: Vec::with_capacity(nv),
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
        let mut at: Vec<usize> = (0..nv).collect(); // which coordinate stands where, as the exchanges go on
        for place in 0..nv {
            let other = (place..nv).find(|&k| at[k] == tree.order[place]).expect("the order is a permutation");
            if other != place {
                at.swap(place, other);
                tree.swaps.push((place, other));
            }
        }
        tree
    }
}

/// The coordinates, last the one that is coupled with the fewest others, before it the one that then is, and so on (Tinney
/// and Walker, *Direct solutions of sparse network equations by optimally ordered triangular factorization*, 1967). Of
/// equals, the one that was coupled with the fewest at first is later, so that a shared coordinate comes before those of
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
