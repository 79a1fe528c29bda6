//! The numbers of the cone program at one state: each block beside its equation.

use crate::controller::Command;
use crate::kinematics::{FrameMotion, Kinematics};
use crate::program::Numbers;
use crate::rows::Rows;
use crate::settings::Settings;
use crate::task::{ComTarget, ContactTarget, FrameTarget, FrictionContact, Gains, PostureTarget, References, Tasks};
use condyle_dynamics::{Data, Model, crba, difference, lie, nonlinear_effects};
use condyle_spatial::{Mat3, Motion, Quaternion, Vec3};
use nalgebra::DMatrix;

/// All that the numbers are computed from, and in. x = (q̈, f₁ … f_k).
pub(crate) struct Equations {
    model: Model,
    contacts: Vec<FrictionContact>,
    tasks: Tasks,
    settings: Settings,
    pub rows: Rows,
    data: Data<f64>,
    /// Its frames: the contacts, then those of the tasks.
    kinematics: Kinematics,
    /// τ = E x + h with E = [M, −Jᵀ], nv × (nv + 3 k).
    E: DMatrix<f64>,
    h: Vec<f64>,
    /// q_ref ⊖ q, nv numbers.
    error: Vec<f64>,
    pub numbers: Numbers,
}

impl Equations {
    /// `frames`: the numbers of the contacts' frames, then of the tasks'.
    pub(crate) fn new(
        model: &Model,
        contacts: &[FrictionContact],
        tasks: Tasks,
        settings: Settings,
        frames: &[usize],
    ) -> Self {
        let rows = Rows::new(model, contacts, settings.effort(model));
        let (nv, n) = (model.nv(), rows.force(contacts.len()));
        let mut numbers = Numbers::zeros(rows.count(), n);
        fill_constant_rows(&mut numbers, &rows, contacts);
        Self {
            model: model.clone(),
            contacts: contacts.to_vec(),
            tasks,
            settings,
            rows,
            data: Data::new(model),
            kinematics: Kinematics::new(model, frames.iter().copied()),
            E: DMatrix::zeros(nv, n),
            h: vec![0.0; nv],
            error: vec![0.0; nv],
            numbers,
        }
    }

    pub(crate) fn model(&self) -> &Model {
        &self.model
    }

    /// How many frames the tasks move.
    pub(crate) fn tasked_frames(&self) -> usize {
        self.tasks.frames.len()
    }

    /// Reads x = (q̈, f).
    pub(crate) fn read(&self, x: &[f64], command: &mut Command) {
        let Self { rows, E, h, kinematics: Kinematics { com, .. }, .. } = self;
        command.a.copy_from_slice(&x[..h.len()]);
        for (k, f) in command.forces.iter_mut().enumerate() {
            let i = rows.force(k);
            *f = Vec3::new(x[i], x[i + 1], x[i + 2]);
        }
        let row = |m: &DMatrix<f64>, i: usize| (0..m.ncols()).map(|j| m[(i, j)] * x[j]).sum::<f64>();
        for &i in &rows.actuated {
            command.tau[i] = row(E, i) + h[i]; // τ = M q̈ + h − Jᵀ f
        }
        let Jx = Vec3::new(row(&com.J, 0), row(&com.J, 1), row(&com.J, 2));
        command.com_acceleration = Jx + com.bias; // c̈ = J q̈ + J̇ v
    }

    /// The references that keep the position q at rest, the weight shared by all contacts.
    pub(crate) fn hold(&mut self, q: &[f64]) -> References {
        let rest = vec![0.0; self.model.nv()];
        self.kinematics.update(&self.model, &mut self.data, q, &rest);
        let Kinematics { com, frames, mass, .. } = &self.kinematics;
        let (contacts, frames) = frames.split_at(self.contacts.len());
        let share = self.model.gravity().scale(-mass / contacts.len() as f64);
        let zero = Motion::zero();
        References {
            com: ComTarget { position: com.position, velocity: Vec3::zero(), acceleration: Vec3::zero() },
            frames: frames.iter().map(|f| FrameTarget { pose: f.pose, velocity: zero, acceleration: zero }).collect(),
            posture: PostureTarget { q: q.to_vec(), v: rest.clone(), a: rest },
            contacts: contacts.iter().map(|c| ContactTarget { position: c.pose.translation, force: share }).collect(),
        }
    }

    /// Computes all numbers at (q, v).
    pub(crate) fn update(&mut self, q: &[f64], v: &[f64], references: &References) {
        let Self { model, data, kinematics, E, h, .. } = self;
        kinematics.update(model, data, q, v);
        let nv = model.nv();
        E.columns_mut(0, nv).copy_from(crba(model, data, q));
        for (k, contact) in kinematics.frames[..self.contacts.len()].iter().enumerate() {
            let column = self.rows.force(k);
            E.columns_mut(column, 3).tr_copy_from(&contact.J.rows(0, 3));
            E.columns_mut(column, 3).neg_mut();
        }
        h.copy_from_slice(nonlinear_effects(model, data, q, v));
        self.objective(q, v, references);
        self.constraints(references);
    }

