//! Search for postures: its description, its table of starts, and the choice among the postures that were found.
//!
//! The starts of a target are, in order: the given posture; the entries of a table of random configurations whose
//! frames are nearest to the target; random configurations. A search ends after the first starts that succeed, in the
//! order of the starts. So the answers do not depend on the number of lanes and threads.

use crate::bounds::position_limits;
use crate::descent::{Aim, Narrow, TARGET, Wide, write_target};
use crate::error::{Error, length, poses};
use crate::held::Held;
use crate::search::{Search, Trial};
use crate::search_settings::{Rank, SearchSettings};
use condyle_dynamics::distances::{DistancePairs, Distances};
use condyle_dynamics::{Data, Model, ReferenceFrame, Se3, distance, forward_kinematics, random_configuration};
use condyle_linalg::threads;
use condyle_spatial::level::{Level, level};
use rand::SeedableRng;
use rand::rngs::StdRng;

/// Result of the search for one target.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Outcome {
    /// The posture reaches the target within the tolerance, and all limits hold.
    Reached,
    /// No start reached the target. The posture is the nearest that was found, and limits of the joints hold.
    Unreached {
        /// Limits of the joints that stop the posture from coming nearer, and the pair whose distance excludes a
        /// posture that reaches the target. The list is empty if the target is out of reach for other reasons.
        held: Vec<Held>,
    },
}

/// Answer of a search for one target.
#[derive(Clone, Debug, PartialEq)]
pub struct Posture {
    /// Position, nq numbers.
    pub q: Vec<f64>,
    /// Whether the target is reached, and otherwise what holds the robot back.
    pub outcome: Outcome,
    /// Largest position error of the frames (m), and largest rotation error (rad).
    pub error: [f64; 2],
    /// Number of starts that were needed.
    pub starts: usize,
}

impl Posture {
    /// Returns whether the target is reached.
    pub fn reached(&self) -> bool {
        self.outcome == Outcome::Reached
    }
}

/// Random configurations with the poses of their frames.
#[derive(Clone, Debug, Default)]
pub(crate) struct Table {
    /// nq numbers for each entry.
    pub q: Vec<f64>,
    /// Numbers of the poses of all frames, for each entry.
    pub poses: Vec<f64>,
}

/// Maximum number of draws for an entry of the table. They end at the first configuration whose pairs are far enough
/// apart.
const DRAWS: usize = 20;

/// Memory with which distances are computed.
pub(crate) struct Apart {
    data: Data<f64>,
    results: Distances,
}

impl Apart {
    /// Returns the nearest pair at q if it is nearer than the settings allow.
    pub(crate) fn collision(&mut self, ik: &GlobalIk, q: &[f64]) -> Option<usize> {
        let pairs = ik.pairs.as_ref()?;
        pairs.values(forward_kinematics(&ik.model, &mut self.data, q), &mut self.results);
        self.results.nearest().filter(|&(_, d)| d < ik.settings.minimum_distance).map(|(pair, _)| pair)
    }
}

/// Global inverse kinematics: postures for target poses of one or several frames.
///
/// ```
/// use condyle_dynamics::{Data, forward_kinematics, robots};
/// use condyle_ik::{GlobalIk, SearchSettings};
/// let arm = robots::arm7();
/// let ik = GlobalIk::new(&arm, &["tool"], SearchSettings::default())?;
/// let tool = arm.frame("tool")?;
/// let target = forward_kinematics(&arm, &mut Data::new(&arm), &[0.5, 0.4, -0.3, 1.0, 0.2, 0.7, 0.1]).frame(tool);
/// let posture = ik.solve(&[target], &[0.0; 7])?; // from anywhere
/// assert!(posture.reached() && posture.error[0] < 1e-4);
/// # Ok::<(), condyle_ik::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct GlobalIk {
    pub(crate) model: Model,
    pub(crate) aim: Aim,
    pub(crate) settings: SearchSettings,
    pub(crate) table: Table,
    pub(crate) pairs: Option<DistancePairs>,
}

