//! Errors e and Jacobians J of the tasks at one position, as rows of √(w f) J Δq = √(w f) α e.

use crate::active_set::{axpy, dot};
use crate::error::Error;
use crate::manipulability::Manipulability;
use crate::task::{Task, TaskKind, single_coordinate};
use condyle_dynamics::{
    Act, Data, Joint, Model, Motion, Quaternion, ReferenceFrame, Se3, Vec3, centroidal_map, difference,
    forward_kinematics, lie,
};
use condyle_linalg::{Vector, Vectorized, at_level};
use nalgebra::DMatrix;

/// Targets of the tasks. [`DifferentialIk::hold`](crate::DifferentialIk::hold) returns targets that keep the present
/// values.
#[derive(Clone, Debug, PartialEq)]
pub struct Targets {
    /// Poses oXt of the frames that the tasks move, relative to the world or to the task's root. There is one for each
    /// task for a pose, a position or an orientation, in the order of the tasks. A task for a position reads only the
    /// translation, and a task for an orientation only the rotation.
    pub frames: Vec<Se3<f64>>,
    /// Position of the centre of mass (m).
    pub com: Vec3<f64>,
    /// Posture q, nq numbers.
    pub posture: Vec<f64>,
}

/// Pose and Jacobian of a frame.
#[derive(Clone, Debug)]
pub(crate) struct FrameState {
    /// Index in the model.
    pub frame: usize,
    /// oXf.
    pub pose: Se3<f64>,
    /// Jacobian along the axes of the frame, 6 × nv.
    pub J: DMatrix<f64>,
    /// Coordinates that move the frame: only these columns of J are not zero.
    pub support: Vec<usize>,
}

/// Poses and Jacobians at one position.
#[derive(Clone, Debug)]
pub(crate) struct Kinematics {
    pub data: Data<f64>,
    pub frames: Vec<FrameState>,
    with_com: bool,
    pub com: Vec3<f64>,
    Jcom: DMatrix<f64>,
}

impl Kinematics {
    pub(crate) fn new(model: &Model, frames: &[usize], with_com: bool) -> Self {
        let state = |&frame: &usize| FrameState {
            frame,
            pose: Se3::identity(),
            J: DMatrix::zeros(6, model.nv()),
            support: support(model, model.frames()[frame].body),
        };
        Self {
            data: Data::new(model),
            frames: frames.iter().map(state).collect(),
            with_com,
            com: Vec3::zero(),
            Jcom: DMatrix::zeros(3, model.nv()),
        }
    }

    /// Computes poses and Jacobians at q.
    pub(crate) fn update(&mut self, model: &Model, q: &[f64]) {
        if self.with_com {
            let map = centroidal_map(model, &mut self.data, q);
            self.com = map.com;
            self.Jcom.copy_from(map.Jcom);
        }
        let placements = match self.with_com.then(|| self.data.placements(model)).flatten() {
            Some(placements) => placements,
            None => forward_kinematics(model, &mut self.data, q),
        };
        for state in &mut self.frames {
            state.pose = placements.frame(state.frame);
            placements.frame_jacobian(state.frame, ReferenceFrame::Local, &mut state.J);
        }
    }
}

