//! Which pieces of a tree of bodies are put together in which order: the plan of the divide-and-conquer algorithm.
//!
//! Source: Featherstone, *A divide-and-conquer articulated-body algorithm for parallel O(log(n)) calculation of
//! rigid-body dynamics*, part 2: trees, loops and accuracy (1999), who leaves the choice of the assembly tree open. Here
//! a tree falls into heavy paths (Sleator and Tarjan, *A data structure for dynamic trees*, 1983): from each body the
//! path goes on to the child that carries most. A path is cut in two where both halves, with all that hangs on them,
//! weigh most nearly the same, and so on; the subtrees that hang on a body are paths of their own. A chain of n bodies
//! thus has ⌈log₂ n⌉ levels of joins, and any tree O(log n). No cut is made below a body that without its load would not
//! resist its own joint (one without mass, say): the piece above the cut could not be solved on its own.

use alloc::vec::Vec;
use condyle_model::{Body, Model};
use condyle_spatial::{Act, ArticulatedInertia, Se3, Vec3};

/// A joint whose inertia is a smaller part of its body's mass (kg) and rotational inertia (kg m²) counts as without any.
const FREE: f64 = 1e-9;

/// Stands for the handle above a piece in place of a parent among its links.
pub(crate) const HANDLE: usize = usize::MAX;

/// The way in which a piece is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Some bodies, connected with each other or with the body above, one after the other.
    Run,
    /// One body, and what the piece that follows makes of the subtrees on it.
    Hub,
    /// The piece that follows, and below it the one after that.
    Join,
    /// The piece that follows and the one after that, both on the same body.
    Gather,
}

/// A piece. Those of which it is made follow it, and so do its bodies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    pub kind: Kind,
    /// Another piece hangs on its last body: it has two handles.
    pub open: bool,
    /// The number of its bodies.
    pub links: usize,
    /// The number of degrees of freedom of their joints.
    pub dofs: usize,
    /// The number of pieces of which it is made, itself included.
    pub pieces: usize,
    /// The number of pieces on the longest way from it to a run, itself included.
    levels: usize,
}

/// A body in the order of the pieces.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    pub body: usize,
    /// The first of its degrees of freedom, counted from the piece's first.
    pub dof: usize,
    /// The parent's place in the run, or [`HANDLE`].
    pub parent: usize,
    /// It is on the way from the handle above to the one below.
    pub spine: bool,
}

/// The cost of an assembly, counted.
///
/// ```
/// use condyle_dynamics::{AssemblySize, DivideConquer, robots};
/// let arm = DivideConquer::<f64>::new(&robots::arm7(), 1);
/// assert_eq!(arm.size(), AssemblySize { bodies: 7, runs: 7, longest_run: 1, joins: 6, gathers: 0, levels: 4 });
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AssemblySize {
    /// Moving bodies: each is eliminated once.
    pub bodies: usize,
    /// Pieces within which bodies are eliminated one after the other.
    pub runs: usize,
    /// Bodies in the largest of them.
    pub longest_run: usize,
    /// Pairs of pieces that are joined, one below the other.
    pub joins: usize,
    /// Pairs of pieces that are added up, both on one body.
    pub gathers: usize,
    /// The number of pieces, from a run to the whole, that wait for one another.
    pub levels: usize,
}

/// All pieces, the whole first.
#[derive(Clone, Debug)]
pub(crate) struct Assembly {
    pub pieces: Vec<Piece>,
    pub links: Vec<Link>,
}

impl Assembly {
    /// Runs have at most `grain` bodies, or more where no cut can be made.
    pub(crate) fn new<R>(model: &Model<R>, grain: usize) -> Self {
        let bodies = model.bodies().len();
        let mut children = vec![Vec::new(); bodies];
        let mut weight = vec![1; bodies];
        for i in (1..bodies).rev() {
            let parent = model.bodies()[i].parent;
            children[parent].push(i);
            weight[parent] += weight[i];
        }
        for children in &mut children {
            children.sort_by_key(|&i| (usize::MAX - weight[i], i)); // the heaviest first
        }
        let nv = model.bodies().iter().map(|b| b.joint.nv()).collect();
        let firm = model.bodies().iter().map(firm).collect();
        let mut plan = Planner { children, weight, nv, firm, grain, pieces: Vec::new(), links: Vec::new() };
        if bodies > 1 {
            let roots = plan.children[0].clone();
            plan.gather(&roots);
        }
        Self { pieces: plan.pieces, links: plan.links }
    }

    pub(crate) fn size(&self) -> AssemblySize {
        let count = |kind| self.pieces.iter().filter(|p| p.kind == kind).count();
        let run = |p: &Piece| if p.kind == Kind::Run { p.links } else { 0 };
        AssemblySize {
            bodies: self.links.len(),
            runs: count(Kind::Run),
            longest_run: self.pieces.iter().map(run).max().unwrap_or(0),
            joins: count(Kind::Join),
            gathers: count(Kind::Gather),
            levels: self.pieces.first().map_or(0, |p| p.levels),
        }
    }
}

