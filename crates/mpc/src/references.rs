//! References of a walk: the path of the trunk, footholds, and the paths of swinging feet.

use crate::command::Command;
use crate::schedule::FootSchedule;
use crate::{Foot, Settings, Terrain};
use condyle_dynamics::Vec3;
use core::f64::consts::{PI, TAU};

/// Largest distance of the reference from the measured place of the trunk (m). After a push, the robot need not return
/// farther than this.
const LEASH: f64 = 0.05;
/// Largest angle between the reference and the measured heading (rad).
const TURN_LEASH: f64 = 0.2;
/// Longest time for which a foothold is placed ahead of the hip (s).
const LONGEST_STANCE: f64 = 0.6;
/// Smallest distance of a foothold to the side of the trunk, relative to the stand. Feet of both sides then never meet.
const NARROWEST: f64 = 0.75;

/// Pose of the trunk in the plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct PlanarPose {
    /// Position (m).
    pub x: f64,
    /// Position (m).
    pub y: f64,
    /// Heading ψ (rad).
    pub heading: f64,
}

impl PlanarPose {
    /// Returns the pose of a state, whose first seven numbers are the pose of the trunk.
    pub(crate) fn of(state: &[f64]) -> Self {
        let [qx, qy, qz, qw] = [state[3], state[4], state[5], state[6]];
        let heading = (2.0 * (qw * qz + qx * qy)).atan2(1.0 - 2.0 * (qy * qy + qz * qz));
        Self { x: state[0], y: state[1], heading }
    }

    /// Returns a vector along the axes of the world, given along the heading.
    pub(crate) fn turned(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = self.heading.sin_cos();
        [cos * x - sin * y, sin * x + cos * y]
    }

    /// Returns the pose after `s` seconds at a constant command: an arc.
    pub(crate) fn after(&self, s: f64, command: Command) -> Self {
        let middle = Self { heading: self.heading + 0.5 * command.wz * s, ..*self };
        let [x, y] = middle.turned([command.vx * s, command.vy * s]);
        Self { x: self.x + x, y: self.y + y, heading: self.heading + command.wz * s }
    }
}

/// Stand of the robot, from which references are derived.
#[derive(Clone, Debug)]
pub(crate) struct Stand {
    /// State (q, v) in the stand, with v = 0.
    pub x: Vec<f64>,
    /// Positions of the feet relative to the trunk, along its heading (m).
    pub feet: Vec<Vec3<f64>>,
    /// Height of the trunk above the ground (m).
    pub height: f64,
}

/// Walk of the robot: what it should do, and what its feet have done.
#[derive(Clone, Debug)]
pub(crate) struct Walk {
    pub stand: Stand,
    pub feet: Vec<Foot>,
    pub settings: Settings,
    /// Commanded velocity now.
    pub command: Command,
    /// Commanded velocity after acceleration.
    pub goal: Command,
    /// Height of the trunk above its height in the stand (m).
    pub raised: f64,
    /// Reference of the trunk's pose now.
    pub pose: PlanarPose,
    /// Plane of the ground, if it is given.
    pub given_terrain: Option<Terrain>,
    /// Plane of the ground: the given one, or the plane of the footholds.
    pub terrain: Terrain,
    /// Positions at which the feet last stood, and at which they left the ground (m).
    pub placed: Vec<Vec3<f64>>,
    pub lifted: Vec<Vec3<f64>>,
    /// Feet on the ground at the last observation, one bit for each foot.
    pub stance: u32,
    /// Depth by which the foothold of each foot was lowered since it should have landed (m).
    pub lowered: Vec<f64>,
}

impl Walk {
    /// Creates the walk of a robot with these feet, which stands in the state x.
    pub(crate) fn new(x: &[f64], feet: &[Foot], settings: Settings) -> Self {
        let zeros = vec![Vec3::zero(); feet.len()];
        Self {
            stand: Stand { x: x.to_vec(), feet: zeros.clone(), height: 0.0 },
            feet: feet.to_vec(),
            settings,
            command: Command::default(),
            goal: Command::default(),
            raised: 0.0,
            pose: PlanarPose::default(),
            given_terrain: None,
            terrain: Terrain { height: 0.0, slope: [0.0; 2] },
            placed: zeros.clone(),
            lifted: zeros,
            stance: 0,
            lowered: vec![0.0; feet.len()],
        }
    }

