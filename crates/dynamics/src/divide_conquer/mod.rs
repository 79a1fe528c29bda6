//! Forward dynamics by the divide-and-conquer articulated-body algorithm, in O(log n) steps on O(n) processors for n
//! bodies.
//!
//! Source: Featherstone, *A divide-and-conquer articulated-body algorithm for parallel O(log(n)) calculation of
//! rigid-body dynamics*, part 1: basic algorithm, and part 2: trees, loops and accuracy (1999).
//!
//! The robot is cut in two at a joint, and each half is cut again (`assembly.rs`). A piece is described only by forces
//! and accelerations at its handles. Two joined pieces form a piece with the same description (`articulated_pair.rs`).
//! When the whole robot is assembled, the accelerations and forces at the cuts are computed, in the order in which the
//! cuts were made. Positions and velocities are computed in the same way, so no pass waits for a chain of bodies. All
//! joints may have armature and any number of degrees of freedom. Joints that share a coordinate are first treated as
//! free and then tied (`mimic.rs`).

mod articulated_pair;
pub(crate) mod assembly;
mod mimic;
mod scratch;

use crate::data::check_forces;
use crate::divide_conquer::articulated_pair::ArticulatedPair;
use crate::divide_conquer::assembly::{Assembly, AssemblySize, HANDLE, Kind, Link};
use crate::divide_conquer::mimic::Ties;
use crate::divide_conquer::scratch::{Body, Dof, Part};
use crate::passes::free_armature::subtract_armature_bias;
use alloc::vec::Vec;
use condyle_linalg::{check, threads};
use condyle_model::Model;
use condyle_model::joint::Joint;
use condyle_model::layout::{Layout, Single};
use condyle_spatial::{Act, ArticulatedInertia, Constant, Cross, Force, Mat3, Motion, Scalar, Se3, Vec3};

/// Forward dynamics by divide and conquer: the plan of the assembly for one model, and the scratch of the algorithm.
///
/// The robot is assembled from runs: groups of at most `grain` bodies, which are eliminated one after the other. With
/// `grain` = 1 the algorithm takes O(log n) steps: a depth of ⌈log₂ n⌉ + 1 for a chain of n bodies. A join of two
/// pieces costs about six times as much as the elimination of a body. A body in a run with two handles costs 1.5 times
/// as much as a body in [`aba`](crate::aba()). So with few processors, `grain` should be large: n divided by the number
/// of threads. On two threads, divide and conquer is faster than `aba` for more than about 200 bodies. On one thread,
/// it is always slower (`benches/divide_conquer.rs`). If joints share coordinates (mimic), the passes run once with all
/// joints free, and once more for each joint that shares a coordinate.
///
/// Runs in the rayon pool of the calling thread, or in the global pool if the calling thread does not belong to a pool.
/// The bits of the results do not depend on the number of threads. [`new`](Self::new) allocates all memory, except what
/// rayon allocates. Source: Featherstone (1999), parts 1 and 2.
///
/// ```
/// use condyle_dynamics::{Data, DivideConquer, aba, robots};
/// let arm = robots::arm7();
/// let (q, v, tau) = ([0.3; 7], [0.1; 7], [1.0; 7]);
/// let mut divided = DivideConquer::new(&arm, 1);
/// let a = divided.aba(&arm, &q, &v, &tau, &[]);
/// let mut data = Data::new(&arm);
/// let same = aba(&arm, &mut data, &q, &v, &tau, &[]);
/// assert!(a.iter().zip(same).all(|(a, b)| f64::abs(a - b) < 1e-9));
/// ```
#[derive(Clone, Debug)]
pub struct DivideConquer<S> {
    /// Geometry hash of the model for which the assembly was planned.
    geometry: u64,
    assembly: Assembly,
    /// Bodies in the order of the assembly. Shape: moving bodies.
    bodies: Vec<Body<S>>,
    /// Degrees of freedom in the order of the assembly. Shape: degrees of freedom of all joints.
    dofs: Vec<Dof<S>>,
    /// Relation between the handles of each piece. Shape: pieces. Written by: `relate`, `assemble`.
    handles: Vec<ArticulatedPair<S>>,
    ties: Ties<S>,
    /// Zeros that are never overwritten. Shape: nv.
    zero: Vec<S>,
    /// Joint accelerations. Shape: nv. Written by: `aba`.
    qdd: Vec<S>,
}

