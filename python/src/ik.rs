//! Inverse kinematics: the compiled part of the module `condyle.ik`, which has the public classes.

use crate::arrays::{Array, Give, array, check_last_row, numbers, output, vector};
use crate::distances::valid_placement;
use crate::exceptions::ik_error;
use crate::model::Model;
use crate::optimal::lock;
use condyle::distances::{DistancePairs, GeometryPair};
use condyle::ik as rust;
use condyle::spatial::Mat3;
use condyle::{Se3, Vec3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use rust::{DistanceLimits, Held, JointLimits, Outcome, Rank, SearchSettings, Status, Targets, Task, TaskKind};
use std::sync::Mutex;

/// Members of the named tuple `Task`, in order.
type TaskMembers<'py> =
    (String, Option<String>, f64, Option<Bound<'py, PyAny>>, f64, f64, Option<String>, usize, Vec<(String, f64)>, f64);

/// Members of the named tuple `JointLimits`, in order: the gain, and lists of numbers or None.
type LimitMembers<'py> =
    (f64, Option<Bound<'py, PyAny>>, Option<Bound<'py, PyAny>>, Option<Bound<'py, PyAny>>, Option<Bound<'py, PyAny>>);

/// Limit that holds a step or a posture back: its kind, and the index of a coordinate or of a pair.
type HeldMembers = (&'static str, usize);
/// Numbers of a step: Δq, the status, the errors, and the limits that hold it.
type StepMembers<'py> = (Bound<'py, PyAny>, &'static str, Bound<'py, PyAny>, Vec<HeldMembers>);
/// Numbers of answers: postures, whether each is reached, errors, numbers of starts, and the limits that hold each.
type AnswerMembers<'py> = (Bound<'py, PyAny>, Vec<bool>, Bound<'py, PyAny>, Vec<usize>, Vec<Vec<HeldMembers>>);

fn list(name: &str, given: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Vec<f64>>> {
    given.map(|given| numbers(name, given)).transpose()
}

fn read_task(members: TaskMembers<'_>) -> PyResult<Task> {
    let (kind, frame, weight, factors, gain, damping, root, priority, joints, offset) = members;
    let named = |make: fn(String) -> TaskKind| match &frame {
        Some(frame) => Ok(make(frame.clone())),
        None => Err(PyValueError::new_err(format!("task '{kind}': frame: expected a name, found None"))),
    };
    let kind = match kind.as_str() {
        "pose" => named(TaskKind::Pose)?,
        "position" => named(TaskKind::Position)?,
        "orientation" => named(TaskKind::Orientation)?,
        "manipulability" => named(TaskKind::Manipulability)?,
        "com" => TaskKind::Com,
        "posture" => TaskKind::Posture,
        "rest" => TaskKind::Rest,
        "coupling" => TaskKind::Coupling { joints, offset },
        other => return Err(PyValueError::new_err(format!("task: kind: '{other}' is not a kind of task"))),
    };
    let factors = list("factors", factors.as_ref())?.unwrap_or_default();
    Ok(Task { kind, weight, factors, gain, damping, root, priority })
}

fn read_pairs(text: &str) -> PyResult<Vec<GeometryPair>> {
    serde_json::from_str(text).map_err(|error| PyValueError::new_err(format!("pairs: {error}")))
}

fn give_held(held: &[Held]) -> Vec<HeldMembers> {
    let members = |held: &Held| match *held {
        Held::Lower(i) => ("lower", i),
        Held::Upper(i) => ("upper", i),
        Held::Pair(i) => ("pair", i),
        _ => ("other", 0),
    };
    held.iter().map(members).collect()
}

fn read_held(kind: &str, index: usize) -> PyResult<Held> {
    match kind {
        "lower" => Ok(Held::Lower(index)),
        "upper" => Ok(Held::Upper(index)),
        "pair" => Ok(Held::Pair(index)),
        other => Err(PyValueError::new_err(format!("held: expected 'lower', 'upper' or 'pair', found '{other}'"))),
    }
}

/// Reads poses: 16 numbers for each, by rows.
fn read_poses(name: &str, numbers: &[f64], poses: &mut Vec<Se3<f64>>) -> PyResult<()> {
    for (k, m) in numbers.chunks_exact(16).enumerate() {
        if check_last_row("", &m[12..]).is_err() {
            check_last_row(&format!("{name}[{k}]"), &m[12..])?;
        }
    }
    poses.clear();
    poses.extend(numbers.chunks_exact(16).map(|m| {
        let column = |c: usize| Vec3::new(m[c], m[4 + c], m[8 + c]);
        Se3::new(Mat3 { x: column(0), y: column(1), z: column(2) }, column(3))
    }));
    Ok(())
}

/// Steps of differential inverse kinematics; see `condyle.ik.DifferentialIk`.
#[pyclass(frozen, name = "_DifferentialIk", module = "condyle._condyle")]
pub(crate) struct DifferentialIk {
    inner: Mutex<Inner>,
    nq: usize,
    nv: usize,
    frames: usize,
}

struct Inner {
    ik: rust::DifferentialIk,
    targets: Targets,
}

impl DifferentialIk {
    /// Reads targets into the scratch memory.
    fn read(
        &self,
        inner: &mut Inner,
        frames: &Bound<'_, PyAny>,
        com: &Bound<'_, PyAny>,
        posture: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let poses = crate::arrays::tensor("targets.frames", frames, [self.frames, 4, 4])?;
        read_poses("targets.frames", &poses, &mut inner.targets.frames)?;
        inner.targets.com = crate::arrays::three("targets.com", com)?;
        inner.targets.posture.copy_from_slice(&vector("targets.posture", posture, self.nq)?);
        Ok(())
    }
}

#[pymethods]
impl DifferentialIk {
    #[new]
    #[pyo3(signature = (model, tasks, dt, damping, limits, distances))]
    fn new(
        model: &Bound<'_, Model>,
        tasks: Vec<TaskMembers<'_>>,
        dt: f64,
        damping: f64,
        limits: Option<LimitMembers<'_>>,
        distances: Option<(String, f64, f64, f64, f64)>,
    ) -> PyResult<Self> {
        let tasks = tasks.into_iter().map(read_task).collect::<PyResult<Vec<_>>>()?;
        let limits = match limits {
            Some((gain, lower, upper, velocity, acceleration)) => Some(JointLimits {
                gain,
                lower: list("limits.lower", lower.as_ref())?,
                upper: list("limits.upper", upper.as_ref())?,
                velocity: list("limits.velocity", velocity.as_ref())?,
                acceleration: list("limits.acceleration", acceleration.as_ref())?,
            }),
            None => None,
        };
        let distances = match distances {
            Some((pairs, minimum, look_ahead, max_acceleration, range)) => {
                let pairs = read_pairs(&pairs)?;
                Some(DistanceLimits { pairs, minimum, look_ahead, max_acceleration, range })
            }
            None => None,
        };
        let (robot, settings) = (&model.get().inner, rust::Settings { dt, damping, limits, distances });
        let mut ik = rust::DifferentialIk::new(robot, &tasks, settings).map_err(ik_error)?;
        let targets = ik.hold(&condyle::neutral(robot)).map_err(ik_error)?;
        let frames = targets.frames.len();
        Ok(Self { inner: Mutex::new(Inner { ik, targets }), nq: robot.nq(), nv: robot.nv(), frames })
    }

    /// Returns the poses of all frames, the centre of mass and the posture at q.
    fn _hold<'py>(&self, py: Python<'py>, q: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyTuple>> {
        let q = vector("q", q, self.nq)?;
        let mut inner = lock("ik", &self.inner)?;
        let targets = inner.ik.hold(&q).map_err(ik_error)?;
        let poses = output(py, None, &[self.frames, 4, 4], |out| {
            targets.frames.iter().zip(out.chunks_exact_mut(16)).for_each(|(pose, out)| pose.write(out));
        })?;
        PyTuple::new(py, [poses, targets.com.give(py, None)?, targets.posture.give(py, None)?])
    }

    /// Makes a step: returns its velocity, status, errors and the limits that hold it back.
    fn _step<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'_, PyAny>,
        v0: Option<&Bound<'_, PyAny>>,
        frames: &Bound<'_, PyAny>,
        com: &Bound<'_, PyAny>,
        posture: &Bound<'_, PyAny>,
    ) -> PyResult<StepMembers<'py>> {
        let mut inner = lock("ik", &self.inner)?;
        self.read(&mut inner, frames, com, posture)?;
        let q = vector("q", q, self.nq)?;
        let v0 = v0.map_or_else(|| Ok(vec![0.0; self.nv]), |v0| vector("v0", v0, self.nv).map(|v0| v0.to_vec()))?;
        let Inner { ik, targets } = &mut *inner;
        let step = ik.step(&q, &v0, targets).map_err(ik_error)?;
        let status = match step.status {
            Status::Solved => "solved",
            Status::Relaxed => "relaxed",
            _ => "stopped",
        };
        Ok((step.v.give(py, None)?, status, give_errors(py, &step.errors)?, give_held(&step.held)))
    }

    /// Makes many steps: returns the last position, the number of steps and the errors there.
    fn _converge<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'_, PyAny>,
        frames: &Bound<'_, PyAny>,
        com: &Bound<'_, PyAny>,
        posture: &Bound<'_, PyAny>,
        tolerance: [f64; 2],
        steps: usize,
    ) -> PyResult<(Bound<'py, PyAny>, usize, Bound<'py, PyAny>)> {
        let mut inner = lock("ik", &self.inner)?;
        self.read(&mut inner, frames, com, posture)?;
        let mut q = vector("q", q, self.nq)?.to_vec();
        let Inner { ik, targets } = &mut *inner;
        let made = py.detach(|| ik.converge(&mut q, targets, tolerance, steps)).map_err(ik_error)?;
        Ok((q.give(py, None)?, made, give_errors(py, &ik.last().errors)?))
    }

    /// Returns a limit in words.
    fn _describe(&self, kind: &str, index: usize) -> PyResult<String> {
        Ok(lock("ik", &self.inner)?.ik.describe(read_held(kind, index)?))
    }

    /// Returns the nearest pair before the last step, and its distance.
    fn _nearest(&self) -> PyResult<Option<(usize, f64)>> {
        Ok(lock("ik", &self.inner)?.ik.nearest())
    }

    /// Sets placement and velocity of the geometry with a name; returns whether it exists.
    #[pyo3(signature = (name, placement, velocity))]
    fn _place(&self, name: &str, placement: &Bound<'_, PyAny>, velocity: Option<&Bound<'_, PyAny>>) -> PyResult<bool> {
        place(lock("ik", &self.inner)?.ik.pairs_mut(), name, placement, velocity)
    }
}