    /// Begins with a robot that stands in the state x = (q, v), with nq positions. `places` are the positions of its
    /// feet.
    pub(crate) fn begin(&mut self, x: &[f64], nq: usize, places: &[Vec3<f64>]) {
        let pose = PlanarPose::of(x);
        let back = PlanarPose { heading: -pose.heading, ..pose };
        self.stand.x.copy_from_slice(x);
        self.stand.x[nq..].fill(0.0);
        for (foot, place) in self.stand.feet.iter_mut().zip(places) {
            let [dx, dy] = back.turned([place.x - pose.x, place.y - pose.y]);
            *foot = Vec3::new(dx, dy, place.z - x[2]);
        }
        let below: f64 = self.stand.feet.iter().zip(&self.feet).map(|(p, foot)| p.z - foot.height()).sum();
        self.stand.height = -below / places.len() as f64;
        self.placed.copy_from_slice(places);
        self.lifted.copy_from_slice(places);
        self.lowered.fill(0.0);
        (self.command, self.pose, self.raised) = (Command::default(), pose, 0.0);
        self.stance = (1 << places.len()) - 1;
        self.fit_terrain();
    }

    /// Fits the plane of the ground to the footholds, unless it is given.
    fn fit_terrain(&mut self) {
        let below = |(place, foot): (&Vec3<f64>, &Foot)| Vec3 { z: place.z - foot.height(), ..*place };
        let ground = self.placed.iter().zip(&self.feet).map(below);
        self.terrain = self.given_terrain.unwrap_or_else(|| Terrain::fitted(ground));
    }

    /// Records where the feet are, which of them should be on the ground, and the state of the trunk after `elapsed`
    /// seconds.
    pub(crate) fn observe(&mut self, places: &[Vec3<f64>], stance: u32, state: &[f64], elapsed: f64) {
        for (foot, place) in places.iter().enumerate() {
            let bit = 1 << foot;
            if stance & bit != 0 {
                self.placed[foot] = *place;
                self.lowered[foot] = 0.0;
            } else if self.stance & bit != 0 {
                self.lifted[foot] = *place;
            }
        }
        self.stance = stance;
        self.fit_terrain();
        self.command = self.command.towards(self.goal, self.settings.accelerations, elapsed);
        let (aim, now) = (self.pose.after(elapsed, self.command), PlanarPose::of(state));
        let [dx, dy] = [aim.x - now.x, aim.y - now.y];
        let shorten = (LEASH / (dx * dx + dy * dy).sqrt().max(1e-9)).min(1.0);
        let off = (aim.heading - now.heading + PI).rem_euclid(TAU) - PI;
        self.pose = PlanarPose {
            x: now.x + shorten * dx,
            y: now.y + shorten * dy,
            heading: now.heading + off.clamp(-TURN_LEASH, TURN_LEASH),
        };
    }

    /// Writes the reference state `s` seconds after now. Its joints are as in the stand.
    pub(crate) fn write_state(&self, s: f64, nq: usize, state: &mut [f64]) {
        state.copy_from_slice(&self.stand.x);
        let pose = self.pose.after(s, self.command);
        let z = self.terrain.at(pose.x, pose.y) + self.stand.height + self.raised;
        state[..3].copy_from_slice(&[pose.x, pose.y, z]);
        let [pitch, roll] = self.tilts(pose); // R = Rz(ψ) Ry(θ) Rx(φ)
        let [(sz, cz), (sy, cy), (sx, cx)] = [pose.heading, pitch, roll].map(|angle| (0.5 * angle).sin_cos());
        state[3] = sx * cy * cz - cx * sy * sz;
        state[4] = cx * sy * cz + sx * cy * sz;
        state[5] = cx * cy * sz - sx * sy * cz;
        state[6] = cx * cy * cz + sx * sy * sz;
        let Command { vx, vy, wz } = self.command;
        state[nq..nq + 6].copy_from_slice(&[vx, vy, 0.0, 0.0, 0.0, wz]);
    }

