//! Plan of the divide-and-conquer algorithm: the pieces of a tree of bodies, and the order in which they are assembled.
//!
//! Source: Featherstone, *A divide-and-conquer articulated-body algorithm for parallel O(log(n)) calculation of
//! rigid-body dynamics*, part 2: trees, loops and accuracy (1999), who leaves the choice of the assembly tree open.
//!
//! Here a tree is divided into heavy paths (Sleator and Tarjan, *A data structure for dynamic trees*, 1983): from each
//! body the path continues to the child that carries most bodies. A path is cut so that both halves, including the
//! bodies that they carry, have nearly the same weight. The halves are cut in the same way. The other subtrees attached
//! to a body are separate paths. So a chain of n bodies has joins nested ⌈log₂ n⌉ deep, and any tree O(log n).
//!
//! No cut is made below a body whose own inertia would not resist its joint, such as a massless body. The piece above
//! such a cut could not be solved separately.

use alloc::vec::Vec;
use condyle_model::{Body, Model};
use condyle_spatial::{Act, ArticulatedInertia, Se3, Vec3};

/// Minimum inertia along a degree of freedom, as a fraction of the body's mass (kg) and rotational inertia (kg m²). A
/// joint with less inertia counts as having none.
const FREE: f64 = 1e-9;

/// Parent index in a piece's links that denotes the handle above the piece.
pub(crate) const HANDLE: usize = usize::MAX;

/// Kind of a piece, which determines how it is assembled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Bodies that are connected with each other or with the body above, eliminated one after the other.
    Run,
    /// One body, and the following piece, which assembles the subtrees attached to it.
    Hub,
    /// Join of the following piece and the piece after it, which is attached below.
    Join,
    /// Sum of the following piece and the piece after it, both attached to the same body.
    Gather,
}

/// Piece of the tree. Its parts and its bodies follow it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    pub kind: Kind,
    /// Whether another piece is attached to its last body, so that it has two handles.
    pub open: bool,
    /// Number of its bodies.
    pub links: usize,
    /// Number of degrees of freedom of their joints.
    pub dofs: usize,
    /// Number of pieces of which it consists, including itself.
    pub pieces: usize,
    /// Number of pieces on the longest path from it to a run, including itself.
    depth: usize,
}

/// Body in the order of the pieces.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    pub body: usize,
    /// Index of the first of its degrees of freedom, counted from the piece's first.
    pub dof: usize,
    /// Index of its parent in the run, or [`HANDLE`].
    pub parent: usize,
    /// Whether it is on the path from the upper handle to the lower one.
    pub spine: bool,
}

/// Cost of an assembly, in counts.
///
/// ```
/// use condyle_dynamics::{AssemblySize, DivideConquer, robots};
/// let arm = DivideConquer::<f64>::new(&robots::arm7(), 1);
/// assert_eq!(arm.size(), AssemblySize { bodies: 7, runs: 7, longest_run: 1, joins: 6, gathers: 0, depth: 4 });
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AssemblySize {
    /// Number of moving bodies; each is eliminated once.
    pub bodies: usize,
    /// Number of pieces within which bodies are eliminated one after the other.
    pub runs: usize,
    /// Number of bodies in the largest of these pieces.
    pub longest_run: usize,
    /// Number of pairs of pieces that are joined, one below the other.
    pub joins: usize,
    /// Number of pairs of pieces that are added, both on one body.
    pub gathers: usize,
    /// Number of pieces that must be assembled one after the other, from a run to the whole.
    pub depth: usize,
}

/// All pieces, beginning with the whole.
#[derive(Clone, Debug)]
pub(crate) struct Assembly {
    pub pieces: Vec<Piece>,
    pub links: Vec<Link>,
}

impl Assembly {
    /// Plans the pieces of a model. Runs have at most `grain` bodies, or more where no cut can be made.
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
            children.sort_by_key(|&i| (usize::MAX - weight[i], i)); // heaviest first
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
            depth: self.pieces.first().map_or(0, |p| p.depth),
        }
    }
}

struct Planner {
    children: Vec<Vec<usize>>,
    /// Number of bodies that each body carries, including itself.
    weight: Vec<usize>,
    nv: Vec<usize>,
    /// Whether the body's own inertia resists each degree of freedom of its joint.
    firm: Vec<bool>,
    grain: usize,
    pieces: Vec<Piece>,
    links: Vec<Link>,
}

impl Planner {
    /// Adds a piece with the parts that `parts` appends.
    fn piece(&mut self, kind: Kind, open: bool, parts: impl FnOnce(&mut Self)) {
        let (at, first) = (self.pieces.len(), self.links.len());
        self.pieces.push(Piece { kind, open, links: 0, dofs: 0, pieces: 0, depth: 0 });
        parts(self);
        let links = &self.links[first..];
        let dofs = links.iter().map(|l| self.nv[l.body]).sum();
        let depth = 1 + self.pieces[at + 1..].iter().map(|p| p.depth).max().unwrap_or(0);
        self.pieces[at] = Piece { kind, open, links: links.len(), dofs, pieces: self.pieces.len() - at, depth };
    }

    /// Adds the subtrees attached to one body.
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

    /// Adds a part of a heavy path.
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

    /// Adds all bodies that the roots carry, except the heaviest child of the spine's last body, if there is a spine.
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

/// Returns the best cut of a row of weights, if a cut is allowed: the heavier part is as light as possible. Both parts
/// have at least one weight.
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

/// Returns whether each D of the body's joint is positive for the body alone, in the body's frame, where S is constant.
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
