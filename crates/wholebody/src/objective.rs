//! Rows of the tasks at one state. Each row has the form J q̈ = a* − J̇ v, with the Jacobian J and the desired
//! acceleration a* of the task.

use crate::contact_rows::ContactRows;
use crate::kinematics::{FrameMotion, Kinematics};
use crate::least_squares::LeastSquares;
use crate::references::{FrameTarget, PostureTarget, References};
use crate::settings::Settings;
use crate::task::{Axes, Gains, Task, TaskKind};
use condyle_dynamics::{Mat3, Quaternion, Vec3, difference, lie};

/// Task with the indices of its frames and contact instead of their names.
pub(crate) struct ResolvedTask {
    pub task: Task,
    /// Index of the frame that the task moves, among the frames of the kinematics.
    pub frame: Option<usize>,
    /// Index of the task's target among the frames of the references.
    pub target: usize,
    /// Index of the frame whose axes the task uses, among the frames of the kinematics.
    pub axes: Option<usize>,
    /// Index of the contact whose force the task sets.
    pub contact: Option<usize>,
}

impl ResolvedTask {
    /// Returns the maximum number of rows of the task.
    pub(crate) fn max_rows(&self) -> usize {
        match self.task.kind {
            TaskKind::Posture => 0,
            TaskKind::Com | TaskKind::Position(_) | TaskKind::Orientation(_) | TaskKind::AngularMomentum => 3,
            TaskKind::Pose(_) | TaskKind::Velocity(_) | TaskKind::ContactForce(_) => 6,
        }
    }

    /// Adds the rows of the task, one for each axis that the mask selects.
    fn add(&self, k: &Kinematics, contacts: &[ContactRows], references: &References, out: &mut LeastSquares) {
        let Gains { stiffness, damping } = self.task.gains;
        let axes = self.axes.map_or(Mat3::identity(), |frame| k.frames[frame].pose.rotation);
        let frame = || (&k.frames[self.frame.expect("resolved")], &references.frames[self.target]);
        match self.task.kind {
            TaskKind::Com => {
                let target = &references.com;
                let a = target.acceleration
                    + (target.position - k.com).scale(stiffness) // a* = a_ref + k (c_ref − c)
                    + (target.velocity - k.com_velocity).scale(damping); //     + d (ċ_ref − ċ)
                self.add_map(k, axes, 0, 1.0 / k.mass, a - k.com_drift, out);
            }
            TaskKind::AngularMomentum => {
                let target = &references.momentum;
                let rate = target.rate + (target.momentum - k.momentum.angular).scale(damping);
                self.add_map(k, axes, 3, 1.0, rate - k.momentum_drift.angular, out);
            }
            TaskKind::Position(_) => {
                let (frame, target) = frame();
                self.add_linear(frame, target, axes, 0, stiffness, out);
            }
            TaskKind::Orientation(_) => {
                let (frame, target) = frame();
                self.add_angular(frame, target, axes, 0, stiffness, out);
            }
            TaskKind::Pose(_) | TaskKind::Velocity(_) => {
                let (frame, target) = frame();
                let stiffness = if matches!(self.task.kind, TaskKind::Pose(_)) { stiffness } else { 0.0 };
                self.add_linear(frame, target, axes, 0, stiffness, out);
                self.add_angular(frame, target, axes, 3, stiffness, out);
            }
            TaskKind::ContactForce(_) => {
                let contact = &contacts[self.contact.expect("resolved")];
                if !contact.active {
                    return;
                }
                let unknowns = contact.geometry.unknowns();
                for &r in contact.geometry.motion {
                    if self.task.mask[r] {
                        out.add_row(self.task.weight, contact.wrench[r], |row| {
                            for j in 0..unknowns {
                                row[contact.column + j] = contact.geometry.wrench(r, j);
                            }
                        });
                    }
                }
            }
            TaskKind::Posture => {}
        }
    }

    /// Adds rows `from` to `from` + 2 of the centroidal momentum matrix to the objective, with components along `axes`.
    fn add_map(&self, k: &Kinematics, axes: Mat3<f64>, from: usize, scale: f64, b: Vec3<f64>, out: &mut LeastSquares) {
        for (e, _) in axes.columns().into_iter().zip(self.task.mask).filter(|(_, counts)| *counts) {
            let s = e.scale(scale);
            out.add_row(self.task.weight, e.dot(b), |row| {
                for (x, A) in row.iter_mut().zip(k.Ag.as_slice().chunks_exact(6)) {
                    *x = s.x * A[from] + s.y * A[from + 1] + s.z * A[from + 2];
                }
            });
        }
    }

    fn add_linear(
        &self,
        frame: &FrameMotion,
        target: &FrameTarget,
        axes: Mat3<f64>,
        mask: usize,
        stiffness: f64,
        out: &mut LeastSquares,
    ) {
        let a = target.acceleration.linear
            + (target.pose.translation - frame.pose.translation).scale(stiffness) // a* = a_ref + k (p_ref − p)
            + (target.velocity.linear - frame.velocity.linear).scale(self.task.gains.damping); // + d (ṗ_ref − ṗ)
        self.add_jacobian(frame, axes, mask, 0, a - frame.drift.linear, out);
    }

