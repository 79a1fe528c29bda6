//! Frames and centre of mass along the motion q(t) = q ⊕ t v: exact time derivatives by numbers that carry two of them.
//!
//! The body-frame velocity of q ⊕ t v is v at every t, so q̈ = 0 along it: the second derivative of a position is J̇ v,
//! the acceleration that is left when q̈ is 0.

use condyle_dynamics::{Data, Model, Placements, ReferenceFrame, forward_kinematics, gravity, integrate};
use condyle_spatial::{Act, Motion, Scalar, Se3, Vec3};
use nalgebra::DMatrix;
use num_dual::Dual2_64;

/// x(t) = x + ẋ t + ½ ẍ t².
type Jet = Dual2_64;

/// Position, velocity and J̇ v of a frame's origin and rotation, along the world's axes, with the Jacobian J.
#[derive(Clone, Debug)]
pub(crate) struct FrameMotion {
    /// Its number in the model.
    pub frame: usize,
    /// oXf.
    pub pose: Se3<f64>,
    /// (ṗ, ω) = J v.
    pub velocity: Motion<f64>,
    /// (p̈, ω̇) at q̈ = 0: J̇ v.
    pub bias: Motion<f64>,
    /// 6 × nv.
    pub J: DMatrix<f64>,
}

impl FrameMotion {
    pub(crate) fn new(model: &Model, frame: usize) -> Self {
        let J = DMatrix::zeros(6, model.nv());
        Self { frame, pose: Se3::identity(), velocity: Motion::zero(), bias: Motion::zero(), J }
    }
}

/// Position, velocity and J̇ v of the centre of mass, with its Jacobian.
#[derive(Clone, Debug)]
pub(crate) struct ComMotion {
    /// c.
    pub position: Vec3<f64>,
    /// ċ = J v.
    pub velocity: Vec3<f64>,
    /// c̈ at q̈ = 0: J̇ v.
    pub bias: Vec3<f64>,
    /// 3 × nv.
    pub J: DMatrix<f64>,
}

/// Scratch for both.
pub(crate) struct Kinematics {
    data: Data<Jet>,
    q: Vec<Jet>,
    vt: Vec<Jet>,
    q_of_t: Vec<Jet>,
    /// The robot under gravity −1 along each axis.
    lifted: [Model; 3],
    /// Mass of all that moves (kg).
    pub mass: f64,
    pub com: ComMotion,
    pub frames: Vec<FrameMotion>,
}

impl Kinematics {
    /// Frames by their numbers, kept in this order.
    pub(crate) fn new(model: &Model, frames: impl Iterator<Item = usize>) -> Self {
        let zero = Vec3::zero();
        let axes = [Vec3::new(-1.0, 0.0, 0.0), Vec3::new(0.0, -1.0, 0.0), Vec3::new(0.0, 0.0, -1.0)];
        Self {
            data: Data::new(model),
            q: vec![Jet::from(0.0); model.nq()],
            vt: vec![Jet::from(0.0); model.nv()],
            q_of_t: vec![Jet::from(0.0); model.nq()],
            lifted: axes.map(|g| model.clone().with_gravity(g).expect("is finite")),
            mass: model.bodies()[1..].iter().map(|b| b.inertia.mass).sum(),
            com: ComMotion { position: zero, velocity: zero, bias: zero, J: DMatrix::zeros(3, model.nv()) },
            frames: frames.map(|f| FrameMotion::new(model, f)).collect(),
        }
    }

    /// Computes all of it at (q, v).
    pub(crate) fn update(&mut self, model: &Model, data: &mut Data<f64>, q: &[f64], v: &[f64]) {
        for (k, &q) in q.iter().enumerate() {
            self.q[k] = Jet::from(q);
        }
        for (k, &v) in v.iter().enumerate() {
            self.vt[k] = Jet::new(0.0, v, 0.0); // t v
        }
        integrate(model, &self.q, &self.vt, &mut self.q_of_t); // q(t) = q ⊕ t v
        let jets = forward_kinematics(model, &mut self.data, &self.q_of_t);
        let c = centre_of_mass(model, &jets, self.mass);
        (self.com.position, self.com.velocity, self.com.bias) =
            (part(c, |x| x.re), part(c, |x| x.v1), part(c, |x| x.v2));
        let placements = forward_kinematics(model, data, q);
        for f in &mut self.frames {
            let X = jets.frame(f.frame);
            let (R, p) = (X.rotation.columns(), X.translation);
            let at = |c: usize, order: fn(Jet) -> f64| part(R[c], order);
            // ω = ½ Σ r × ṙ and ω̇ = ½ Σ r × r̈ over the columns r of R
            let half_sum = |order| {
                let term = |c| at(c, |x| x.re).cross(at(c, order));
                (term(0) + term(1) + term(2)).scale(0.5)
            };
            f.pose = placements.frame(f.frame);
            f.velocity = Motion::new(part(p, |x| x.v1), half_sum(|x: Jet| x.v1));
            f.bias = Motion::new(part(p, |x| x.v2), half_sum(|x: Jet| x.v2));
            placements.frame_jacobian(f.frame, ReferenceFrame::LocalWorldAligned, &mut f.J);
        }
        for (k, lifted) in self.lifted.iter().enumerate() {
            // V = −m gᵀ c, so ∂V/∂q = −m Jᵀ g: under g = −e_k it is m times row k of J
            for (j, &x) in gravity(lifted, data, q).iter().enumerate() {
                self.com.J[(k, j)] = x / self.mass;
            }
        }
    }
}

/// c = Σ m_i c_i / m over the moving bodies.
fn centre_of_mass<S: Scalar>(model: &Model, placements: &Placements<'_, S>, mass: f64) -> Vec3<S> {
    let mut sum = Vec3::zero();
    for (i, body) in model.bodies().iter().enumerate().skip(1) {
        let (m, com) = (body.inertia.mass, body.inertia.mass_com);
        if m > 0.0 {
            sum += placements.body(i).act(com.scale(1.0 / m).lift()).scale(S::splat(m));
        }
    }
    sum.scale(S::splat(1.0 / mass))
}

/// One of the numbers that a jet carries, of each component.
fn part(x: Vec3<Jet>, order: fn(Jet) -> f64) -> Vec3<f64> {
    Vec3::new(order(x.x), order(x.y), order(x.z))
}
