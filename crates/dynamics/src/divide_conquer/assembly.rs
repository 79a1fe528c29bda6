//! Plan of the divide-and-conquer algorithm: the pieces of a tree of bodies, and the order in which they are assembled.
//!
//! Source: Featherstone, *A divide-and-conquer articulated-body algorithm for parallel O(log(n)) calculation of
//! rigid-body dynamics*, part 2: trees, loops and accuracy (1999). The paper leaves the choice of the assembly tree
//! open.
//!
//! In this module, a tree is divided into heavy paths (Sleator and Tarjan, *A data structure for dynamic trees*, 1983).
//! From each body, a heavy path continues to the child that carries the most bodies. The other children begin separate
//! paths. The weight of a segment of a path is the number of bodies in the segment and in all side branches attached to
//! these bodies. A path is cut into two segments of nearly the same weight, and each segment is cut in the same way. So
//! the nesting depth of joins is ⌈log₂ n⌉ for a chain of n bodies, and O(log n) for any tree.
//!
//! A path is not cut directly below a body whose own inertia does not resist the motion of its joint, such as a
//! massless body. The equations of the piece above such a cut would be singular.

use alloc::vec::Vec;
use condyle_model::{Body, Model};
use condyle_spatial::{Act, ArticulatedInertia, Se3, Vec3};

/// Minimum inertia along a degree of freedom, as a fraction of the body's mass (kg) and rotational inertia (kg m²). A
/// body with less inertia is treated as if it did not resist the motion of its joint.
const FREE: f64 = 1e-9;

/// Value of [`Link::parent`] for a body that is attached to the handle above its piece.
pub(crate) const HANDLE: usize = usize::MAX;

/// Kind of a piece, which determines how it is assembled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Run: bodies that are eliminated one after the other. Each body is attached to another body of the run or to the
    /// body above the run.
    Run,
    /// Hub: one body, and the next piece in the list, which consists of all subtrees that are attached to the body.
    Hub,
    /// Join of the next two pieces in the list. The second piece is attached to the last body of the first piece.
    Join,
    /// Gather: sum of the next two pieces in the list, which are attached to the same body.
    Gather,
}

/// Piece of the tree. The list of pieces contains each piece immediately before its parts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    pub kind: Kind,
    /// Whether another piece is attached to the last body of this piece. Then this piece has two handles.
    pub open: bool,
    /// Number of bodies in this piece.
    pub links: usize,
    /// Number of degrees of freedom of the joints in this piece.
    pub dofs: usize,
    /// Number of pieces in this piece, including the piece itself and all pieces nested in it.
    pub pieces: usize,
    /// Number of pieces on the longest path from this piece to a run, including this piece and the run.
    depth: usize,
}

/// Body in a piece.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    pub body: usize,
    /// Index of the body's first degree of freedom among the degrees of freedom of the piece.
    pub dof: usize,
    /// Index of the body's parent among the bodies of the run, or [`HANDLE`].
    pub parent: usize,
    /// Whether the body is on the path from the upper handle to the lower handle of the piece.
    pub spine: bool,
}

/// Numbers of bodies and pieces in an assembly, and the nesting depth of the pieces. These numbers determine the cost
/// of the algorithm.
///
/// ```
/// use condyle_dynamics::{AssemblySize, DivideConquer, robots};
/// let arm = DivideConquer::<f64>::new(&robots::arm7(), 1);
/// assert_eq!(arm.size(), AssemblySize { bodies: 7, runs: 7, longest_run: 1, joins: 6, gathers: 0, depth: 4 });
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AssemblySize {
    /// Number of moving bodies. Each body is eliminated once.
    pub bodies: usize,
    /// Number of runs: pieces within which bodies are eliminated one after the other.
    pub runs: usize,
    /// Number of bodies in the largest run.
    pub longest_run: usize,
    /// Number of joins. In a join of two pieces, the second piece is attached to the last body of the first piece.
    pub joins: usize,
    /// Number of sums of two pieces. Both pieces are attached to the same body.
    pub gathers: usize,
    /// Number of pieces on the longest path from a run to the whole robot. The pieces of a path must be assembled one
    /// after the other.
    pub depth: usize,
}

/// All pieces of a robot. The first piece is the whole robot.
#[derive(Clone, Debug)]
pub(crate) struct Assembly {
    pub pieces: Vec<Piece>,
    pub links: Vec<Link>,
}

impl Assembly {
    /// Plans the pieces of a model. A run has at most `grain` bodies, or more if its path may not be cut.
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
    /// Number of bodies that each body carries, including the body itself.
    weight: Vec<usize>,
    nv: Vec<usize>,
    /// Whether the body's own inertia resists each degree of freedom of its joint.
    firm: Vec<bool>,
    grain: usize,
    pieces: Vec<Piece>,
    links: Vec<Link>,
}

impl Planner {
    /// Adds a piece to the list, and calls `parts` to append the piece's bodies and parts.
    fn piece(&mut self, kind: Kind, open: bool, parts: impl FnOnce(&mut Self)) {
        let (at, first) = (self.pieces.len(), self.links.len());
        self.pieces.push(Piece { kind, open, links: 0, dofs: 0, pieces: 0, depth: 0 });
        parts(self);
        let links = &self.links[first..];
        let dofs = links.iter().map(|l| self.nv[l.body]).sum();
        let depth = 1 + self.pieces[at + 1..].iter().map(|p| p.depth).max().unwrap_or(0);
        self.pieces[at] = Piece { kind, open, links: links.len(), dofs, pieces: self.pieces.len() - at, depth };
    }

    /// Adds the pieces of all subtrees with the given roots. The roots are attached to the same body.
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

    /// Adds the pieces of a segment of a heavy path.
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

    /// Adds the bodies `roots` and all bodies that they carry to a run. If `spine` is not empty, the subtree of the
    /// heaviest child of the spine's last body is excluded.
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

/// Returns the best allowed index at which to cut a list of weights, or `None` if no cut is allowed. The best cut
/// minimises the weight of the heavier half. Both halves have at least one entry.
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

/// Returns whether the inertia of the body alone resists each degree of freedom of its joint. This is true if the
/// inertia D along each degree of freedom is above a minimum. D is computed in the body's frame, in which the joint
/// columns are constant.
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
