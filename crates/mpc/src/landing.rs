//! Landings at other times than planned: contacts that a measurement reports early or late.

use crate::references::Walk;
use crate::schedule::FootSchedule;

/// Fraction of a swing after which a touch is a landing. Before, the foot may still leave the ground.
const LANDS: f64 = 0.5;
/// Speed at which the foothold of a late foot is lowered (m/s): the largest speed of a usual swing.
const LOWERING: f64 = 0.8;
/// Largest depth by which a foothold is lowered (m).
const DEEPEST: f64 = 0.06;

/// Smallest number of other feet that support the robot while a late foot swings on. A biped that waited for a late
/// foot on the other one fell in each of four walks over a step of 2 cm down.
const SUPPORT: u32 = 2;

/// Changes the swings at the time `now`. The feet of the mask `touching` touch the ground, and the feet of the mask
/// `stood` stood at the last tick.
///
/// A foot that touches after half of its swing has landed: its swing ends now. A late foot should have landed, but has
/// not touched the ground since. It swings for `knot` seconds more, and its foothold is lowered by the distance for the
/// `elapsed` seconds since the last tick. So it goes on until the foot touches or has been lowered by [`DEEPEST`], or
/// until the remaining feet are fewer than [`SUPPORT`] or no stance of the gait (`is_stance`). Then the foot counts as
/// standing. Returns whether a swing was changed.
pub(crate) fn change_swings(
    walk: &mut Walk,
    schedule: &mut FootSchedule,
    [touching, stood]: [u32; 2],
    [now, elapsed, knot]: [f64; 3],
    is_stance: impl Fn(u32) -> bool,
) -> bool {
    let mut changed = false;
    for foot in 0..walk.feet.len() {
        let (bit, stance) = (1 << foot, schedule.stance(now));
        let touches = touching & bit != 0;
        if let Some(swing) = schedule.swing_at(foot, now) {
            if touches && swing.fraction(now) >= LANDS {
                changed |= schedule.end_swing(foot, now, now);
            }
        } else if !touches && stood & bit == 0 && walk.lowered[foot] < DEEPEST {
            // it was in the air at the last tick, and should stand now
            let end = now + knot;
            let others = [stance & !bit, schedule.stance(end) & !bit];
            let is_supported = others.iter().all(|&others| others.count_ones() >= SUPPORT && is_stance(others));
            if is_supported && schedule.end_swing(foot, now, end) {
                walk.lowered[foot] = (walk.lowered[foot] + LOWERING * elapsed).min(DEEPEST);
                changed = true;
            }
        }
    }
    changed
}