impl<S: Scalar> DivideConquer<S> {
    /// Plans the assembly of a model from runs of at most `grain` bodies (0 counts as 1), and allocates all memory.
    pub fn new<R: Constant<S>>(model: &Model<R>, grain: usize) -> Self {
        let assembly = Assembly::new(model, grain.max(1));
        let body = Body {
            X: Se3::identity(),
            oX: Se3::identity(),
            v: Motion::zero(),
            c: Motion::zero(),
            IA: ArticulatedInertia::zero(),
            pA: Force::zero(),
            a: Motion::zero(),
        };
        let dof = Dof {
            tau: S::zero(),
            rotor: S::zero(),
            S: Motion::zero(),
            U: Force::zero(),
            D_inv: S::zero(),
            u: S::zero(),
            qdd: S::zero(),
        };
        Self {
            geometry: model.geometry_hash(),
            bodies: vec![body; assembly.links.len()],
            dofs: vec![dof; model.columns().len()],
            handles: vec![ArticulatedPair::nothing(); assembly.pieces.len()],
            ties: Ties::new(model, &assembly.links),
            zero: vec![S::zero(); model.nv()],
            qdd: vec![S::zero(); model.nv()],
            assembly,
        }
    }

    /// Returns the numbers of bodies and pieces in the assembly, and the nesting depth of the pieces. These numbers
    /// determine the cost of the algorithm.
    pub fn size(&self) -> AssemblySize {
        self.assembly.size()
    }

    /// Computes q̈ = M(q)⁻¹ (τ − h(q, v) + Σ Jᵢᵀ f_ext,i), as [`aba`](crate::aba()) does up to rounding. For n bodies,
    /// the work is O(n) and the number of steps is O(log n + grain).
    ///
    /// q: nq numbers; v, tau: nv numbers each; f_ext: one force per body in the frame of the body, or an empty slice
    /// for no forces. Returns nv numbers. Allocates nothing, except what rayon allocates. If z joints share coordinates
    /// (mimic), the passes take 1 + z times the work and steps, and the ties take O(n z + z³).
    ///
    /// # Panics
    /// Panics if an argument has the wrong length, M is singular ([`Model::singular_joints`]), or `model` has joints or
    /// frames at other placements than the model of the plan.
    #[track_caller]
    pub fn aba<R: Constant<S>>(&mut self, model: &Model<R>, q: &[S], v: &[S], tau: &[S], f_ext: &[Force<S>]) -> &[S] {
        let (bodies, planned) = (model.nodes().len(), self.bodies.len() + 1);
        let other = if bodies == planned { " of another robot" } else { "" };
        assert!(model.geometry_hash() == self.geometry, "model: planned for {planned} bodies, found {bodies}{other}");
        model.check_regular();
        check("q", q.len(), model.nq());
        check("v", v.len(), model.nv());
        check("tau", tau.len(), model.nv());
        check_forces(f_ext.len(), bodies);
        let l = Single::<S, R>::new(model);
        self.qdd.copy_from_slice(tau);
        subtract_armature_bias(model, v, &mut self.qdd); // contains efforts here, and accelerations when `aba` returns
        let mut dofs = self.dofs.iter_mut();
        for link in &self.assembly.links {
            let node = &model.nodes()[link.body];
            for (k, dof) in dofs.by_ref().take(node.joint.nv()).enumerate() {
                let leads = node.mimic.is_none(); // efforts and armature of a shared coordinate belong to its leader
                dof.tau = if leads { self.qdd[node.idx_v + k] } else { S::zero() };
                dof.rotor = if leads { l.armature(link.body, k) } else { S::zero() };
            }
        }
        self.ties.prepare(model);
        let world = Motion::new(l.minus_gravity(), Vec3::zero());
        let parallel = self.assembly.pieces.len() > 1 && threads::threads() > 1;
        let Self { assembly, bodies, dofs, handles, ties, zero, qdd, .. } = self;
        let all = Part { pieces: &assembly.pieces, links: &assembly.links, bodies, dofs, handles };
        let job = Job { l: &l, q, qd: v, f_ext, world, parallel };
        job.run(all, ties, zero);
        let mut dofs = dofs.iter();
        for link in &assembly.links {
            let node = &model.nodes()[link.body];
            for (k, dof) in dofs.by_ref().take(node.joint.nv()).enumerate() {
                if node.mimic.is_none() {
                    qdd[node.idx_v + k] = dof.qdd;
                }
            }
        }
        qdd
    }
}