    fn add_angular(
        &self,
        frame: &FrameMotion,
        target: &FrameTarget,
        axes: Mat3<f64>,
        mask: usize,
        stiffness: f64,
        out: &mut LeastSquares,
    ) {
        let turn: Mat3<f64> = target.pose.rotation * frame.pose.rotation.transpose();
        let error = lie::log3(Quaternion::from_rotation(turn));
        let a = target.acceleration.angular
            + error.scale(stiffness) // a* = ω̇_ref + k log(R_ref Rᵀ)
            + (target.velocity.angular - frame.velocity.angular).scale(self.task.gains.damping); // + d (ω_ref − ω)
        self.add_jacobian(frame, axes, mask, 3, a - frame.drift.angular, out);
    }

    /// Adds rows `from` to `from` + 2 of the frame's Jacobian to the objective, with components along `axes`.
    fn add_jacobian(
        &self,
        frame: &FrameMotion,
        axes: Mat3<f64>,
        mask: usize,
        from: usize,
        b: Vec3<f64>,
        out: &mut LeastSquares,
    ) {
        for (axis, e) in axes.columns().into_iter().enumerate() {
            if self.task.mask[mask + axis] {
                out.add_row(self.task.weight, e.dot(b), |row| {
                    for &j in &frame.support {
                        let J = &frame.J.as_slice()[6 * j + from..6 * j + from + 3];
                        row[j] = e.x * J[0] + e.y * J[1] + e.z * J[2];
                    }
                });
            }
        }
    }
}

/// All tasks, grouped by priority.
pub(crate) struct Objective {
    pub tasks: Vec<ResolvedTask>,
    /// Error q_ref ⊖ q of the position, nv numbers.
    pub error: Vec<f64>,
    /// Objective of each priority.
    pub priorities: Vec<LeastSquares>,
}

impl Objective {
    /// Allocates memory for the tasks, and for `relaxed` rows of limits that give way, in the first priority.
    pub(crate) fn new(tasks: Vec<ResolvedTask>, nv: usize, unknowns: usize, relaxed: usize) -> Self {
        let count = tasks.iter().map(|t| t.task.priority + 1).max().unwrap_or(1);
        let rows = |p| {
            let of_tasks: usize = tasks.iter().filter(|t| t.task.priority == p).map(ResolvedTask::max_rows).sum();
            of_tasks + if p == 0 { relaxed } else { 0 }
        };
        let priorities = (0..count).map(|p| LeastSquares::new(unknowns, rows(p))).collect();
        Self { priorities, error: vec![0.0; nv], tasks }
    }

    /// Computes the rows of all tasks at the state (q, v).
    ///
    /// Each priority is regularised with ½ w_a ‖q̈‖² + ½ w_f Σ ‖f − f_ref‖², where w_a and w_f are the weights of
    /// acceleration and force in the settings.
    pub(crate) fn update(
        &mut self,
        q: &[f64],
        v: &[f64],
        k: &Kinematics,
        contacts: &[ContactRows],
        references: &References,
        settings: &Settings,
        actuated: &[usize],
        unknowns: usize,
    ) {
        let Self { tasks, error, priorities } = self;
        let PostureTarget { q: q_ref, v: v_ref, a: a_ref } = &references.posture;
        if tasks.iter().any(|task| task.task.kind == TaskKind::Posture) {
            difference(&k.model, q, q_ref, error); // q_ref ⊖ q
        }
        for objective in priorities.iter_mut() {
            objective.clear(unknowns);
        }
        for resolved in tasks.iter() {
            let Task { weight, joints, gains: Gains { stiffness, damping }, priority, .. } = &resolved.task;
            let objective = &mut priorities[*priority];
            if *weight == 0.0 {
                continue;
            }
            resolved.add(k, contacts, references, objective);
            if resolved.task.kind == TaskKind::Posture {
                for &i in actuated {
                    let a = a_ref[i] + stiffness * error[i] + damping * (v_ref[i] - v[i]);
                    let factor = joints.get(i).copied().unwrap_or(1.0);
                    if factor > 0.0 {
                        objective.add_single(i, weight * factor, a); // ½ w (q̈ᵢ − a*ᵢ)²
                        objective.single.push(i);
                    }
                }
            }
        }
        for objective in priorities {
            for i in 0..v.len() {
                objective.add_single(i, settings.acceleration_weight, 0.0); // ½ w_a q̈ᵢ²
            }
            for contact in contacts.iter().filter(|contact| contact.active) {
                for (j, (&f, weight)) in contact.reference.iter().zip(&contact.weights).enumerate() {
                    objective.add_single(contact.column + j, weight * settings.force_weight, f); // ½ w_f (f − f_ref)²
                }
            }
        }
    }
}

impl ResolvedTask {
    /// Returns the name of the frame that gives a task's axes: the frame that the task moves, or another frame.
    pub(crate) fn axes_name(task: &Task) -> Option<&str> {
        match &task.axes {
            Axes::World => None,
            Axes::Local => task.kind.frame(),
            Axes::Frame(name) => Some(name),
        }
    }
}
