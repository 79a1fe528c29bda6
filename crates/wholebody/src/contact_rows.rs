//! Quantities of a contact at one state: its Jacobian, the required acceleration, and the rows and cones that limit its
//! force.

use crate::cone_program::{ConeProgram, Size};
use crate::contact::{FrictionContact, Geometry, Normal, norm};
use crate::kinematics::FrameMotion;
use crate::references::ContactTarget;
use crate::settings::{Friction, Settings};
use crate::warm_start::Places;
use condyle_dynamics::{Force, Mat3, Motion, Quaternion, Vec3, lie};
use nalgebra::DMatrix;

/// Contact and its quantities at the current state. The rows of its Jacobian refer to the contact's centre and the
/// contact's axes: t₁ and t₂ are tangential, n is normal.
pub(crate) struct ContactRows {
    pub description: FrictionContact,
    pub geometry: Geometry,
    /// Index of the contact's frame among the frames of the kinematics.
    pub frame: usize,
    /// Whether the contact touches.
    pub active: bool,
    /// Index in x of the force's first unknown, if the contact is active.
    pub column: usize,
    /// Activation α of the contact, at most 1.
    activation: f64,
    /// Offsets of the contact's unknowns and constraints in a program in which all contacts touch.
    first: Size,
    /// Axes, in the world.
    axes: Mat3<f64>,
    /// Vector from the frame's origin to the contact's centre, along the world's axes.
    arm: Vec3<f64>,
    /// Transpose Jᵀ of the contact's Jacobian: nv × number of held rows.
    pub Jt: DMatrix<f64>,
    /// Required value of J q̈, which is a* − J̇ v.
    pub held: [f64; 6],
    /// Reference value of each unknown of the force.
    pub reference: Vec<f64>,
    /// Weight of each unknown of the force, relative to the force weight of the settings.
    pub weights: Vec<f64>,
    /// Reference value of the wrench.
    pub wrench: [f64; 6],
    /// Minimum and maximum normal force.
    bounds: [f64; 2],
}

impl ContactRows {
    pub(crate) fn new(description: &FrictionContact, geometry: Geometry, frame: usize, nv: usize) -> Self {
        Self {
            description: description.clone(),
            frame,
            active: false,
            column: 0,
            activation: 0.0,
            first: Size::default(),
            axes: Mat3::identity(),
            arm: Vec3::zero(),
            Jt: DMatrix::zeros(nv, geometry.motion.len()),
            held: [0.0; 6],
            reference: vec![0.0; geometry.unknowns()],
            weights: (0..geometry.unknowns()).map(|j| geometry.weight(j)).collect(),
            wrench: [0.0; 6],
            bounds: [0.0, f64::INFINITY],
            geometry,
        }
    }

    /// Adds this contact to `all`, the size of a program in which all contacts touch. The contact's unknowns and
    /// constraints get the indices from the old to the new size.
    pub(crate) fn add_to(&mut self, all: &mut Size, friction: Friction) {
        self.first = *all;
        all.unknowns += self.geometry.unknowns();
        all.equalities += self.geometry.motion.len();
        all.rows += self.max_rows(friction);
        all.cone_rows += if friction == Friction::Cone { 3 * self.geometry.cones() } else { 0 };
    }

    /// Appends the indices of this contact's unknowns and constraints to `places`, in the order of the program. Also
    /// appends the scale of each unknown.
    pub(crate) fn add_places(&self, places: &mut Places, friction: Friction) {
        let Size { unknowns, equalities, rows, cone_rows } = self.first;
        let end = rows + self.max_rows(friction);
        places.unknowns.extend(unknowns..unknowns + self.geometry.unknowns());
        places.units.extend((0..self.geometry.unknowns()).map(|_| self.activation));
        places.equalities.extend(equalities..equalities + self.geometry.motion.len());
        places.rows.extend(if self.has_bounds() { rows..end } else { rows + 1..end });
        if friction == Friction::Cone {
            places.cone_rows.extend(cone_rows..cone_rows + 3 * self.geometry.cones());
        }
    }

    /// Returns whether the contact's first row, which bounds the normal force, is in use.
    fn has_bounds(&self) -> bool {
        let [least, most] = self.bounds;
        least > 0.0 || most < f64::INFINITY
    }

    /// Returns the maximum number of rows of G that the contact's force needs.
    fn max_rows(&self, friction: Friction) -> usize {
        let edges = self.geometry.edges().count();
        let sides = if let Friction::Pyramid { sides, .. } = friction { sides } else { 0 };
        1 + edges + 2 * usize::from(edges > 0) + sides * self.geometry.cones()
    }

    /// Returns the vector from the frame's origin to the contact's centre, in the world.
    pub(crate) fn centre_arm(&self, frame: &FrameMotion) -> Vec3<f64> {
        frame.pose.rotation * self.geometry.centre
    }

