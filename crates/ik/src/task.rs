//! Tasks of inverse kinematics.

use crate::error::Error;
use condyle_dynamics::Model;

/// Quantity that a task controls, with its error e. Errors are zero at the target.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum TaskKind {
    /// Pose of a frame: 6 numbers, e = log(fXt) along the axes of the frame f, with the target t; linear part first.
    Pose(String),
    /// Origin of a frame: 3 numbers, e = p_t − p along the axes of the world, or of the task's root.
    Position(String),
    /// Rotation of a frame: 3 numbers, e = log(Rᵀ R_t) along the axes of the frame.
    Orientation(String),
    /// Centre of mass: 3 numbers, e = c_t − c along the axes of the world.
    Com,
    /// Positions of all joints except free-flyers: e = q_t ⊖ q.
    Posture,
    /// Rest of all joints except free-flyers: e = 0. The weight of this task makes velocities small.
    Rest,
    /// Manipulability m = √det(J Jᵀ) of a frame, with its Jacobian J: the desired displacement of the joints is
    /// α ∂(ln m)/∂q. The factors select rows of J. Free-flyers and joints with several coordinates do not count.
    Manipulability(String),
    /// Coupling Σ r_i q_i = offset of joints with one coordinate: 1 number, e = offset − Σ r_i q_i.
    Coupling {
        /// Names of the joints, with their ratios r_i.
        joints: Vec<(String, f64)>,
        /// Right side of the equation (rad, m).
        offset: f64,
    },
}

impl TaskKind {
    /// Returns the frame that the task moves.
    pub(crate) fn frame(&self) -> Option<&str> {
        match self {
            Self::Pose(f) | Self::Position(f) | Self::Orientation(f) | Self::Manipulability(f) => Some(f),
            Self::Com | Self::Posture | Self::Rest | Self::Coupling { .. } => None,
        }
    }

    /// Returns whether the task has a target among the frames of the targets.
    pub(crate) fn has_frame_target(&self) -> bool {
        matches!(self, Self::Pose(_) | Self::Position(_) | Self::Orientation(_))
    }

    /// Returns the name of the task in messages.
    pub(crate) fn name(&self) -> &str {
        match self {
            Self::Com => "com",
            Self::Posture => "posture",
            Self::Rest => "rest",
            Self::Coupling { .. } => "coupling",
            Self::Pose(f) | Self::Position(f) | Self::Orientation(f) | Self::Manipulability(f) => f,
        }
    }

    /// Returns the number of components, to which the task's factors belong.
    pub(crate) fn components(&self, nv: usize) -> usize {
        match self {
            Self::Pose(_) | Self::Manipulability(_) => 6,
            Self::Position(_) | Self::Orientation(_) | Self::Com => 3,
            Self::Posture | Self::Rest => nv,
            Self::Coupling { .. } => 1,
        }
    }
}

/// Task with the cost ½ Σ w f_i (J Δq − α e)_i² + ½ μ Σ w f_i (α e_i)² ‖Δq‖² for the displacement Δq of one step.
///
/// e is the error of the task, and J the derivative of −e with respect to q. The names of kinds, weights and priorities
/// have the same meaning as in whole-body control. There, a task asks for an acceleration; here, it asks for the
/// displacement α e.
///
/// Tasks of priority 0 come first. Tasks of priority 1 determine only the motion that priority 0 leaves open, and so on
/// (lexicographic). Within a priority only the ratios of the weights matter.
///
/// ```
/// use condyle_ik::Task;
/// // Only the position counts along the first two axes of the tool.
/// let drill = Task { factors: vec![1.0, 1.0, 0.0, 0.0, 0.0, 0.0], ..Task::pose("tool") };
/// // Come near in half a step, and do not shake if the target is out of reach.
/// let reach = Task { gain: 0.5, damping: 1e-3, ..Task::pose("tool") };
/// # let _ = (drill, reach);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Task {
    /// The controlled quantity.
    pub kind: TaskKind,
    /// w, the weight; at least 0. A task with weight 0 has no effect.
    pub weight: f64,
    /// Factors f of the weight, one for each component of the task; empty for all 1. A factor 0 turns a component off.
    pub factors: Vec<f64>,
    /// Gain α: the fraction of the error that one step removes, from 0 to 1.
    pub gain: f64,
    /// Levenberg–Marquardt damping μ, at least 0. It makes steps smaller as long as the error is large.
    pub damping: f64,
    /// Frame relative to which pose, position or rotation of a frame are measured; `None` for the world.
    pub root: Option<String>,
    /// Priority: 0 is the highest, at most 2.
    pub priority: usize,
}