struct Planner {
    children: Vec<Vec<usize>>,
    /// The number of bodies that each one carries, itself included.
    weight: Vec<usize>,
    nv: Vec<usize>,
    /// Its own inertia resists each degree of freedom of its joint.
    firm: Vec<bool>,
    grain: usize,
    pieces: Vec<Piece>,
    links: Vec<Link>,
}

impl Planner {
    /// A piece, and what `parts` appends as its parts.
    fn piece(&mut self, kind: Kind, open: bool, parts: impl FnOnce(&mut Self)) {
        let (at, first) = (self.pieces.len(), self.links.len());
        self.pieces.push(Piece { kind, open, links: 0, dofs: 0, pieces: 0, levels: 0 });
        parts(self);
        let links = &self.links[first..];
        let dofs = links.iter().map(|l| self.nv[l.body]).sum();
        let levels = 1 + self.pieces[at + 1..].iter().map(|p| p.levels).max().unwrap_or(0);
        self.pieces[at] = Piece { kind, open, links: links.len(), dofs, pieces: self.pieces.len() - at, levels };
    }

    /// Subtrees that hang on one body.
    fn gather(&mut self, roots: &[usize]) {
        let weights: Vec<usize> = roots.iter().map(|&i| self.weight[i]).collect();
        if weights.iter().sum::<usize>() <= self.grain {
            self.piece(Kind::Run, false, |plan| plan.run(roots, &[]));
        } else if let &[root] = roots {
            let path: Vec<usize> = core::iter::successors(Some(root), |&i| self.children[i].first().copied()).collect();
            self.path(&path, false);
        } else {
            let (left, right) = roots.split_at(halfway(&weights, |_| true).expect("there are two at least"));
            self.piece(Kind::Gather, false, |plan| {
                plan.gather(left);
                plan.gather(right);
            });
        }
    }

    /// A part of a heavy path.
    fn path(&mut self, path: &[usize], open: bool) {
        let heavy = |i: usize| self.children[i].first().map_or(0, |&child| self.weight[child]);
        let weights: Vec<usize> = path.iter().map(|&i| self.weight[i] - heavy(i)).collect();
        if weights.iter().sum::<usize>() <= self.grain {
            self.piece(Kind::Run, open, |plan| plan.run(&path[..1], if open { path } else { &[] }));
        } else if let &[body] = path {
            let light = self.children[body][1..].to_vec();
            self.piece(Kind::Hub, open, |plan| {
                plan.links.push(Link { body, dof: 0, parent: HANDLE, spine: open });
                plan.gather(&light);
            });
        } else if let Some(cut) = halfway(&weights, |cut| self.firm[path[cut - 1]]) {
            let (upper, lower) = path.split_at(cut);
            self.piece(Kind::Join, open, |plan| {
                plan.path(upper, true);
                plan.path(lower, open);
            });
        } else {
            self.piece(Kind::Run, open, |plan| plan.run(&path[..1], if open { path } else { &[] }));
        }
    }

    /// All that hangs on the roots, without what hangs on the end of the spine, if there is one.
    fn run(&mut self, roots: &[usize], spine: &[usize]) {
        let first = self.links.len();
        let mut stack: Vec<(usize, usize)> = roots.iter().rev().map(|&i| (i, HANDLE)).collect();
        let mut dof = 0;
        while let Some((body, parent)) = stack.pop() {
            let place = self.links.len() - first;
            self.links.push(Link { body, dof, parent, spine: spine.contains(&body) });
            dof += self.nv[body];
            let below = usize::from(spine.last() == Some(&body)); // the heaviest child belongs to another piece
            stack.extend(self.children[body][below..].iter().rev().map(|&child| (child, place)));
        }
    }
}

/// The place at which to cut a row of weights so that the heavier part is lightest, if it may be cut; both parts have at
/// least one.
fn halfway(weights: &[usize], may_cut: impl Fn(usize) -> bool) -> Option<usize> {
    let total: usize = weights.iter().sum();
    let (mut left, mut best) = (0, None);
    for cut in 1..weights.len() {
        left += weights[cut - 1];
        let heavier = left.max(total - left);
        if may_cut(cut) && best.is_none_or(|(least, _)| heavier < least) {
            best = Some((heavier, cut));
        }
    }
    best.map(|(_, cut)| cut)
}

/// Whether each D of the body's joint is positive with nothing hanging on it; in its own frame, where S is constant.
fn firm(body: &Body) -> bool {
    let inertia = Se3::new(body.joint.axis_rotation(), Vec3::zero()).act_inv(body.inertia);
    let rotational = inertia.rotational;
    let least = FREE * (inertia.mass + rotational.xx + rotational.yy + rotational.zz);
    let mut Ia = ArticulatedInertia::from(inertia);
    (0..body.joint.nv()).rev().all(|k| {
        let S = body.joint.column(&Se3::identity(), k);
        let U = Ia * S;
        let D = S.dot(U);
        Ia = Ia.minus_outer(U, D.recip()); // Iᵃ = I − U D⁻¹ Uᵀ
        D > least
    })
}