    /// Computes all quantities of an active contact from the motion `frame` of its frame.
    pub(crate) fn update(&mut self, frame: &FrameMotion, target: &ContactTarget, settings: &Settings, weight: f64) {
        let R = frame.pose.rotation;
        let (centre, axes, motion) = (self.geometry.centre, self.geometry.axes, self.geometry.motion);
        self.arm = R * centre;
        self.axes = match self.description.normal {
            Normal::World(_) => axes,
            Normal::Frame(_) => R * axes,
        };
        let [t1, t2, n] = self.axes.columns();
        for &j in &frame.support {
            let s = &frame.J.as_slice()[6 * j..6 * j + 6];
            let (linear, angular) = (Vec3::new(s[0], s[1], s[2]), Vec3::new(s[3], s[4], s[5]));
            let at = linear + angular.cross(self.arm); // velocity of the contact's centre
            let along = [t1.dot(at), t2.dot(at), n.dot(at), t1.dot(angular), t2.dot(angular), n.dot(angular)];
            for (r, &row) in motion.iter().enumerate() {
                self.Jt[(j, r)] = along[row];
            }
        }
        // required acceleration a* = k (X_ref ⊖ X) − d v of the contact's centre, with its pose X, its velocity v and
        // the gains k and d, limited to the maximum correction
        let gains = settings.contact_gains;
        let (v, w) = (frame.velocity.linear, frame.velocity.angular);
        let turn: Mat3<f64> = target.pose.rotation * R.transpose();
        let error = Motion::new(
            target.pose.translation + target.pose.rotation * centre - (frame.pose.translation + self.arm),
            lie::log3(Quaternion::from_rotation(turn)),
        );
        let error = if self.geometry.corners.is_empty() {
            Motion::new(target.pose.translation - frame.pose.translation, Vec3::zero())
        } else {
            error
        };
        let wanted = |error: Vec3<f64>, velocity: Vec3<f64>| {
            let a = error.scale(gains.stiffness) - velocity.scale(gains.damping);
            a.scale((settings.max_correction / norm(a)).min(1.0)) // the factor is 1 for a = 0, since NaN.min(1) is 1
        };
        let drift = frame.drift.linear + frame.drift.angular.cross(self.arm) + w.cross(w.cross(self.arm));
        let linear = wanted(error.linear, v + w.cross(self.arm)) - drift;
        let angular = wanted(error.angular, w) - frame.drift.angular;
        let along = self.along(linear, angular);
        for (held, &row) in self.held.iter_mut().zip(motion) {
            *held = along[row];
        }
        // Compute the reference forces. The target's wrench is about the frame's origin, and `self.wrench` is about the
        // contact's centre.
        let Force { linear, angular } = target.force;
        self.wrench = self.along(linear, angular - self.arm.cross(linear));
        let (wrench, share) = (self.wrench, 1.0 / self.geometry.cones() as f64);
        for (j, reference) in self.reference.iter_mut().enumerate() {
            *reference = if self.geometry.by_corners { share * wrench[j % 3] } else { wrench[motion[j]] };
        }
        let FrictionContact { min_force, max_force, .. } = self.description;
        self.bounds = [min_force, max_force];
        self.activation = target.activation.min(1.0);
        if target.activation < 1.0 {
            // The normal force f_n is at most the activation α times the maximum force. The robot's weight replaces an
            // infinite maximum force.
            let most = if max_force.is_finite() { max_force } else { weight };
            self.bounds = [min_force, most].map(|bound| bound * target.activation);
        }
    }

    fn along(&self, linear: Vec3<f64>, angular: Vec3<f64>) -> [f64; 6] {
        let (a, b) = (self.axes.transpose_mul(linear), self.axes.transpose_mul(angular));
        [a.x, a.y, a.z, b.x, b.y, b.z]
    }

    /// Writes −Jᵀ, the coefficients of the contact's force, into the columns of Eᵀ. J is the contact's Jacobian, and
    /// the efforts of the coordinates are τ = E x + h.
    pub(crate) fn add_effort(&self, support: &[usize], Et: &mut DMatrix<f64>) {
        let (rows, stride, nv) = (self.geometry.motion, Et.nrows(), self.Jt.nrows());
        let (J, Et) = (self.Jt.as_slice(), Et.as_mut_slice());
        for &i in support {
            let effort = &mut Et[i * stride + self.column..][..self.geometry.unknowns()];
            for (j, effort) in effort.iter_mut().enumerate() {
                *effort = if self.geometry.by_corners {
                    let share = |(r, &row): (usize, &usize)| J[r * nv + i] * self.geometry.wrench(row, j);
                    -rows.iter().enumerate().map(share).sum::<f64>()
                } else {
                    -J[j * nv + i]
                };
            }
        }
    }