impl GlobalIk {
    /// Checks all arguments and computes a table of configurations.
    ///
    /// # Errors
    /// [`Error`] for an unknown frame, and for a number outside of its range.
    pub fn new(model: &Model, frames: &[&str], settings: SearchSettings) -> Result<Self, Error> {
        settings.check(model)?;
        if frames.is_empty() {
            return Err(Error::NoFrames);
        }
        let frames = frames.iter().map(|name| model.frame(name)).collect::<Result<Vec<_>, _>>()?;
        let supports = frames.iter().map(|&f| crate::rows::support(model, model.frames()[f].body)).collect();
        let lower = settings.lower.as_deref().unwrap_or(&model.limits().lower);
        let upper = settings.upper.as_deref().unwrap_or(&model.limits().upper);
        let limits = position_limits(model, lower, upper)?.into_iter().enumerate();
        let limits = limits.filter_map(|(v, limit)| limit.map(|(q, lower, upper)| (q, v, lower, upper))).collect();
        let pairs = match settings.pairs.is_empty() {
            true => None,
            false => {
                let mut pairs = DistancePairs::new(model, &settings.pairs)?;
                pairs.set_cutoff(settings.minimum_distance.max(0.0));
                Some(pairs)
            }
        };
        let aim = Aim { frames, supports, weights: [1.0, settings.orientation_weight], limits };
        let mut ik = Self { model: model.clone(), aim, settings, table: Table::default(), pairs };
        ik.fill_table();
        Ok(ik)
    }

    /// Returns the model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Returns the settings.
    pub fn settings(&self) -> &SearchSettings {
        &self.settings
    }

    /// Returns the pairs that must be apart. [`DistancePairs::place`] moves an obstacle. The table of starts does not
    /// change.
    pub fn pairs_mut(&mut self) -> Option<&mut DistancePairs> {
        self.pairs.as_mut()
    }

    /// Searches a posture for the target poses oXt of all frames, first from `posture`: nq numbers. If the settings
    /// rank by distance, the answer is the nearest to `posture` of those that were found.
    ///
    /// # Errors
    /// [`Error`] for lists of the wrong length, numbers that are not finite, and matrices that are not rotations.
    pub fn solve(&self, targets: &[Se3<f64>], posture: &[f64]) -> Result<Posture, Error> {
        let frames = self.aim.frames.len();
        length("targets", targets.len(), frames)?;
        Ok(self.solve_many(targets, posture)?.remove(0))
    }

    /// Searches a posture for each target. A target consists of one pose for each frame; `targets` has the poses of all
    /// targets, one target after the other. The answers are the same as with [`solve`](Self::solve).
    ///
    /// # Errors
    /// In the same cases as [`solve`](Self::solve).
    pub fn solve_many(&self, targets: &[Se3<f64>], posture: &[f64]) -> Result<Vec<Posture>, Error> {
        let frames = self.aim.frames.len();
        length("targets", targets.len(), targets.len() / frames * frames)?;
        poses("targets", targets)?;
        length("posture", posture.len(), self.model.nq())?;
        self.model.check_position(posture)?;
        let count = targets.len() / frames;
        let mut answers = vec![None; count];
        self.spread(targets, posture, &mut answers, self.settings.threads.min(count).max(1));
        Ok(answers.into_iter().map(|answer| answer.expect("all targets were searched")).collect())
    }

    /// Returns a limit in words, with the name of the joint.
    pub fn describe(&self, held: Held) -> String {
        held.describe(&self.model, self.pairs.as_ref(), None)
    }

    fn fill_table(&mut self) {
        let (model, mut rng) = (&self.model, StdRng::seed_from_u64(self.settings.seed));
        let mut data = Data::new(model);
        let mut numbers = [0.0; TARGET];
        let mut apart = self.apart();
        for _ in 0..self.settings.table {
            let mut q = self.draw(&mut rng);
            for _ in 1..DRAWS {
                if apart.as_mut().and_then(|apart| apart.collision(self, &q)).is_none() {
                    break;
                }
                q = self.draw(&mut rng);
            }
            let placements = forward_kinematics(model, &mut data, &q);
            for &frame in &self.aim.frames {
                write_target(&placements.frame(frame), &mut numbers);
                self.table.poses.extend_from_slice(&numbers);
            }
            self.table.q.extend(q);
        }
    }

    /// Returns the memory of distances; `None` without pairs.
    pub(crate) fn apart(&self) -> Option<Apart> {
        self.pairs.as_ref().map(|pairs| Apart { data: Data::new(&self.model), results: Distances::new(pairs) })
    }

    /// Returns a random configuration within the limits.
    pub(crate) fn draw(&self, rng: &mut StdRng) -> Vec<f64> {
        let mut q = random_configuration(&self.model, rng);
        self.clip(&mut q);
        q
    }

    pub(crate) fn clip(&self, q: &mut [f64]) {
        for &(i, _, lower, upper) in &self.aim.limits {
            q[i] = q[i].max(lower).min(upper);
        }
    }