/// Sets placement and velocity (0 if `None`) of the geometry with a name; returns whether it exists.
pub(crate) fn place(
    pairs: Option<&mut DistancePairs>,
    name: &str,
    placement: &Bound<'_, PyAny>,
    velocity: Option<&Bound<'_, PyAny>>,
) -> PyResult<bool> {
    let placement = valid_placement(placement)?;
    let numbers = velocity.map(|velocity| array::<6>("velocity", velocity)).transpose()?;
    if let Some(numbers) = numbers.filter(|numbers| !numbers.iter().all(|x| x.is_finite())) {
        return Err(PyValueError::new_err(format!("velocity: expected finite numbers, found {numbers:?}")));
    }
    let Some((pairs, geometry)) = pairs.and_then(|pairs| pairs.find(name).map(|geometry| (pairs, geometry))) else {
        return Ok(false);
    };
    pairs.place(geometry, placement);
    match (numbers, &pairs.geometry(geometry).frame) {
        (Some(_), Some(frame)) => {
            let what =
                format!("velocity: `{name}` is on the frame `{}`; only obstacles in the world have one", frame.name);
            return Err(PyValueError::new_err(what));
        }
        (None, Some(_)) => {}
        (numbers, None) => pairs.set_velocity(geometry, numbers.unwrap_or_default().into()),
    }
    Ok(true)
}

