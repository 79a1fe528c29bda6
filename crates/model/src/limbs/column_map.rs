//! Map of columns. For each step, the map contains the columns of other steps that share matrix entries with the
//! columns of this step. It also contains the indices of these entries.
//!
//! Usually, the ancestors of a step's bodies are in the same lanes as these bodies. If a limb is attached to a body in
//! another lane, this body and its ancestors are in that other lane. The columns of these ancestors are copied, once
//! per call, to indices after all other columns. Then every body of the limb finds the columns that it needs in its own
//! lane.
//!
//! Some data of a column, such as the columns of the factor of M⁻¹, have a different value for each body between the
//! root and the tips. Such data have a slot for each entry of the support.

use super::LANES;
use super::schedule::Schedule;
use super::steps::Step;
use crate::tree::Tree;
use alloc::vec::Vec;
use condyle_spatial::moves::Move;
use core::iter::successors;

/// Indices of columns and of matrix entries.
#[derive(Clone, Debug)]
pub struct ColumnMap {
    /// Columns from the root to the joints of each step, one step after the other.
    pub support: Vec<LaneColumn>,
    /// Pairs of each column in `support` with the own columns of its step.
    pub pairs: Vec<Pair>,
    /// Copies of columns, which are stored after the columns of all steps. Each copy has its source columns, with the
    /// moves between lanes.
    pub copies: Vec<Vec<(usize, Move)>>,
    /// Predecessor of each entry of the support: the entry for the same column in the parent's step. Data are copied
    /// from the predecessor.
    pub predecessors: Vec<Predecessor>,
    /// Partition of all columns into blocks of consecutive columns.
    pub blocks: Vec<ColumnBlock>,
    /// Sizes of the matrices Z D⁻¹ and Zᵀ, where Z = L⁻¹ and M = Lᵀ D L is the inertia matrix.
    pub sizes: Sizes,
}

/// Column of each lane, on the path from the root to the joints of a step.
#[derive(Clone, Copy, Debug)]
pub struct LaneColumn {
    /// Index of the column in arrays indexed by column.
    pub column: usize,
    /// Index in `ColumnMap::pairs` of the first pair of this column with the step's own columns. All pairs of the
    /// column are consecutive.
    pub pair: usize,
}

/// Indices of the entries of a pair of columns in a matrix that is stored by columns, one index for each lane. In a
/// lane without such a pair, the index refers to an entry that the first lane overwrites at the end.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    /// Index of the entry in the row of the step's own column.
    pub in_row: [u32; LANES],
    /// Index of the entry in the column of the step's own column.
    pub in_column: [u32; LANES],
    /// Index of the entry in the matrix Z D⁻¹, where Z = L⁻¹ and M = Lᵀ D L is the inertia matrix.
    pub in_ZD: [u32; LANES],
    /// Index of the entry of Zᵀ.
    pub in_Zt: [u32; LANES],
}

/// Source of the data of a support entry, in the support of the parent's step. The data change from each body to its
/// children.
#[derive(Clone, Debug)]
pub enum Predecessor {
    /// One entry, in the same lanes. For the columns of the step itself, the source is the entry itself.
    InPlace(usize),
    /// Several entries, or entries in other lanes.
    Moved(Vec<(usize, Move)>),
}

/// Run of columns in which each column is the parent of the next one.
#[derive(Clone, Debug)]
pub struct ColumnBlock {
    /// First column of the run.
    pub first: usize,
    /// Number of columns.
    pub count: usize,
    /// All columns on the path from the root to the last column of the run.
    pub path: Vec<usize>,
}

/// Sizes of the two matrices that contain Z = L⁻¹, where M = Lᵀ D L is the inertia matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// Number of rows of both matrices.
    pub rows: usize,
    /// Length of a row of the matrix Z D⁻¹, where Z = L⁻¹ and M = Lᵀ D L is the inertia matrix. A row contains the
    /// columns on the path from the root.
    pub ZD: usize,
    /// Length of a row of the matrix Zᵀ, where Z = L⁻¹ and M = Lᵀ D L is the inertia matrix. A row contains all columns
    /// and is padded to whole vectors.
    pub Zt: usize,
}