/// Returns the coordinates that move a body, in ascending order.
pub(crate) fn support(model: &Model, mut body: usize) -> Vec<usize> {
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

/// Objective of one priority: ½ ‖R Δq − r‖² + ½ Σ d_i Δq_i² − gᵀ Δq.
#[derive(Clone, Debug)]
pub(crate) struct Objective {
    n: usize,
    /// Rows of R, n numbers each.
    pub R: Vec<f64>,
    /// Right sides r.
    pub r: Vec<f64>,
    /// Diagonal d of tasks for single coordinates, and of their damping.
    pub diagonal: Vec<f64>,
    /// g.
    pub linear: Vec<f64>,
    /// Whether a task of this priority determines a coordinate by itself, for each coordinate.
    pub single: Vec<bool>,
}

impl Objective {
    fn new(n: usize, rows: usize) -> Self {
        Self {
            n,
            R: Vec::with_capacity(n * rows),
            r: Vec::with_capacity(rows),
            diagonal: vec![0.0; n],
            linear: vec![0.0; n],
            single: vec![false; n],
        }
    }

    fn clear(&mut self, damping: f64) {
        self.R.clear();
        self.r.clear();
        self.diagonal.fill(damping);
        self.linear.fill(0.0);
        self.single.fill(false);
    }

    /// Adds a row of zeros with this right side, and returns it.
    fn row(&mut self, r: f64) -> &mut [f64] {
        let from = self.R.len();
        self.R.resize(from + self.n, 0.0);
        self.r.push(r);
        &mut self.R[from..]
    }

    /// Adds ½ w (Δq_i − a)².
    fn single(&mut self, i: usize, w: f64, a: f64) {
        if w > 0.0 {
            self.diagonal[i] += w;
            self.linear[i] += w * a;
            self.single[i] = true;
        }
    }

    /// Writes H = Rᵀ R + d and c = −Rᵀ r − g. Only the lower triangle of H is written.
    pub(crate) fn write(&self, H: &mut [f64], c: &mut [f64]) {
        at_level(Write { objective: self, H, c });
    }

    #[inline(always)]
    fn write_inline(&self, H: &mut [f64], c: &mut [f64]) {
        let n = self.n;
        for j in 0..n {
            H[j * n + j..(j + 1) * n].fill(0.0);
            H[j * n + j] = self.diagonal[j];
            c[j] = -self.linear[j];
        }
        for (row, &r) in self.R.chunks_exact(n.max(1)).zip(&self.r) {
            for j in 0..n {
                if row[j] != 0.0 {
                    axpy(row[j], &row[j..], &mut H[j * n + j..(j + 1) * n]);
                    c[j] -= row[j] * r;
                }
            }
        }
    }
}

/// Writing of an objective, compiled for the vector instructions in use.
struct Write<'a> {
    objective: &'a Objective,
    H: &'a mut [f64],
    c: &'a mut [f64],
}

impl Vectorized for Write<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        self.objective.write_inline(self.H, self.c);
    }
}

/// Task with indices instead of names.
#[derive(Clone, Debug)]
struct ResolvedTask {
    task: Task,
    /// Index of the frame among the frames of the kinematics.
    frame: usize,
    /// Index of the root among the frames of the kinematics.
    root: Option<usize>,
    /// Index of the target among the frames of the targets.
    target: usize,
    /// Index in q and in v of each coupled joint, with its ratio.
    coupled: Vec<(usize, usize, f64)>,
    manipulability: Option<Manipulability>,
}

/// All tasks, with their errors and rows at one position.
#[derive(Clone, Debug)]
pub(crate) struct Tasks {
    tasks: Vec<ResolvedTask>,
    /// Objective of each priority.
    pub priorities: Vec<Objective>,
    /// Error of each task: its linear and its angular part (m, rad). The parts of posture and coupling are both in
    /// the second number. Damping and manipulability have no error.
    pub errors: Vec<[f64; 2]>,
    /// q_t ⊖ q.
    posture: Vec<f64>,
    /// Coordinates that the posture determines.
    actuated: Vec<usize>,
    /// Number of frame targets.
    pub frame_targets: usize,
    /// Whether a task reads the posture, or the centre of mass.
    pub reads: [bool; 2],
}

impl Tasks {
    /// Resolves all names. Returns the tasks, and the indices of their frames in the model.
    pub(crate) fn new(model: &Model, tasks: &[Task]) -> Result<(Self, Vec<usize>), Error> {
        let mut frames: Vec<usize> = Vec::new();
        let mut place = |name: &str| -> Result<usize, Error> {
            let frame = model.frame(name)?;
            Ok(frames.iter().position(|&f| f == frame).unwrap_or_else(|| {
                frames.push(frame);
                frames.len() - 1
            }))
        };
        let (mut resolved, mut frame_targets) = (Vec::new(), 0);
        for task in tasks {
            task.check(model)?;
            let frame = task.kind.frame().map(&mut place).transpose()?.unwrap_or(0);
            let root = task.root.as_deref().map(&mut place).transpose()?;
            let mut coupled = Vec::new();
            if let TaskKind::Coupling { joints, .. } = &task.kind {
                for (name, ratio) in joints {
                    let (q, v) = single_coordinate(model, name)?;
                    coupled.push((q, v, *ratio));
                }
            }
            let manipulability = match &task.kind {
                TaskKind::Manipulability(name) => Some(Manipulability::new(model, model.frame(name)?)),
                _ => None,
            };
            if task.kind == TaskKind::Com && !model.bodies().iter().skip(1).any(|b| b.inertia.mass > 0.0) {
                return Err(Error::NoMass { robot: model.name().to_owned() });
            }
            let target = frame_targets;
            frame_targets += usize::from(task.kind.has_frame_target());
            resolved.push(ResolvedTask { task: task.clone(), frame, root, target, coupled, manipulability });
        }
        let (nv, count) = (model.nv(), tasks.iter().map(|t| t.priority + 1).max().unwrap_or(1));
        let rows = |p: usize| {
            let rows = |task: &Task| match task.kind {
                TaskKind::Posture | TaskKind::Rest | TaskKind::Manipulability(_) => 0,
                _ => task.kind.components(nv),
            };
            tasks.iter().filter(|task| task.priority == p).map(rows).sum()
        };
        let mut actuated = Vec::new();
        for body in model.bodies().iter().skip(1).filter(|b| b.mimic.is_none() && b.joint != Joint::FreeFlyer) {
            actuated.extend(body.idx_v..body.idx_v + body.joint.nv());
        }
        let reads = [TaskKind::Posture, TaskKind::Com].map(|kind| tasks.iter().any(|task| task.kind == kind));
        let priorities = (0..count).map(|p| Objective::new(nv, rows(p))).collect();
        let (posture, errors) = (vec![0.0; nv], vec![[0.0; 2]; tasks.len()]);
        Ok((Self { tasks: resolved, priorities, errors, posture, actuated, frame_targets, reads }, frames))
    }