/// Returns pairs of errors as an array (n, 2).
fn give_errors<'py>(py: Python<'py>, errors: &[[f64; 2]]) -> PyResult<Bound<'py, PyAny>> {
    output(py, None, &[errors.len(), 2], |out| out.copy_from_slice(errors.as_flattened())).map(Bound::into_any)
}

/// Search for postures; see `condyle.ik.GlobalIk`.
#[pyclass(frozen, name = "_GlobalIk", module = "condyle._condyle")]
pub(crate) struct GlobalIk {
    inner: Mutex<rust::GlobalIk>,
    nq: usize,
    frames: usize,
}

#[pymethods]
impl GlobalIk {
    #[new]
    #[pyo3(signature = (model, frames, tolerance, orientation_weight, counts, rank, seed, limits, pairs, minimum))]
    fn new(
        model: &Bound<'_, Model>,
        frames: Vec<String>,
        tolerance: [f64; 2],
        orientation_weight: f64,
        counts: [usize; 5],
        rank: &str,
        seed: u64,
        limits: (Option<Bound<'_, PyAny>>, Option<Bound<'_, PyAny>>),
        pairs: &str,
        minimum: f64,
    ) -> PyResult<Self> {
        let [starts, iterations, solutions, table, threads] = counts;
        let rank = match rank {
            "first" => Rank::First,
            "nearest" => Rank::Nearest,
            "manipulability" => Rank::Manipulability,
            other => {
                let expected = "'first', 'nearest' or 'manipulability'";
                return Err(crate::exceptions::wrong_word("rank", expected, other));
            }
        };
        let settings = SearchSettings {
            tolerance,
            orientation_weight,
            starts,
            iterations,
            solutions,
            rank,
            table,
            seed,
            threads,
            lower: list("lower", limits.0.as_ref())?,
            upper: list("upper", limits.1.as_ref())?,
            pairs: read_pairs(pairs)?,
            minimum_distance: minimum,
        };
        let names: Vec<&str> = frames.iter().map(String::as_str).collect();
        let robot = &model.get().inner;
        let ik = rust::GlobalIk::new(robot, &names, settings).map_err(ik_error)?;
        Ok(Self { inner: Mutex::new(ik), nq: robot.nq(), frames: frames.len() })
    }