    /// Returns the pitch θ and the roll φ with which a body is parallel to the ground (rad).
    fn tilts(&self, pose: PlanarPose) -> [f64; 2] {
        let ([a, b], (sin, cos)) = (self.terrain.slope, pose.heading.sin_cos());
        let pitch = -(cos * a + sin * b).atan();
        [pitch, ((cos * b - sin * a) * pitch.cos()).atan()]
    }

    /// Writes the vertical along the axes of a sole that is parallel to the ground `s` seconds after now: Rᵀ e_z.
    pub(crate) fn write_vertical(&self, s: f64, vertical: &mut [f64]) {
        let [(sy, cy), (sx, cx)] = self.tilts(self.pose.after(s, self.command)).map(f64::sin_cos);
        vertical.copy_from_slice(&[-sy, cy * sx, cy * cx]);
    }

    /// Returns the position of a foot's frame if the foot lands `s` seconds after now and then stands for `stance`
    /// seconds. `state` is the measured state with the velocity `velocity` along the world's axes (m/s).
    fn foothold(&self, foot: usize, s: f64, stance: f64, now: PlanarPose, velocity: [f64; 2]) -> Vec3<f64> {
        let Command { vx, vy, wz } = self.command;
        let (hip, ahead) = (self.stand.feet[foot], 0.5 * stance.min(LONGEST_STANCE));
        let pose = PlanarPose { heading: self.pose.heading, ..now }.after(s, self.command);
        let wanted = pose.turned([vx, vy]);
        let error = [0, 1].map(|k| self.settings.capture * (velocity[k] - wanted[k]));
        let error = PlanarPose { heading: -pose.heading, ..pose }.turned(error);
        let mut local = [hip.x + ahead * (vx - wz * hip.y) + error[0], hip.y + ahead * (vy + wz * hip.x) + error[1]];
        let narrowest = NARROWEST * hip.y.abs();
        local[1] = if hip.y < 0.0 { local[1].min(-narrowest) } else { local[1].max(narrowest) };
        let [x, y] = pose.turned(local);
        let [x, y] = [pose.x + x, pose.y + y];
        Vec3::new(x, y, self.terrain.at(x, y) + self.feet[foot].height())
    }

    /// Writes the targets of a foot at all times of the horizon (N + 1 rows of 3 numbers). Returns whether the foot
    /// swings. Targets at times at which the foot is on the ground are not used.
    pub(crate) fn write_swing(
        &self,
        foot: usize,
        schedule: &FootSchedule,
        times: &[f64],
        state: &[f64],
        velocity: [f64; 2],
        targets: &mut [f64],
    ) -> bool {
        let (now, begin) = (PlanarPose::of(state), times[0]);
        let (mut from, mut swings) = (self.placed[foot], schedule.swings_of(foot).peekable());
        let mut any = false;
        while let Some(swing) = swings.next() {
            if swing.end <= begin {
                continue;
            }
            let stance = swings.peek().map_or(0.0, |next| next.start - swing.end);
            let mut to = self.foothold(foot, swing.end - begin, stance, now, velocity);
            let mut start = from;
            if swing.start <= begin {
                start = self.lifted[foot];
                to.z -= self.lowered[foot];
            }
            for (&t, target) in times.iter().zip(targets.chunks_exact_mut(3)) {
                if swing.start - SOON <= t && t <= swing.end + SOON {
                    let place = between(start, to, swing.fraction(t), self.settings.swing_height);
                    target.copy_from_slice(&place.to_array());
                    any = true;
                }
            }
            from = to;
        }
        any
    }
}

/// Time by which a knot may begin before a swing, by rounding (s).
const SOON: f64 = 1e-6;

/// Returns the position of a swinging foot when a fraction of the swing has elapsed. The horizontal motion begins and
/// ends without velocity.
fn between(from: Vec3<f64>, to: Vec3<f64>, fraction: f64, height: f64) -> Vec3<f64> {
    let along = fraction - (TAU * fraction).sin() / TAU; // a cycloid
    let lift = height * (PI * fraction).sin().powi(2);
    from + (to - from).scale(along) + Vec3::new(0.0, 0.0, lift)
}
