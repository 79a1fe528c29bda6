//! Which columns of other steps the columns of a step meet in matrices, and where the entries of such pairs stand.
//!
//! Of the bodies of a step, those before them stand in the same lanes, step by step, until a limb hangs on a body in
//! another lane. Columns from there to the root are copied: into places behind those of all columns, once a call, so that
//! whatever comes further out finds all that it needs in its own lanes.
//!
//! What belongs to a column and changes from body to body on the way out (`inverse.rs`) has a place for each link.

use super::{LANES, Plan};
use crate::tree::Tree;
use condyle_spatial::moves::Move;

/// A column of each lane, among those from the root to a step's joints.
#[derive(Clone, Copy, Debug)]
pub struct Link {
    /// Where it stands in arrays by columns.
    pub slot: usize,
    /// Where its pairs with the step's own columns stand in `Plan::pairs`, one after the other.
    pub pair: usize,
}

/// Where the entries of a pair of columns stand, one in each lane, in a matrix stored by columns. Lanes that have no such
/// pair point to an entry that is set after all others, and there by the first lane.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    /// In the row of the step's own column.
    pub below: [u32; LANES],
    /// In the column of the step's own column.
    pub right: [u32; LANES],
    /// In the two matrices of `inverse.rs`.
    pub deep: [u32; LANES],
    pub wide: [u32; LANES],
}

/// From where a link gets what changes on the way out.
#[derive(Clone, Debug)]
pub enum Before {
    /// From this link, in the same lanes; the step's own columns from themselves.
    Here(usize),
    /// From several links or lanes.
    Apart(Vec<(usize, Move)>),
}

/// Some columns of which each carries the next, and all columns from the root to the last of them.
#[derive(Clone, Debug)]
pub struct Block {
    pub first: usize,
    pub many: usize,
    pub way: Vec<usize>,
}

/// How large the two matrices are that hold Z = L⁻¹ of the inertia matrix, row by row.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sizes {
    pub rows: usize,
    /// The length of a row that has the columns from the root on.
    pub deep: usize,
    /// The length of a row that has all columns, in whole vectors.
    pub wide: usize,
}

impl Sizes {
    /// For a robot's inertia matrix.
    fn new(tree: &Tree<f64>) -> Self {
        let deep = tree.columns.iter().map(|c| c.depth + 1).max().unwrap_or(0);
        Self { rows: tree.nv, deep, wide: tree.nv.next_multiple_of(2 * LANES) }
    }

    /// The place behind all rows: of what lanes without a body write.
    pub fn deep_behind(self) -> usize {
        self.rows * self.deep
    }

    /// The same of the other matrix.
    pub fn wide_behind(self) -> usize {
        self.rows * self.wide
    }
}

/// How many rows a block has at most.
const ROWS: usize = 4;

/// The blocks of all columns.
fn blocks(tree: &Tree<f64>) -> Vec<Block> {
    let columns = &tree.columns;
    let mut blocks: Vec<Block> = Vec::new();
    for c in 0..columns.len() {
        let mut way: Vec<usize> = std::iter::successors(Some(c), |&c| columns[c].parent).collect();
        way.reverse();
        match blocks.last_mut() {
            Some(block) if c > 0 && columns[c].parent == Some(c - 1) && block.many < ROWS => {
                (block.many, block.way) = (block.many + 1, way);
            }
            _ => blocks.push(Block { first: c, many: 1, way }),
        }
    }
    blocks
}

/// A column of a lane on the way from the root: its slot, lane and coordinate, and its link to the lane's body.
type Item = (usize, usize, usize, usize);

/// A link under construction: its slot, and the coordinate in each lane.
type Draft = (usize, [Option<usize>; LANES]);