impl Task {
    fn new(kind: TaskKind, weight: f64) -> Self {
        Self { kind, weight, factors: Vec::new(), gain: 1.0, damping: 0.0, root: None, priority: 0 }
    }

    /// Creates a task for a frame's pose, weight 1. Tasks of all constructors have gain 1 and no damping.
    pub fn pose(frame: &str) -> Self {
        Self::new(TaskKind::Pose(frame.to_owned()), 1.0)
    }
    /// Creates a task for a frame's origin, weight 1.
    pub fn position(frame: &str) -> Self {
        Self::new(TaskKind::Position(frame.to_owned()), 1.0)
    }
    /// Creates a task for a frame's rotation, weight 1.
    pub fn orientation(frame: &str) -> Self {
        Self::new(TaskKind::Orientation(frame.to_owned()), 1.0)
    }
    /// Creates a task for the pose of a frame relative to another frame, `root`, weight 1.
    pub fn relative_pose(frame: &str, root: &str) -> Self {
        Self { root: Some(root.to_owned()), ..Self::pose(frame) }
    }
    /// Creates a task for the centre of mass, weight 1.
    pub fn com() -> Self {
        Self::new(TaskKind::Com, 1.0)
    }
    /// Creates a task for the joints, weight 1e-6.
    pub fn posture() -> Self {
        Self::new(TaskKind::Posture, 1e-6)
    }
    /// Creates a task that makes velocities small, weight 1e-6.
    pub fn rest() -> Self {
        Self::new(TaskKind::Rest, 1e-6)
    }
    /// Creates a task that raises the manipulability of a frame, weight 1e-6 and gain 0.1.
    pub fn manipulability(frame: &str) -> Self {
        Self { gain: 0.1, ..Self::new(TaskKind::Manipulability(frame.to_owned()), 1e-6) }
    }
    /// Creates a task that couples joints, Σ r_i q_i = offset, weight 1.
    ///
    /// ```
    /// // The right wheel turns as fast as the left wheel, backwards.
    /// let turn = condyle_ik::Task::coupling(&[("left", 1.0), ("right", 1.0)], 0.0);
    /// # let _ = turn;
    /// ```
    pub fn coupling(joints: &[(&str, f64)], offset: f64) -> Self {
        let joints = joints.iter().map(|&(name, ratio)| (name.to_owned(), ratio)).collect();
        Self::new(TaskKind::Coupling { joints, offset }, 1.0)
    }

    /// Checks all numbers of the task.
    pub(crate) fn check(&self, model: &Model) -> Result<(), Error> {
        let wrong =
            |name, value: f64, allowed| Err(Error::Task { task: self.kind.name().to_owned(), name, value, allowed });
        let finite = |x: f64| x.is_finite() && x >= 0.0;
        if !finite(self.weight) {
            return wrong("weight", self.weight, "at least 0");
        }
        if let Some(&factor) = self.factors.iter().find(|&&factor| !finite(factor)) {
            return wrong("factors", factor, "at least 0");
        }
        if !(0.0..=1.0).contains(&self.gain) {
            return wrong("gain", self.gain, "from 0 to 1");
        }
        if !finite(self.damping) {
            return wrong("damping", self.damping, "at least 0");
        }
        if self.priority > 2 {
            return wrong("priority", self.priority as f64, "0, 1 or 2");
        }
        let components = self.kind.components(model.nv());
        if !self.factors.is_empty() && self.factors.len() != components {
            let task = self.kind.name().to_owned();
            return Err(Error::Factors { task, expected: components, found: self.factors.len() });
        }
        if let (Some(root), false) = (&self.root, self.kind.has_frame_target()) {
            return Err(Error::Root { task: self.kind.name().to_owned(), root: root.clone() });
        }
        if let TaskKind::Coupling { joints, offset } = &self.kind {
            if !offset.is_finite() {
                return wrong("offset", *offset, "finite");
            }
            if let Some((_, ratio)) = joints.iter().find(|(_, ratio)| !ratio.is_finite()) {
                return wrong("ratio", *ratio, "finite");
            }
        }
        Ok(())
    }

    /// Returns the factor of component i.
    pub(crate) fn factor(&self, i: usize) -> f64 {
        self.factors.get(i).copied().unwrap_or(1.0)
    }
}

/// Returns the index in q and in v of a joint with one coordinate in each.
pub(crate) fn single_coordinate(model: &Model, joint: &str) -> Result<(usize, usize), Error> {
    let body = &model.bodies()[model.joint(joint)?];
    if body.joint.nq() == 1 && body.joint.nv() == 1 && body.mimic.is_none() {
        return Ok((body.idx_q, body.idx_v));
    }
    Err(Error::Coupling { joint: joint.to_owned() })
}