impl Sizes {
    fn new(tree: &Tree<f64>) -> Self {
        let depth = tree.columns.iter().map(|c| c.depth + 1).max().unwrap_or(0);
        Self { rows: tree.nv, ZD: depth, Zt: tree.nv.next_multiple_of(2 * LANES) }
    }

    /// Returns the index after all rows of the matrix Z D⁻¹. Lanes without a body write to this index.
    pub fn end_of_ZD(self) -> usize {
        self.rows * self.ZD
    }

    /// Returns the index after all rows of the matrix Zᵀ. Lanes without a body write to this index.
    pub fn end_of_Zt(self) -> usize {
        self.rows * self.Zt
    }
}

/// Maximum number of columns of a block.
const COUNT: usize = 4;

/// Returns the blocks of all columns.
fn blocks(tree: &Tree<f64>) -> Vec<ColumnBlock> {
    let columns = &tree.columns;
    let mut blocks: Vec<ColumnBlock> = Vec::new();
    for c in 0..columns.len() {
        let mut path: Vec<usize> = successors(Some(c), |&c| columns[c].parent).collect();
        path.reverse();
        match blocks.last_mut() {
            Some(block) if c > 0 && columns[c].parent == Some(c - 1) && block.count < COUNT => {
                (block.count, block.path) = (block.count + 1, path);
            }
            _ => blocks.push(ColumnBlock { first: c, count: 1, path }),
        }
    }
    blocks
}

/// Column on the path from the root to the body in a lane.
#[derive(Clone, Copy)]
struct Ancestor {
    /// Index of the column in arrays indexed by column.
    column: usize,
    /// Lane in which the column is.
    lane: usize,
    coordinate: usize,
    /// Entry for this column in the support of the parent's step.
    entry: usize,
}

/// Unfinished entry of the support: the index of its column in arrays indexed by column, and the coordinate of each
/// lane.
type Draft = (usize, [Option<usize>; LANES]);

impl ColumnMap {
    /// Creates the map for the steps of a schedule, and sets the range of each step's support.
    pub(super) fn new(tree: &Tree<f64>, schedule: &Schedule, steps: &mut [Step]) -> Self {
        let sizes = Sizes::new(tree);
        let (support, pairs, copies, predecessors) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut map = Self { support, pairs, copies, predecessors, blocks: blocks(tree), sizes };
        // Lanes without a pair write to the diagonal entry of the first body's last column. The first lane sets this
        // entry last.
        let first = schedule.bodies.get(1).map_or(0, |bodies| bodies[0]);
        let last = tree.nodes[first].idx_v + tree.nodes[first].joint.nv().saturating_sub(1);
        let unused = (last * (tree.nv + 1)) as u32;
        let mut drafts: Vec<Vec<Draft>> = vec![Vec::new()];
        for s in 1..steps.len() {
            let mut draft = map.ancestors(tree, schedule, steps, &drafts, s);
            let (bodies, joint, column) = (schedule.bodies[s], steps[s].joint, steps[s].idx_v);
            let coordinate = |k: usize| bodies.map(|i| (i > 0).then(|| tree.nodes[i].idx_v + k));
            draft.extend((0..joint.nv()).map(|k| (column + k, coordinate(k))));
            let first = map.support.len();
            for &(column, others) in &draft {
                map.support.push(LaneColumn { column, pair: map.pairs.len() });
                for k in 0..joint.nv() {
                    let mut own = coordinate(k);
                    if schedule.in_all_lanes(s) {
                        own[1..].fill(None);
                    }
                    let (in_ZD, in_Zt) = ([sizes.end_of_ZD() as u32; LANES], [sizes.end_of_Zt() as u32; LANES]);
                    let mut pair = Pair { in_row: [unused; LANES], in_column: [unused; LANES], in_ZD, in_Zt };
                    for lane in 0..LANES {
                        if let (Some(d), Some(e)) = (own[lane], others[lane]) {
                            pair.in_row[lane] = (d + tree.nv * e) as u32;
                            pair.in_column[lane] = (e + tree.nv * d) as u32;
                            if !tree.has_mimic() {
                                pair.in_ZD[lane] = (d * sizes.ZD + tree.columns[e].depth) as u32;
                                pair.in_Zt[lane] = (e * sizes.Zt + d) as u32;
                            }
                        }
                    }
                    map.pairs.push(pair);
                }
            }
            let end = map.support.len();
            map.predecessors.extend((map.predecessors.len()..end).map(Predecessor::InPlace)); // the step's own columns
            steps[s].support = (first, end);
            drafts.push(draft);
        }
        map
    }