impl Plan {
    /// Fills in the links of all steps.
    pub(super) fn add_links(&mut self, tree: &Tree<f64>) {
        let mut drafts: Vec<Vec<Draft>> = vec![Vec::new()];
        let first = self.bodies.get(1).map_or(0, |bodies| bodies[0]); // whose last column is set last, in the first lane
        let last = tree.nodes[first].idx_v + tree.nodes[first].joint.nv().saturating_sub(1);
        let unused = (last * (tree.nv + 1)) as u32;
        let sizes = Sizes::new(tree);
        self.sizes = sizes;
        self.blocks = blocks(tree);
        for s in 1..self.steps.len() {
            let mut draft = self.before(tree, &drafts, s);
            let (bodies, joint, slot) = (self.bodies[s], self.steps[s].joint, self.steps[s].idx_v);
            let coordinate = |k: usize| bodies.map(|i| (i > 0).then(|| tree.nodes[i].idx_v + k));
            draft.extend((0..joint.nv()).map(|k| (slot + k, coordinate(k))));
            let first = self.links.len();
            for &(slot, others) in &draft {
                self.links.push(Link { slot, pair: self.pairs.len() });
                for k in 0..joint.nv() {
                    let mut own = coordinate(k);
                    if self.in_all_lanes(s) {
                        own[1..].fill(None);
                    }
                    let (deep, wide) = ([sizes.deep_behind() as u32; LANES], [sizes.wide_behind() as u32; LANES]);
                    let mut pair = Pair { below: [unused; LANES], right: [unused; LANES], deep, wide };
                    for lane in 0..LANES {
                        if let (Some(d), Some(e)) = (own[lane], others[lane]) {
                            (pair.below[lane], pair.right[lane]) = ((d + tree.nv * e) as u32, (e + tree.nv * d) as u32);
                            if !tree.has_mimic() {
                                pair.deep[lane] = (d * sizes.deep + tree.columns[e].depth) as u32;
                                pair.wide[lane] = (e * sizes.wide + d) as u32;
                            }
                        }
                    }
                    self.pairs.push(pair);
                }
            }
            let last = self.links.len();
            self.before.extend((self.before.len()..last).map(Before::Here)); // the step's own
            self.steps[s].links = (first, last);
            let hangs_here = |&i: &usize| i > 0 && self.place[tree.nodes[i].parent].0 == s;
            self.steps[s].tip = !self.bodies.iter().flatten().any(hangs_here);
            drafts.push(draft);
        }
    }

    /// The columns before those of step s, with copies of what stands elsewhere.
    fn before(&mut self, tree: &Tree<f64>, drafts: &[Vec<Draft>], s: usize) -> Vec<Draft> {
        let mut ways: Vec<Vec<Item>> = vec![Vec::new(); LANES];
        for lane in (0..LANES).filter(|&lane| self.bodies[s][lane] > 0) {
            let (step, its) = self.place[tree.nodes[self.bodies[s][lane]].parent];
            let its = if self.in_all_lanes(step) { lane } else { its };
            let columns = drafts[step].iter().enumerate();
            let link = self.steps[step].links.0;
            ways[lane] = columns.filter_map(|(at, (slot, c))| c[its].map(|c| (*slot, its, c, link + at))).collect();
        }
        let longest = ways.iter().map(Vec::len).max().unwrap_or(0);
        (0..longest)
            .map(|at| {
                let here = [0, 1, 2, 3].map(|lane| ways[lane].get(at).copied());
                let of_links = [0, 1, 2, 3].map(|lane| here[lane].map(|(_, its, _, link)| (link, its)));
                self.before.push(match in_place(of_links) {
                    Some(link) => Before::Here(link),
                    None => Before::Apart(moves(of_links)),
                });
                // a column in all lanes is in this one, too
                let in_all = |slot: usize| self.shared && slot < self.steps[1].joint.nv();
                let of_slots = [0, 1, 2, 3]
                    .map(|lane| here[lane].map(|(slot, its, ..)| (slot, if in_all(slot) { lane } else { its })));
                let slot = in_place(of_slots).unwrap_or_else(|| {
                    self.copies.push(moves(of_slots));
                    self.coordinates.len() + self.copies.len() - 1
                });
                (slot, here.map(|x| x.map(|(_, _, coordinate, _)| coordinate)))
            })
            .collect()
    }
}

/// Of each lane the place and lane from where something comes: the place, if it is the same for all, and no lane changes.
fn in_place(from: [Option<(usize, usize)>; LANES]) -> Option<usize> {
    let (first, _) = from.iter().flatten().next()?;
    let stays = |(lane, from): (usize, &Option<(usize, usize)>)| from.is_none_or(|from| from == (*first, lane));
    from.iter().enumerate().all(stays).then_some(*first)
}

/// The same otherwise: what comes from which place.
fn moves(from: [Option<(usize, usize)>; LANES]) -> Vec<(usize, Move)> {
    let mut places: Vec<usize> = from.iter().flatten().map(|x| x.0).collect();
    places.sort_unstable();
    places.dedup();
    let pairs = |place: usize| -> Vec<(usize, usize)> {
        (0..LANES).filter_map(|lane| from[lane].filter(|x| x.0 == place).map(|(_, its)| (its, lane))).collect()
    };
    places.into_iter().map(|place| (place, Move::new(&pairs(place)))).collect()
}