    /// Searches postures for targets: `count` times one pose for each frame. Returns positions, whether each target is
    /// reached, errors, numbers of starts, and the limits that hold each posture back.
    fn _solve<'py>(
        &self,
        py: Python<'py>,
        targets: &Bound<'_, PyAny>,
        count: usize,
        posture: &Bound<'_, PyAny>,
    ) -> PyResult<AnswerMembers<'py>> {
        let mut poses = Vec::new();
        read_poses("targets", &crate::arrays::tensor("targets", targets, [count * self.frames, 4, 4])?, &mut poses)?;
        let posture = vector("posture", posture, self.nq)?.to_vec();
        let ik = lock("ik", &self.inner)?;
        let ik = &*ik;
        let answers = py.detach(|| ik.solve_many(&poses, &posture)).map_err(ik_error)?;
        let q = output(py, None, &[count, self.nq], |out| {
            answers.iter().zip(out.chunks_exact_mut(self.nq.max(1))).for_each(|(a, out)| out.copy_from_slice(&a.q));
        })?;
        let errors: Vec<[f64; 2]> = answers.iter().map(|answer| answer.error).collect();
        let held = |answer: &rust::Posture| match &answer.outcome {
            Outcome::Unreached { held } => give_held(held),
            _ => Vec::new(),
        };
        Ok((
            q.into_any(),
            answers.iter().map(rust::Posture::reached).collect(),
            give_errors(py, &errors)?,
            answers.iter().map(|answer| answer.starts).collect(),
            answers.iter().map(held).collect(),
        ))
    }

    /// Returns a limit in words.
    fn _describe(&self, kind: &str, index: usize) -> PyResult<String> {
        Ok(lock("ik", &self.inner)?.describe(read_held(kind, index)?))
    }

    /// Sets the placement of the geometry with a name; returns whether it exists.
    fn _place(&self, name: &str, placement: &Bound<'_, PyAny>) -> PyResult<bool> {
        place(lock("ik", &self.inner)?.pairs_mut(), name, placement, None)
    }
}