    /// Divides the targets among threads.
    fn spread(&self, targets: &[Se3<f64>], posture: &[f64], answers: &mut [Option<Posture>], count: usize) {
        if count == 1 {
            return match level() {
                Level::Baseline => Search::<f64>::new(self, targets, posture).run(answers),
                Level::Avx512 => Search::<Wide>::new(self, targets, posture).run(answers),
                _ => Search::<Narrow>::new(self, targets, posture).run(answers),
            };
        }
        let half = answers.len() * (count / 2) / count;
        let (first, second) = answers.split_at_mut(half);
        let (from, to) = targets.split_at(half * self.aim.frames.len());
        threads::join(
            || self.spread(from, posture, first, count / 2),
            || self.spread(to, posture, second, count - count / 2),
        );
    }

    /// Returns what holds a posture back: limits towards which the error pulls.
    pub(crate) fn held(&self, q: &[f64], target: &[Se3<f64>]) -> Vec<Held> {
        let mut data = Data::new(&self.model);
        let mut pull = vec![0.0; self.model.nv()];
        let placements = forward_kinematics(&self.model, &mut data, q);
        let mut J = nalgebra::DMatrix::zeros(6, self.model.nv());
        for (&frame, oXt) in self.aim.frames.iter().zip(target) {
            let oXf = placements.frame(frame);
            placements.frame_jacobian(frame, ReferenceFrame::LocalWorldAligned, &mut J);
            let turn = condyle_dynamics::Quaternion::from_rotation(oXt.rotation * oXf.rotation.transpose());
            let e = [oXt.translation - oXf.translation, condyle_dynamics::lie::log3(turn)];
            for (column, pull) in J.column_iter().zip(&mut pull) {
                for k in 0..2 {
                    let part = e[k].to_array();
                    *pull += (0..3).map(|i| self.aim.weights[k] * column[3 * k + i] * part[i]).sum::<f64>();
                }
            }
        }
        let largest = pull.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let side = |&(i, v, lower, upper): &(usize, usize, f64, f64)| match pull[v] {
            g if g.abs() < PULL * largest => None,
            g if g < 0.0 && q[i] <= lower => Some(Held::Lower(v)),
            g if g > 0.0 && q[i] >= upper => Some(Held::Upper(v)),
            _ => None,
        };
        self.aim.limits.iter().filter_map(side).collect()
    }
}

/// Ratio of a joint's pull to the largest pull, below which its limit does not count as holding the posture back.
const PULL: f64 = 1e-3;

impl GlobalIk {
    /// Returns the best of the finished starts: by the rank of the settings if a start succeeded. Otherwise the start
    /// with the least error is the best, among those whose pairs are far enough apart if there are any.
    pub(crate) fn best<'t>(&self, trials: &[&'t Trial], posture: &[f64]) -> &'t Trial {
        let mut tangent = vec![0.0; self.model.nv()];
        let mut cost = |t: &Trial| match self.settings.rank {
            _ if !t.succeeded() => self.weighted(t.error),
            Rank::First => 0.0,
            Rank::Nearest => distance(&self.model, posture, &t.q, &mut tangent),
            Rank::Manipulability => -self.manipulability(&t.q),
        };
        let class = |t: &Trial| (t.succeeded(), t.collision.is_none());
        let first = trials.iter().map(|t| class(t)).max();
        let mut best: Option<(f64, &Trial)> = None;
        for &trial in trials.iter().filter(|t| Some(class(t)) == first) {
            let cost = cost(trial);
            if best.is_none_or(|(least, _)| cost < least) {
                best = Some((cost, trial));
            }
        }
        best.expect("at least one start").1
    }

    /// Returns the square of an error with the weights of the settings.
    pub(crate) fn weighted(&self, [linear, angular]: [f64; 2]) -> f64 {
        self.aim.weights[0] * linear * linear + self.aim.weights[1] * angular * angular
    }

    /// Returns √det(J Jᵀ) of the first frame at q.
    fn manipulability(&self, q: &[f64]) -> f64 {
        let mut J = nalgebra::DMatrix::zeros(6, self.model.nv());
        condyle_dynamics::frame_jacobian(&self.model, q, self.aim.frames[0], ReferenceFrame::Local, &mut J);
        (&J * J.transpose()).determinant().max(0.0).sqrt()
    }

    /// Returns the tolerance of rotations; infinite if they have no weight.
    pub(crate) fn rotation_tolerance(&self) -> f64 {
        if self.settings.orientation_weight > 0.0 { self.settings.tolerance[1] } else { f64::INFINITY }
    }
}
