//! Kinematics and dynamics of a tick from one pass of `compute_all_terms`, and the motion of the requested frames.

use condyle_dynamics::{Data, Force, Model, Motion, ReferenceFrame, Se3, Vec3, compute_all_terms};
use nalgebra::DMatrix;

/// Motion of a frame's origin and rotation, along the world's axes: pose, velocity, J̇ v and Jacobian J.
#[derive(Clone, Debug)]
pub(crate) struct FrameMotion {
    /// Index of the frame in the model.
    pub frame: usize,
    /// oXf.
    pub pose: Se3<f64>,
    /// Velocity of the frame's origin and angular velocity: (ṗ, ω) = J v.
    pub velocity: Motion<f64>,
    /// Linear and angular acceleration (p̈, ω̇) of the frame at q̈ = 0, which is J̇ v with the Jacobian J.
    pub drift: Motion<f64>,
    /// Jacobian J of the frame, 6 × nv.
    pub J: DMatrix<f64>,
    /// Coordinates that move the frame: only these columns of J may be non-zero.
    pub support: Vec<usize>,
}

/// Equations of motion, centre of mass, angular momentum and frames at one state.
pub(crate) struct Kinematics {
    data: Data<f64>,
    pub model: Model,
    /// Inertia matrix M(q), nv × nv.
    pub M: DMatrix<f64>,
    /// Bias efforts h(q, v): gravity, Coriolis and centrifugal efforts, nv numbers.
    pub h: Vec<f64>,
    /// Position c of the centre of mass (m).
    pub com: Vec3<f64>,
    /// Velocity ċ of the centre of mass (m/s).
    pub com_velocity: Vec3<f64>,
    /// Acceleration c̈ of the centre of mass at q̈ = 0.
    pub com_drift: Vec3<f64>,
    /// Momentum about the centre of mass.
    pub momentum: Force<f64>,
    /// Time derivative of the momentum at q̈ = 0.
    pub momentum_drift: Force<f64>,
    /// Centroidal momentum matrix, 6 × nv. Rows 0 to 2 are the mass times the Jacobian of the centre of mass.
    pub Ag: DMatrix<f64>,
    /// Mass of all moving bodies (kg).
    pub mass: f64,
    /// Motion of each frame listed in [`new`](Self::new), in the same order, each frame once.
    pub frames: Vec<FrameMotion>,
}

impl Kinematics {
    /// Creates the kinematics for frames with these indices.
    pub(crate) fn new(model: &Model, frames: &[usize]) -> Self {
        let nv = model.nv();
        let motion = |&frame: &usize| FrameMotion {
            frame,
            pose: Se3::identity(),
            velocity: Motion::zero(),
            drift: Motion::zero(),
            J: DMatrix::zeros(6, nv),
            support: support(model, model.frames()[frame].body),
        };
        Self {
            data: Data::new(model),
            model: model.clone(),
            M: DMatrix::zeros(nv, nv),
            h: vec![0.0; nv],
            com: Vec3::zero(),
            com_velocity: Vec3::zero(),
            com_drift: Vec3::zero(),
            momentum: Force::zero(),
            momentum_drift: Force::zero(),
            Ag: DMatrix::zeros(6, nv),
            mass: model.bodies()[1..].iter().map(|b| b.inertia.mass).sum(),
            frames: frames.iter().map(motion).collect(),
        }
    }

    /// Computes all quantities at (q, v).
    pub(crate) fn update(&mut self, q: &[f64], v: &[f64]) {
        let terms = compute_all_terms(&self.model, &mut self.data, q, v);
        self.M.copy_from(terms.M);
        self.h.copy_from_slice(terms.h);
        let centroidal = terms.centroidal;
        (self.com, self.com_velocity, self.momentum) = (centroidal.com, centroidal.com_velocity, centroidal.hg);
        self.Ag.copy_from(centroidal.Ag);
        let mut drift = [0.0; 6]; // Ȧg v
        for (column, &v) in centroidal.dAg.as_slice().chunks_exact(6).zip(v) {
            for i in 0..6 {
                drift[i] += column[i] * v;
            }
        }
        let [x, y, z, a, b, c] = drift;
        self.momentum_drift = Force::new(Vec3::new(x, y, z), Vec3::new(a, b, c));
        self.com_drift = self.momentum_drift.linear.scale(1.0 / self.mass); // m c̈ is the rate of linear momentum
        for f in &mut self.frames {
            f.pose = terms.kinematics.frame(f.frame);
            f.velocity = terms.kinematics.frame_velocity(f.frame, ReferenceFrame::LocalWorldAligned);
            f.drift = terms.frame_drift(f.frame);
            terms.kinematics.frame_jacobian(f.frame, ReferenceFrame::LocalWorldAligned, &mut f.J);
        }
    }
}

/// Returns the coordinates that move a body.
fn support(model: &Model, mut body: usize) -> Vec<usize> {
    let mut moves = Vec::new();
    while body != 0 {
        let b = &model.bodies()[body];
        moves.extend(b.idx_v..b.idx_v + b.joint.nv());
        body = b.parent;
    }
    moves.sort_unstable();
    moves.dedup();
    moves
}