    /// Adds the equalities J q̈ = a* − J̇ v, with the Jacobian J of the contact and its required acceleration a*.
    pub(crate) fn add_equalities(&self, program: &mut ConeProgram) {
        let (n, nv) = (program.size.unknowns, self.Jt.nrows());
        for (r, J) in self.Jt.as_slice().chunks_exact(nv).enumerate() {
            let e = program.size.equalities;
            let (motion, forces) = program.equality_mut(e)[..n].split_at_mut(nv);
            motion.copy_from_slice(J);
            forces.fill(0.0);
            program.b[e] = self.held[r];
            program.size.equalities += 1;
        }
    }

    /// Adds the rows and cones that limit the force: bounds, friction cones or pyramids, bounds of the centre of
    /// pressure, and bounds of the yaw moment.
    pub(crate) fn add_force_rows(&self, program: &mut ConeProgram, friction: Friction) {
        let Geometry { by_corners, yaw, motion, .. } = self.geometry;
        let mu = self.description.friction;
        let cones = self.geometry.cones();
        if self.has_bounds() {
            let [least, most] = self.bounds;
            let lower = if least > 0.0 { least } else { f64::NEG_INFINITY }; // the cones imply f_n ≥ 0
            let row = add_row(program, lower, most);
            for k in 0..cones {
                program.Gt[(self.column + 3 * k + 2, row)] = 1.0;
            }
        }
        if !by_corners && motion.len() > 3 {
            let (f_n, moments) = (self.column + 2, self.column + motion.len() - 2);
            for [a, b, c] in self.geometry.edges() {
                // With the normal force f_n and the moments τ₁ and τ₂ about the tangential axes, the centre of pressure
                // p satisfies f_n p = (−τ₂, τ₁). So the half-plane a x + b y + c ≥ 0 becomes −a τ₂ + b τ₁ + c f_n ≥ 0.
                let row = add_row(program, 0.0, f64::INFINITY);
                program.Gt[(moments, row)] = -a;
                if b != 0.0 {
                    program.Gt[(moments - 1, row)] = b;
                }
                program.Gt[(f_n, row)] = c;
            }
            for sign in [1.0, -1.0] {
                let row = add_row(program, 0.0, f64::INFINITY); // γ f_n ± τ_n ≥ 0
                program.Gt[(f_n, row)] = yaw;
                program.Gt[(moments + 1, row)] = sign;
            }
        }
        for k in 0..cones {
            let f = self.column + 3 * k;
            match friction {
                Friction::Cone => {
                    let first = program.size.cone_rows;
                    program.size.cone_rows += 3;
                    program.cones.push(3);
                    let n = program.size.unknowns;
                    for (i, (column, x)) in [(f + 2, mu), (f, 1.0), (f + 1, 1.0)].into_iter().enumerate() {
                        program.cone_row_mut(first + i)[..n].fill(0.0);
                        program.Ft[(column, first + i)] = x; // s = (μ f_n, f₁, f₂)
                        program.h[first + i] = 0.0;
                    }
                }
                Friction::Pyramid { sides, inscribed } => {
                    let step = core::f64::consts::TAU / sides as f64;
                    let slope = if inscribed { mu * (0.5 * step).cos() } else { mu };
                    for side in 0..sides {
                        let (sin, cos) = (step * side as f64).sin_cos();
                        let row = add_row(program, 0.0, f64::INFINITY); // μ f_n − dᵀ f_t ≥ 0
                        program.Gt[(f + 2, row)] = slope;
                        program.Gt[(f, row)] = -cos;
                        program.Gt[(f + 1, row)] = -sin;
                    }
                }
            }
        }
    }

    /// Returns the wrench of this contact's force in x, about the frame's origin, along the world's axes.
    pub(crate) fn read(&self, x: &[f64]) -> Force<f64> {
        if !self.active {
            return Force::zero();
        }
        let f = &x[self.column..self.column + self.geometry.unknowns()];
        let row = |r: usize| f.iter().enumerate().map(|(j, f)| self.geometry.wrench(r, j) * f).sum::<f64>();
        let linear = self.axes * Vec3::new(row(0), row(1), row(2));
        Force::new(linear, self.axes * Vec3::new(row(3), row(4), row(5)) + self.arm.cross(linear))
    }
}

/// Adds a row of zeros with these bounds to the matrix G of a program, and returns the row's index.
fn add_row(program: &mut ConeProgram, lower: f64, upper: f64) -> usize {
    let (row, n) = (program.size.rows, program.size.unknowns);
    program.row_mut(row)[..n].fill(0.0);
    (program.lower[row], program.upper[row]) = (lower, upper);
    program.size.rows += 1;
    row
}