    /// Returns targets that keep the present values of all tasks.
    pub(crate) fn hold(&self, k: &Kinematics, q: &[f64]) -> Targets {
        let pose = |task: &ResolvedTask| {
            let oXf = k.frames[task.frame].pose;
            task.root.map_or(oXf, |root| k.frames[root].pose.inverse() * oXf)
        };
        let moved = self.tasks.iter().filter(|task| task.task.kind.has_frame_target());
        Targets { frames: moved.map(pose).collect(), com: k.com, posture: q.to_vec() }
    }

    /// Returns the largest linear and the largest angular error of the tasks of priority 0 with a gain and a weight,
    /// except postures.
    pub(crate) fn first_errors(&self) -> [f64; 2] {
        let mut most = [0.0_f64; 2];
        for (task, error) in self.tasks.iter().zip(&self.errors) {
            let Task { kind, weight, gain, priority, .. } = &task.task;
            if *priority == 0 && *weight > 0.0 && *gain > 0.0 && *kind != TaskKind::Posture {
                (0..2).for_each(|k| most[k] = most[k].max(error[k]));
            }
        }
        most
    }

    /// Computes the errors and rows of all tasks at q.
    pub(crate) fn update(&mut self, model: &Model, q: &[f64], k: &Kinematics, targets: &Targets, damping: f64) {
        for objective in &mut self.priorities {
            objective.clear(damping);
        }
        if self.reads[0] {
            difference(model, q, &targets.posture, &mut self.posture); // q_t ⊖ q
        }
        for (task, error) in self.tasks.iter_mut().zip(&mut self.errors) {
            let objective = &mut self.priorities[task.task.priority];
            let mu = task.task.gain.powi(2) * task.add(q, k, targets, &self.posture, &self.actuated, objective, error);
            if mu > 0.0 {
                objective.diagonal.iter_mut().for_each(|d| *d += mu);
            }
        }
    }
}

impl ResolvedTask {
    /// Adds the task to the objective, and returns its Levenberg–Marquardt damping μ Σ w f e².
    fn add(
        &mut self,
        q: &[f64],
        k: &Kinematics,
        targets: &Targets,
        posture: &[f64],
        actuated: &[usize],
        objective: &mut Objective,
        error: &mut [f64; 2],
    ) -> f64 {
        let Task { weight, gain, damping, .. } = self.task;
        match &self.task.kind {
            TaskKind::Pose(_) | TaskKind::Position(_) | TaskKind::Orientation(_) => {
                let (e, X) = self.frame_error(k, &targets.frames[self.target]);
                *error = [e.linear.norm_squared().sqrt(), e.angular.norm_squared().sqrt()];
                weight * damping * self.add_frame(k, e, X, objective)
            }
            TaskKind::Com => {
                let e = targets.com - k.com;
                *error = [e.norm_squared().sqrt(), 0.0];
                let mut square = 0.0;
                for (i, e) in e.to_array().into_iter().enumerate() {
                    let w = weight * self.task.factor(i);
                    square += w * e * e;
                    if w > 0.0 {
                        let root = w.sqrt();
                        let row = objective.row(root * gain * e);
                        row.iter_mut().zip(k.Jcom.row(i).iter()).for_each(|(x, J)| *x = root * J);
                    }
                }
                damping * square
            }
            TaskKind::Posture => {
                let (mut square, mut length) = (0.0, 0.0);
                for &i in actuated {
                    let w = weight * self.task.factor(i);
                    objective.single(i, w, gain * posture[i]);
                    square += w * posture[i] * posture[i];
                    length += posture[i] * posture[i];
                }
                *error = [0.0, length.sqrt()];
                damping * square
            }
            TaskKind::Rest => {
                actuated.iter().for_each(|&i| objective.single(i, weight * self.task.factor(i), 0.0));
                0.0
            }
            TaskKind::Manipulability(_) => {
                let manipulability = self.manipulability.as_mut().expect("resolved");
                let factors = std::array::from_fn(|i| self.task.factor(i));
                manipulability.update(&k.frames[self.frame].J, &factors);
                for (&i, &slope) in manipulability.joints.iter().zip(&manipulability.gradient) {
                    objective.single(i, weight, gain * slope);
                }
                0.0
            }
            TaskKind::Coupling { offset, .. } => {
                let e = offset - self.coupled.iter().map(|&(i, _, ratio)| ratio * q[i]).sum::<f64>();
                *error = [0.0, e.abs()];
                let w = weight * self.task.factor(0);
                if w > 0.0 {
                    let root = w.sqrt();
                    let row = objective.row(root * gain * e);
                    self.coupled.iter().for_each(|&(_, i, ratio)| row[i] += root * ratio);
                }
                damping * w * e * e
            }
        }
    }