/// Arguments that all passes of one computation share.
struct Job<'d, L: Layout> {
    l: &'d L,
    q: &'d [L::S],
    qd: &'d [L::S],
    f_ext: &'d [Force<L::S>],
    /// Acceleration of the world: −g for gravity g, or 0 without gravity.
    world: Motion<L::S>,
    parallel: bool,
}

impl<L: Layout + Sync> Job<'_, L> {
    /// Computes the accelerations of all degrees of freedom, and enforces the ties. The efforts and armatures in
    /// `all.dofs` must be set.
    fn run(&self, mut all: Part<'_, L::S>, ties: &mut Ties<L::S>, zero: &[L::S]) {
        ties.add_rotors(all.dofs);
        self.passes(all.again());
        if ties.len() == 0 {
            return;
        }
        ties.keep_free(all.dofs);
        let at_rest =
            Job { l: self.l, q: self.q, qd: zero, f_ext: &[], world: Motion::zero(), parallel: self.parallel };
        all.dofs.iter_mut().for_each(|dof| dof.tau = L::S::zero());
        for z in 0..ties.len() {
            let dof = ties.dof(z);
            all.dofs[dof].tau = L::S::one();
            at_rest.passes(all.again());
            all.dofs[dof].tau = L::S::zero();
            ties.keep_response(z, all.dofs);
        }
        ties.solve(all.dofs);
    }

    /// Computes the accelerations of all degrees of freedom as if all joints were free.
    fn passes(&self, mut all: Part<'_, L::S>) {
        if all.pieces.is_empty() {
            return;
        }
        self.relate(all.again());
        self.assemble(all.again(), Se3::identity(), Motion::zero());
        self.accelerate(all, self.world, None);
    }

    /// Runs two closures, concurrently if `parallel` is set.
    #[inline(always)]
    fn both(&self, one: impl FnOnce() + Send, other: impl FnOnce() + Send) {
        if self.parallel {
            threads::join(one, other);
        } else {
            one();
            other();
        }
    }

    /// Computes the placements of bodies relative to their parents. For an open piece, also computes the placement and
    /// velocity of the piece's last body relative to the body above the piece.
    fn relate(&self, part: Part<'_, L::S>) {
        let (piece, rest) = part.open();
        let (handle, open) = (piece.handle, piece.open);
        match piece.kind {
            Kind::Run | Kind::Hub => {
                let (mut X, mut w) = (Se3::identity(), Motion::zero());
                for (link, body) in piece.links.iter().zip(piece.bodies) {
                    body.X = Joint::placement(self.l, link.body, self.q); // λXi = X_T X_J
                    if link.spine {
                        X = X * body.X;
                        w += X.act(Motion::zero() + Joint::motion(self.l, link.body, self.qd)); // + S q̇
                    }
                }
                (handle.X, handle.w) = (X, w);
                if piece.kind == Kind::Hub {
                    self.relate(rest);
                }
            }
            Kind::Join => {
                let (mut upper, mut lower) = rest.split();
                self.both(|| self.relate(upper.again()), || self.relate(lower.again()));
                if open {
                    let (upper, lower) = (&upper.handles[0], &lower.handles[0]);
                    handle.X = upper.X * lower.X; // 0X2 = 0X1 1X2
                    handle.w = upper.w + upper.X.act(lower.w); // w = w₁ + 0X1 w₂
                }
            }
            Kind::Gather => {
                let (one, other) = rest.split();
                self.both(|| self.relate(one), || self.relate(other));
            }
        }
    }

    /// Computes the placements of the bodies of a piece and the relation between the handles of the piece. oX and v are
    /// the pose and velocity of the body that carries the piece.
    fn assemble(&self, part: Part<'_, L::S>, oX: Se3<L::S>, v: Motion<L::S>) {
        let (piece, mut rest) = part.open();
        let handle = piece.handle;
        match piece.kind {
            Kind::Run | Kind::Hub => {
                let (links, bodies, dofs) = (piece.links, piece.bodies, piece.dofs);
                for i in 0..links.len() {
                    let Link { parent, dof, .. } = links[i];
                    let (oX, v) = if parent == HANDLE { (oX, v) } else { (bodies[parent].oX, bodies[parent].v) };
                    self.place(links[i], &mut bodies[i], &mut dofs[dof..], oX, v);
                }
                if piece.kind == Kind::Hub {
                    self.assemble(rest.again(), bodies[0].oX, bodies[0].v);
                    bodies[0].IA += rest.handles[0].K;
                    bodies[0].pA += rest.handles[0].p;
                }
                (handle.K, handle.p) = (ArticulatedInertia::zero(), Force::zero());
                let last = links.iter().rposition(|link| link.spine);
                handle.begin(last.map_or(Vec3::zero(), |last| bodies[last].oX.translation));
                for i in (0..links.len()).rev() {
                    let Link { parent, dof, .. } = links[i];
                    let (Ia, pa) = self.eliminate(links[i], &bodies[i], &mut dofs[dof..], handle);
                    let (K, p) = if parent == HANDLE {
                        (&mut handle.K, &mut handle.p)
                    } else {
                        let Body { IA, pA, .. } = &mut bodies[parent];
                        (IA, pA)
                    };
                    *K += Ia; // Iᴬ_λ += Iᵃ
                    *p += pa; // pᴬ_λ += pᵃ
                }
            }
            Kind::Join => {
                let (mut upper, mut lower) = rest.split();
                let ArticulatedPair { X, w, .. } = &upper.handles[0];
                let (oX2, v2) = (oX * *X, v + oX.act(*w)); // pose and velocity of the upper piece's last body
                let v2 = Se3::new(Mat3::identity(), oX2.translation).act_inv(v2); // about its origin
                let oX2 = Se3::new(oX2.rotation, Vec3::zero());
                self.both(|| self.assemble(upper.again(), oX, v), || self.assemble(lower.again(), oX2, v2));
                handle.join(&upper.handles[0], &lower.handles[0], piece.open);
            }
            Kind::Gather => {
                let (mut one, mut other) = rest.split();
                self.both(|| self.assemble(one.again(), oX, v), || self.assemble(other.again(), oX, v));
                handle.K = one.handles[0].K + other.handles[0].K;
                handle.p = one.handles[0].p + other.handles[0].p;
            }
        }
    }

    /// Computes the pose, velocity, inertia and bias force of a body. oX and v are the pose and velocity of its parent.
    #[inline(always)]
    fn place(&self, link: Link, body: &mut Body<L::S>, dofs: &mut [Dof<L::S>], oX: Se3<L::S>, v: Motion<L::S>) {
        let (l, i) = (self.l, link.body);
        body.oX = oX * body.X; // oXi = oXλ λXi
        let mut vJ = Motion::zero();
        for k in 0..l.joint(i).nv() {
            dofs[k].S = l.joint(i).column(&body.oX, k);
            vJ = dofs[k].S.scale_add(l.joint_velocity(self.qd, i, k), vJ); // v_J = S q̇
        }
        body.v = v + vJ; // v_i = v_λ + v_J
        body.c = body.v.cross(vJ); // c_i = v_i × v_J
        let I = body.oX.act(l.inertia(i));
        body.IA = I.into();
        body.pA = body.v.cross(I * body.v); // p_i = v_i ×* I_i v_i
        if let Some(external) = l.force(self.f_ext, i) {
            body.pA -= body.oX.act(external);
        }
    }

    /// Eliminates the joint of a body and returns the articulated inertia Iᵃ and bias force pᵃ for the parent. For a
    /// body on the spine, also updates the relation between the handles.
    #[inline(always)]
    fn eliminate(
        &self,
        link: Link,
        body: &Body<L::S>,
        dofs: &mut [Dof<L::S>],
        handle: &mut ArticulatedPair<L::S>,
    ) -> (ArticulatedInertia<L::S>, Force<L::S>) {
        let nv = self.l.joint(link.body).nv();
        let (mut Ia, mut pa) = (body.IA, body.pA);
        for dof in dofs[..nv].iter_mut().rev() {
            dof.U = Ia * dof.S; // U = Iᴬ S
            dof.D_inv = (dof.S.dot(dof.U) + dof.rotor).recip(); // D = Sᵀ U + armature
            dof.u = dof.tau - dof.S.dot(pa); // u = τ − Sᵀ pᴬ
            let x = dof.D_inv * dof.u;
            if link.spine {
                handle.extend(dof.S, dof.U, dof.D_inv, x);
            }
            Ia = Ia.minus_outer(dof.U, dof.D_inv); // Iᵃ = Iᴬ − U D⁻¹ Uᵀ
            pa = dof.U.scale_add(x, pa);
        }
        if link.spine {
            handle.shift(body.c);
        }
        (Ia, pa + Ia * body.c) // pᵃ = pᴬ + Iᵃ c + U D⁻¹ u
    }

    /// Computes the accelerations within a piece. a is the acceleration of the body above the piece, and f is the force
    /// on the last body of the piece.
    fn accelerate(&self, part: Part<'_, L::S>, a: Motion<L::S>, f: Option<Force<L::S>>) {
        let l = self.l;
        let (piece, rest) = part.open();
        match piece.kind {
            Kind::Run | Kind::Hub => {
                let (links, bodies, dofs) = (piece.links, piece.bodies, piece.dofs);
                let last = links.iter().rposition(|link| link.spine);
                if let (Some(f), Some(last)) = (f, last) {
                    let mut f = Se3::new(Mat3::identity(), bodies[last].oX.translation).act(f);
                    for link in links.iter().rev().filter(|link| link.spine) {
                        for dof in dofs[link.dof..][..l.joint(link.body).nv()].iter_mut().rev() {
                            let x = dof.S.dot(f);
                            dof.u += x; // u = τ − Sᵀ (pᴬ − f)
                            f = dof.U.scale_add(-(dof.D_inv * x), f); // f_λ = (1 − U D⁻¹ Sᵀ) f
                        }
                    }
                }
                for i in 0..links.len() {
                    let Link { body, parent, dof, .. } = links[i];
                    let mut ai = bodies[i].c + if parent == HANDLE { a } else { bodies[parent].a }; // a' = a_λ + c
                    for dof in &mut dofs[dof..][..l.joint(body).nv()] {
                        dof.qdd = dof.D_inv * (dof.u - ai.dot(dof.U)); // q̈ = D⁻¹ (u − Uᵀ a')
                        ai = dof.S.scale_add(dof.qdd, ai); // a = a' + S q̈
                    }
                    bodies[i].a = ai;
                }
                if piece.kind == Kind::Hub {
                    self.accelerate(rest, bodies[0].a, None);
                }
            }
            Kind::Join => {
                let (upper, lower) = rest.split();
                let (a2, f1) = piece.handle.between(&lower.handles[0], a, f);
                self.both(|| self.accelerate(upper, a, Some(f1)), || self.accelerate(lower, a2, f));
            }
            Kind::Gather => {
                let (one, other) = rest.split();
                self.both(|| self.accelerate(one, a, None), || self.accelerate(other, a, None));
            }
        }
    }
}
