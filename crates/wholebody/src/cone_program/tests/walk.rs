//! Programs with the size and structure of a whole-body controller's programs. They change slowly from tick to tick.

use super::random::Draw;
use crate::cone_program::{ConeProgram, Size};
use nalgebra::DMatrix;

/// Coefficient of friction.
const FRICTION: f64 = 0.6;
/// Seconds from one tick to the next.
const TICK: f64 = 0.002;

/// Sequence of programs that resemble the programs of a robot: x = (accelerations, forces at points).
#[derive(Clone)]
pub(super) struct Walk {
    accelerations: usize,
    points: usize,
    tasks: DMatrix<f64>,
    weights: Vec<f64>,
    /// Amplitude, frequency and phase of the motion of each task's target. The field `offsets` holds the same for the
    /// offset of each limit.
    motion: Vec<[f64; 3]>,
    offsets: Vec<[f64; 3]>,
    references: Vec<[f64; 3]>,
    rows: DMatrix<f64>,
    limits: Vec<f64>,
    /// Amplitude of the change of each coefficient of the rows.
    drift: DMatrix<f64>,
    load: f64,
    /// Size of random changes of the references, relative to the references: at each tick, and at every fiftieth tick.
    noise: [f64; 2],
}

impl Walk {
    /// Creates a sequence of programs like a humanoid's, with 44 unknowns. Rows limit 32 efforts and 64 accelerations,
    /// and 8 contact points have a friction cone.
    pub(super) fn humanoid(seed: u64) -> Self {
        Self::new(seed, 20, 8, [32, 64], 30)
    }

    /// Creates a sequence of programs like a quadruped's, with 18 unknowns. Rows limit 12 efforts and 12 accelerations,
    /// and 4 contact points have a friction cone.
    pub(super) fn quadruped(seed: u64) -> Self {
        Self::new(seed, 6, 4, [12, 12], 10)
    }

    fn new(seed: u64, accelerations: usize, points: usize, [efforts, others]: [usize; 2], tasks: usize) -> Self {
        let mut draw = Draw::new(seed);
        let (n, m) = (accelerations + 3 * points, efforts + others);
        let mut wave = |amplitude: f64| [amplitude * draw.number(), 20.0 * draw.share(), 6.0 * draw.share()];
        let motion = (0..tasks + 1).map(|_| wave(8.0)).collect();
        let offsets = (0..m).map(|i| wave(if i < efforts { 10.0 } else { 5.0 })).collect();
        let references = (0..n).map(|_| wave(1.0)).collect();
        let rows = DMatrix::from_fn(m, n, |i, j| match (i < efforts, j < accelerations) {
            (true, true) => draw.number(),
            (true, false) => 0.3 * draw.number(),
            (false, true) => 0.5 * draw.number(),
            (false, false) => 0.0,
        });
        let drift = DMatrix::from_fn(m, n, |i, j| 0.1 * rows[(i, j)] * draw.number());
        Self {
            accelerations,
            points,
            tasks: DMatrix::from_fn(tasks, n, |_, j| if j < accelerations { draw.number() } else { 0.0 }),
            weights: (0..tasks).map(|_| 10.0_f64.powf(2.0 * draw.share())).collect(),
            motion,
            offsets,
            references,
            rows,
            limits: (0..m)
                .map(|i| if i < efforts { 30.0 + 40.0 * draw.share() } else { 8.0 + 40.0 * draw.share() })
                .collect(),
            drift,
            load: 10.0 * n as f64,
            noise: [0.0; 2],
        }
    }

    /// Returns the same sequence of programs with disturbed references.
    pub(super) fn disturbed(self, noise: [f64; 2]) -> Self {
        Self { noise, ..self }
    }

    pub(super) fn program(&self) -> ConeProgram {
        let (n, m) = (self.accelerations + 3 * self.points, self.rows.nrows());
        let capacity = Size { unknowns: n, equalities: 0, rows: m, cone_rows: 3 * self.points };
        let mut program = ConeProgram::new(capacity);
        program.cones.resize(self.points, 3);
        program.size.cone_rows = 3 * self.points;
        program
    }

    /// Writes the program of a tick into `program`.
    pub(super) fn write(&self, tick: usize, program: &mut ConeProgram) {
        let (n, na, t) = (program.size.unknowns, self.accelerations, TICK * tick as f64);
        let wave = |[amplitude, frequency, phase]: [f64; 3]| amplitude * (frequency * t + phase).sin();
        let (mut draw, mut push) = (Draw::new(tick as u64), Draw::new(tick as u64 / 50));
        let mut noise = || 8.0 * (self.noise[0] * draw.number() + self.noise[1] * push.number());
        program.P.fill(0.0);
        program.c.fill(0.0);
        for j in 0..n {
            // The cost attracts each force to a reference force, which may lie outside of the force's friction cone.
            program.P[(j, j)] = 1e-3;
            if j >= na {
                let reference = if (j - na) % 3 == 2 {
                    30.0 + 40.0 * wave(self.references[j])
                } else {
                    40.0 * wave(self.references[j])
                };
                program.c[j] = -1e-3 * reference;
            }
        }
        for k in 0..self.weights.len() {
            let (w, target) = (self.weights[k], wave(self.motion[k]) + noise());
            for j in 0..na {
                program.c[j] -= w * self.tasks[(k, j)] * target;
                for i in j..na {
                    program.P[(i, j)] += w * self.tasks[(k, i)] * self.tasks[(k, j)];
                }
            }
        }
        // The sum of the forces should carry and accelerate the load. The cost of each axis has the weight 1, in units
        // of the load.
        for axis in 0..3 {
            let of = |j: usize| {
                if j < na {
                    if j == axis { -0.5 } else { 0.0 }
                } else if (j - na) % 3 == axis {
                    0.1
                } else {
                    0.0
                }
            };
            let target =
                0.1 * if axis == 2 { self.load } else { 0.2 * self.load * wave([1.0, 3.0 + axis as f64, 1.0]) };
            for j in 0..n {
                program.c[j] -= 10.0 * of(j) * target;
                for i in j..n {
                    program.P[(i, j)] += 10.0 * of(i) * of(j);
                }
            }
        }
        for i in 0..self.limits.len() {
            for j in 0..n {
                program.Gt[(j, i)] = self.rows[(i, j)] + self.drift[(i, j)] * (3.0 * t).sin();
            }
            let offset = wave(self.offsets[i]);
            program.lower[i] = offset - self.limits[i];
            program.upper[i] = offset + self.limits[i];
        }
        program.Ft.fill(0.0);
        for k in 0..self.points {
            let at = na + 3 * k;
            program.Ft[(at + 2, 3 * k)] = FRICTION;
            program.Ft[(at, 3 * k + 1)] = 1.0;
            program.Ft[(at + 1, 3 * k + 2)] = 1.0;
        }
    }
}