    /// Returns the error of a frame's pose, position or rotation, and the pose rXf of the frame in its root.
    fn frame_error(&self, k: &Kinematics, rXt: &Se3<f64>) -> (Motion<f64>, Se3<f64>) {
        let oXf = k.frames[self.frame].pose;
        let rXf = self.root.map_or(oXf, |root| k.frames[root].pose.inverse() * oXf);
        let fXt = rXf.inverse() * *rXt;
        let rotation = Quaternion::from_rotation(fXt.rotation);
        let error = match self.task.kind {
            TaskKind::Pose(_) => lie::log6(rotation, fXt.translation),
            TaskKind::Position(_) => Motion::new(rXt.translation - rXf.translation, Vec3::zero()),
            _ => Motion::new(Vec3::zero(), lie::log3(rotation)),
        };
        (error, rXf)
    }

    /// Adds the rows of a frame's task with the error e, and returns Σ f e².
    fn add_frame(&self, k: &Kinematics, e: Motion<f64>, rXf: Se3<f64>, objective: &mut Objective) -> f64 {
        let back = Motion::zero() - e;
        // J is the derivative of −e with respect to a motion of the frame, along its axes.
        let (first, count) = match self.task.kind {
            TaskKind::Orientation(_) => (3, 3),
            TaskKind::Position(_) => (0, 3),
            _ => (0, 6),
        };
        let (J6, J3) = (lie::jlog6(back), lie::jlog3(back.angular));
        let derivative = |m: Motion<f64>| match self.task.kind {
            TaskKind::Pose(_) => (J6 * m).to_array(),
            TaskKind::Position(_) => Motion::new(rXf.rotation * m.linear, Vec3::zero()).to_array(),
            _ => Motion::new(Vec3::zero(), J3 * m.angular).to_array(),
        };
        let (n, from, errors) = (objective.n, objective.R.len(), e.to_array());
        let (mut roots, mut square) = ([0.0; 6], 0.0);
        for i in 0..count {
            let f = self.task.factor(i);
            square += f * errors[first + i] * errors[first + i];
            roots[i] = (self.task.weight * f).sqrt();
            if roots[i] > 0.0 {
                objective.row(roots[i] * self.task.gain * errors[first + i]);
            }
        }
        let mut write = |coordinate: usize, m: Motion<f64>| {
            let (column, mut row) = (derivative(m), 0);
            for i in 0..count {
                if roots[i] > 0.0 {
                    objective.R[from + row * n + coordinate] += roots[i] * column[first + i];
                    row += 1;
                }
            }
        };
        let frame = &k.frames[self.frame];
        for &c in &frame.support {
            write(c, motion(&frame.J, c));
        }
        if let Some(root) = self.root {
            let root = &k.frames[root];
            for &c in &root.support {
                write(c, Motion::zero() - rXf.act_inv(motion(&root.J, c))); // minus the motion of the root
            }
        }
        square
    }
}

/// Returns column c of a Jacobian.
fn motion(J: &DMatrix<f64>, c: usize) -> Motion<f64> {
    let [a, b, c, d, e, f] = std::array::from_fn(|i| J.as_slice()[6 * c + i]);
    Motion::new(Vec3::new(a, b, c), Vec3::new(d, e, f))
}

/// Returns the row product R_i x.
pub(crate) fn value(row: &[f64], x: &[f64]) -> f64 {
    dot(row, x)
}