    /// ½ xᵀ P x + cᵀ x = Σ ½ w (J q̈ + J̇ v − a*)² + ½ w_a ‖q̈‖² + ½ w_f Σ ‖f − f_ref‖², up to a constant.
    fn objective(&mut self, q: &[f64], v: &[f64], references: &References) {
        let Self { tasks, settings, rows, kinematics, numbers, error, model, .. } = self;
        let (nv, contacts) = (model.nv(), self.contacts.len());
        numbers.P.fill(0.0);
        numbers.c.fill(0.0);

        let (com, target) = (&kinematics.com, &references.com);
        let Gains { stiffness, damping } = tasks.com.gains;
        let a = target.acceleration
            + (target.position - com.position).scale(stiffness) // a* = a_ref + k (c_ref − c)
            + (target.velocity - com.velocity).scale(damping); //           + d (ċ_ref − ċ)
        let b = (a - com.bias).to_array(); // J q̈ = a* − J̇ v
        for (r, w) in tasks.com.weight.to_array().into_iter().enumerate() {
            add_task(numbers, w, &com.J, r, b[r]);
        }

        for ((task, frame), target) in tasks.frames.iter().zip(&kinematics.frames[contacts..]).zip(&references.frames) {
            let Gains { stiffness, damping } = task.gains;
            let a = target.acceleration
                + pose_error(frame, target).scale(stiffness) // a* = a_ref + k (X_ref ⊖ X)
                + (target.velocity - frame.velocity).scale(damping); //    + d (v_ref − v)
            let b = (a - frame.bias).to_array();
            for (r, w) in Motion::new(task.linear, task.angular).to_array().into_iter().enumerate() {
                add_task(numbers, w, &frame.J, r, b[r]);
            }
        }

        let PostureTarget { q: q_ref, v: v_ref, a: a_ref } = &references.posture;
        difference(model, q, q_ref, error); // q_ref ⊖ q
        let Gains { stiffness, damping } = tasks.posture.gains;
        for &i in &rows.actuated {
            let a = a_ref[i] + stiffness * error[i] + damping * (v_ref[i] - v[i]);
            numbers.P[(i, i)] += tasks.posture.weight; // ½ w (q̈_i − a*_i)²
            numbers.c[i] -= tasks.posture.weight * a;
        }

        for i in 0..nv {
            numbers.P[(i, i)] += settings.acceleration_weight; // ½ w_a q̈_i²
        }
        for (k, target) in references.contacts.iter().enumerate() {
            for (r, f) in target.force.to_array().into_iter().enumerate() {
                let i = rows.force(k) + r;
                numbers.P[(i, i)] += settings.force_weight; // ½ w_f (f_i − f_ref,i)²
                numbers.c[i] -= settings.force_weight * f;
            }
        }
    }

    /// The rows of A x + s = b that depend on the state.
    fn constraints(&mut self, references: &References) {
        let Self { rows, kinematics, E, h, numbers: Numbers { A, b, .. }, settings, model, .. } = self;
        for (r, &i) in rows.free.iter().enumerate() {
            A.row_mut(r).copy_from(&E.row(i)); // M q̈ − Jᵀ f = −h: no motor acts on the base
            b[r] = -h[i];
        }
        let Gains { stiffness, damping } = settings.contact_gains;
        for (k, (contact, target)) in kinematics.frames.iter().zip(&references.contacts).enumerate() {
            let r = rows.held(k);
            A.view_mut((r, 0), (3, model.nv())).copy_from(&contact.J.rows(0, 3));
            let a = (target.position - contact.pose.translation).scale(stiffness) // J q̈ + J̇ v = k (p_ref − p) − d ṗ
                - contact.velocity.linear.scale(damping);
            b[r..r + 3].copy_from_slice(&(a - contact.bias.linear).to_array());
        }
        for (l, &(i, limit)) in rows.limited.iter().enumerate() {
            let r = rows.limit(l);
            A.row_mut(r).copy_from(&E.row(i)); // τ = E x + h ≤ τ̄
            b[r] = limit - h[i];
            A.row_mut(r + 1).copy_from(&E.row(i)); // −τ ≤ τ̄
            A.row_mut(r + 1).neg_mut();
            b[r + 1] = limit + h[i];
        }
    }
}

/// The rows that are the same in every state: those of the forces.
fn fill_constant_rows(numbers: &mut Numbers, rows: &Rows, contacts: &[FrictionContact]) {
    let Numbers { A, b, .. } = numbers;
    let mut fill = |row: usize, k: usize, direction: Vec3<f64>| {
        for (r, x) in direction.to_array().into_iter().enumerate() {
            A[(row, rows.force(k) + r)] = x;
        }
    };
    for (i, bound) in rows.force_bounds.iter().enumerate() {
        fill(rows.force_bound(i), bound.contact, rows.axes[bound.contact][2].scale(bound.sign)); // ±nᵀ f ≤ ±bound
        b[rows.force_bound(i)] = bound.sign * bound.bound;
    }
    for (k, &[t1, t2, n]) in rows.axes.iter().enumerate() {
        let r = rows.cone(k);
        fill(r, k, n.scale(-contacts[k].friction)); // s = (μ nᵀ f, t₁ᵀ f, t₂ᵀ f): ‖(s₂, s₃)‖ ≤ s₁
        fill(r + 1, k, -t1);
        fill(r + 2, k, -t2);
    }
}

/// Adds ½ w (J_r q̈ − b)²: w J_rᵀ J_r to the upper triangle of P, −w b J_rᵀ to c.
fn add_task(numbers: &mut Numbers, w: f64, J: &DMatrix<f64>, r: usize, b: f64) {
    if w == 0.0 {
        return;
    }
    for j in 0..J.ncols() {
        let wJ = w * J[(r, j)];
        for i in 0..=j {
            numbers.P[(i, j)] += J[(r, i)] * wJ;
        }
        numbers.c[j] -= wJ * b;
    }
}

/// X_ref ⊖ X along the world's axes: (p_ref − p, log(R_ref Rᵀ)).
fn pose_error(frame: &FrameMotion, target: &FrameTarget) -> Motion<f64> {
    let rotation: Mat3<f64> = target.pose.rotation * frame.pose.rotation.transpose();
    let angular = lie::log3(Quaternion::from_rotation(rotation));
    Motion::new(target.pose.translation - frame.pose.translation, angular)
}