    /// Returns the columns on the paths from the root to step s, without the columns of step s. Columns in other lanes
    /// are copied.
    fn ancestors(
        &mut self,
        tree: &Tree<f64>,
        schedule: &Schedule,
        steps: &[Step],
        drafts: &[Vec<Draft>],
        s: usize,
    ) -> Vec<Draft> {
        let mut paths: Vec<Vec<Ancestor>> = vec![Vec::new(); LANES];
        for lane in (0..LANES).filter(|&lane| schedule.bodies[s][lane] > 0) {
            let (step, its) = schedule.parent(&tree.nodes, s, lane);
            let first = steps[step].support.0;
            let ancestor = |(k, &(column, coordinates)): (usize, &Draft)| {
                Some(Ancestor { column, lane: its, coordinate: coordinates[its]?, entry: first + k })
            };
            paths[lane] = drafts[step].iter().enumerate().filter_map(ancestor).collect();
        }
        let longest = paths.iter().map(Vec::len).max().unwrap_or(0);
        let behind = steps.last().map_or(0, |last| last.idx_v + last.joint.nv()); // number of columns of all steps
        (0..longest)
            .map(|at| {
                let here = [0, 1, 2, 3].map(|lane| paths[lane].get(at).copied());
                let entries = here.map(|a| a.map(|a| (a.entry, a.lane)));
                self.predecessors.push(match in_place(entries) {
                    Some(entry) => Predecessor::InPlace(entry),
                    None => Predecessor::Moved(moves(entries)),
                });
                // A column of the body that is in all lanes can be read from the own lane.
                let in_all = |column: usize| schedule.shared && column < steps[1].joint.nv();
                let columns = [0, 1, 2, 3]
                    .map(|lane| here[lane].map(|a| (a.column, if in_all(a.column) { lane } else { a.lane })));
                let column = in_place(columns).unwrap_or_else(|| {
                    self.copies.push(moves(columns));
                    behind + self.copies.len() - 1
                });
                (column, here.map(|a| a.map(|a| a.coordinate)))
            })
            .collect()
    }
}

/// Returns the index from which all lanes read, if the index is the same for all lanes and each lane reads from its own
/// lane. `from` contains (index, lane) for each lane.
fn in_place(from: [Option<(usize, usize)>; LANES]) -> Option<usize> {
    let (first, _) = from.iter().flatten().next()?;
    let stays = |(lane, from): (usize, &Option<(usize, usize)>)| from.is_none_or(|from| from == (*first, lane));
    from.iter().enumerate().all(stays).then_some(*first)
}

/// Returns the indices from which lanes read, each with a move between lanes. This function is used if `in_place`
/// returns `None`.
fn moves(from: [Option<(usize, usize)>; LANES]) -> Vec<(usize, Move)> {
    let mut places: Vec<usize> = from.iter().flatten().map(|x| x.0).collect();
    places.sort_unstable();
    places.dedup();
    let pairs = |place: usize| -> Vec<(usize, usize)> {
        (0..LANES).filter_map(|lane| from[lane].filter(|x| x.0 == place).map(|(_, its)| (its, lane))).collect()
    };
    places.into_iter().map(|place| (place, Move::new(&pairs(place)))).collect()
}
