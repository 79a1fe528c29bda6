//! Gaits: which feet are in the air, and when.

use crate::{Error, Foot};
use condyle_dynamics::Vec3;

/// Gait of a walking robot: the swings of the feet, which repeat after a period.
///
/// ```
/// use condyle_mpc::{Gait, Pattern};
/// let trot = Gait::in_turn(Pattern::Trot, 0.24, 0.04); // two diagonal pairs swing in turn
/// let own = Gait::Table { period: 1.0, swings: vec![("left".into(), 0.1, 0.4), ("right".into(), 0.6, 0.9)] };
/// assert_ne!(trot, own);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Gait {
    /// All feet stay on the ground.
    Stand,
    /// Groups of feet swing in turn. All feet are on the ground between two swings.
    InTurn {
        /// Groups of feet that swing together.
        pattern: Pattern,
        /// Duration of a swing (s).
        swing: f64,
        /// Time between two swings (s).
        double: f64,
    },
    /// Table of swings.
    Table {
        /// Time after which the swings repeat (s).
        period: f64,
        /// Swings: the frame of the foot, the beginning and the end of the swing (s), both within the period.
        swings: Vec<(String, f64, f64)>,
    },
}

/// Groups of feet that swing together, in the sequence of their swings. The positions of the feet in the stand tell
/// which feet are in front and which are on the left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Pattern {
    /// Diagonal pairs of four feet.
    Trot,
    /// Pairs of four feet on one side.
    Pace,
    /// Front and rear pairs of four feet.
    Bound,
    /// Single feet of four: rear left, front left, rear right, front right.
    Walk,
    /// Single feet from left to right. A biped steps so.
    Step,
}

/// Swings of one period, with feet as indices.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cycle {
    /// Time after which the swings repeat (s); infinite for a stand.
    pub period: f64,
    /// Swings: foot, beginning and end (s).
    pub swings: Vec<(usize, f64, f64)>,
}

impl Gait {
    /// Returns the gait in which the groups of a pattern swing in turn, each for `swing` seconds. Between two swings,
    /// all feet are on the ground for `double` seconds.
    pub fn in_turn(pattern: Pattern, swing: f64, double: f64) -> Self {
        Self::InTurn { pattern, swing, double }
    }

    /// Returns the cycle of the gait for the given feet, whose positions in the stand are `places`.
    pub(crate) fn cycle(&self, feet: &[Foot], places: &[Vec3<f64>]) -> Result<Cycle, Error> {
        let cycle = match self {
            Self::Stand => return Ok(Cycle { period: f64::INFINITY, swings: Vec::new() }),
            Self::InTurn { pattern, swing, double } => {
                check_duration("the swing's duration", *swing, *swing > 0.0)?;
                check_duration("the time between two swings", *double, *double >= 0.0)?;
                let groups = pattern.groups(places)?;
                let period = groups.len() as f64 * (swing + double);
                let begin = |k: usize| k as f64 * (swing + double) + 0.5 * double;
                let swings = groups.iter().enumerate();
                let swings =
                    swings.flat_map(|(k, group)| group.iter().map(move |&foot| (foot, begin(k), begin(k) + swing)));
                Cycle { period, swings: swings.collect() }
            }
            Self::Table { period, swings } => {
                check_duration("the period", *period, *period > 0.0)?;
                let find = |name: &String| {
                    let known = || feet.iter().map(|foot| format!("`{}`", foot.frame)).collect::<Vec<_>>().join(", ");
                    let what = || format!("`{name}` is not a foot; the feet are {}", known());
                    feet.iter().position(|foot| foot.frame == *name).ok_or_else(|| Error::Gait { what: what() })
                };
                let swings = swings.iter().map(|(name, start, end)| Ok((find(name)?, *start, *end)));
                Cycle { period: *period, swings: swings.collect::<Result<_, Error>>()? }
            }
        };
        cycle.check(feet)?;
        Ok(cycle)
    }
}

/// Shortest duration of a swing (s). Shorter ones are no motion of a leg, and would switch contacts many times a knot.
const SHORTEST_SWING: f64 = 0.01;

fn check_duration(name: &str, seconds: f64, is_valid: bool) -> Result<(), Error> {
    match is_valid && seconds.is_finite() {
        true => Ok(()),
        false => Err(Error::Gait { what: format!("{name} is {seconds} s") }),
    }
}

impl Pattern {
    /// Returns the groups of feet. `places` are the positions of the feet relative to the trunk.
    fn groups(self, places: &[Vec3<f64>]) -> Result<Vec<Vec<usize>>, Error> {
        if self == Self::Step {
            let mut feet: Vec<usize> = (0..places.len()).collect();
            feet.sort_by(|&a, &b| places[b].y.total_cmp(&places[a].y));
            return Ok(feet.into_iter().map(|foot| vec![foot]).collect());
        }
        let count = places.len() as f64;
        let middle = places.iter().fold(Vec3::zero(), |sum, place| sum + *place).scale(1.0 / count);
        let corner = |front: bool, left: bool| {
            let mut feet =
                (0..places.len()).filter(|&k| (places[k].x > middle.x) == front && (places[k].y > middle.y) == left);
            feet.next().filter(|_| places.len() == 4 && feet.next().is_none())
        };
        let corners = [(true, true), (true, false), (false, true), (false, false)].map(|(f, l)| corner(f, l));
        let [Some(fl), Some(fr), Some(rl), Some(rr)] = corners else {
            let what = format!("{self:?} needs four feet, one at each corner; there are {}", places.len());
            return Err(Error::Gait { what });
        };
        Ok(match self {
            Self::Trot => vec![vec![fl, rr], vec![fr, rl]],
            Self::Pace => vec![vec![fl, rl], vec![fr, rr]],
            Self::Bound => vec![vec![fl, fr], vec![rl, rr]],
            Self::Walk | Self::Step => vec![vec![rl], vec![fl], vec![rr], vec![fr]],
        })
    }
}

impl Cycle {
    /// Checks that each swing lies within the period, that swings of one foot do not overlap, and that at least one
    /// foot is on the ground at each time.
    fn check(&self, feet: &[Foot]) -> Result<(), Error> {
        let wrong = |what: String| Err(Error::Gait { what });
        for (k, &(foot, start, end)) in self.swings.iter().enumerate() {
            let name = &feet[foot].frame;
            if !(0.0 <= start && start < end && end <= self.period) {
                return wrong(format!("`{name}` swings from {start} to {end} s; the period has {} s", self.period));
            }
            if end - start < SHORTEST_SWING {
                let what = format!("`{name}` swings for {} s; expected at least {SHORTEST_SWING} s", end - start);
                return wrong(what);
            }
            let overlaps = |other: &&(usize, f64, f64)| other.0 == foot && other.1 < end && start < other.2;
            if let Some((_, from, to)) = self.swings[..k].iter().find(overlaps) {
                return wrong(format!("`{name}` swings from {start} to {end} s, and also from {from} to {to} s"));
            }
        }
        for &(_, start, _) in &self.swings {
            let is_up = |foot: usize| self.swings.iter().any(|s| s.0 == foot && s.1 <= start && start < s.2);
            if (0..feet.len()).all(is_up) {
                return wrong(format!("at {start} s no foot is on the ground, so nothing supports the robot"));
            }
        }
        Ok(())
    }
}
