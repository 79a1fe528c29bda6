//! Validation of every model, for all functions that create a model. Invalid numbers are errors. Physically impossible
//! inertias, and degrees of freedom along which the inertia matrix M is singular, are warnings.

use crate::body::{Body, Frame, JointOptions, Limits};
use crate::configuration::random_configuration;
use crate::error::Error;
use crate::joint::Joint;
use crate::layout::{Columns, Layout, Pairs, Single};
use crate::model::Model;
use crate::warning::Warning;
use alloc::borrow::ToOwned;
use alloc::collections::BTreeSet;
use alloc::string::String;
use alloc::vec::Vec;
use condyle_spatial::{Act, ArticulatedInertia, Inertia, Motion, Scalar, Se3, Sym3};
use nalgebra::{DMatrix, Matrix3};
use rand::{SeedableRng, rngs::StdRng};

/// Relative rounding error of the moments of inertia of a body in a file, because files have six digits.
const MOMENT_ROUNDING: f64 = 1e-6;
/// Minimum moment about the centre of mass, relative to the mass times the squared distance of this centre from the
/// origin. Smaller moments are rounding errors.
const COM_ROUNDING: f64 = 1e-12;
/// Minimum pivot, relative to the sum of the products from which the pivot is computed. Smaller pivots are rounding
/// errors and are treated as 0.
const PIVOT_ROUNDING: f64 = 1e-13;
/// Minimum pivot (kg m², kg). The reciprocal of a smaller pivot may overflow.
const LEAST_PIVOT: f64 = 1e-200;
/// Number of random positions at which the inertia matrix is tested. A joint is reported as singular if it is singular
/// at all of these positions.
const SAMPLES: usize = 3;
/// Maximum radius of gyration of a body without a warning (m). The largest ships and cranes have smaller radii. Public
/// robots with larger radii use a wrong unit.
const LARGEST_RADIUS: f64 = 100.0;
/// Minimum radius of gyration without a warning (m), for a body with a rotational inertia. A point mass has no
/// rotational inertia.
const LEAST_RADIUS: f64 = 1e-7;

/// Checks a body's inertia and placement.
pub(crate) fn check_body(Body { name, inertia: I, placement, .. }: &Body) -> Result<(), Error> {
    let wrong = |what: String| Err(Error::Body { body: name.clone(), what });
    if !(I.mass >= 0.0 && I.mass.is_finite()) {
        return wrong(format!("mass is {} kg, expected a finite number of at least 0", I.mass));
    }
    let Sym3 { xx, yy, zz, xy, xz, yz } = I.rotational;
    if ![xx, yy, zz, xy, xz, yz].into_iter().chain(I.mass_com.to_array()).all(f64::is_finite) {
        return wrong("inertia is not finite".to_owned());
    }
    check_placement(placement).or_else(wrong)
}

/// Checks a frame's placement.
pub(crate) fn check_frame(Frame { name, placement, .. }: &Frame) -> Result<(), Error> {
    check_placement(placement).map_err(|what| Error::Frame { frame: name.clone(), what })
}

fn check_placement(X: &Se3<f64>) -> Result<(), String> {
    let numbers = X.rotation.columns().into_iter().chain([X.translation]).flat_map(condyle_spatial::Vec3::to_array);
    if numbers.into_iter().any(|x| !x.is_finite()) {
        return Err("placement is not finite".to_owned());
    }
    if !X.rotation.is_rotation() {
        return Err("placement is no rotation and translation".to_owned());
    }
    Ok(())
}

impl JointOptions {
    /// Checks the numbers of a joint.
    pub(crate) fn check(&self, joint: &str) -> Result<(), Error> {
        let wrong = |what: String| Err(Error::Joint { joint: joint.to_owned(), what });
        for (name, limits) in [("", self.position), (" of effort", self.effort)] {
            let (lower, upper) = limits.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
            if lower.is_nan() || upper.is_nan() {
                let name = if name.is_empty() { " of position" } else { name };
                return wrong(format!("limits{name} {lower} and {upper}: expected numbers"));
            }
            if lower > upper || lower == f64::INFINITY || upper == f64::NEG_INFINITY {
                return wrong(format!("lower limit{name} {lower} is above upper limit {upper}"));
            }
        }
        if let Some(x) = self.velocity.filter(|x| x.is_nan() || *x < 0.0) {
            return wrong(format!("limit of velocity is {x}, expected a number of at least 0"));
        }
        if let Some(x) = self.damping_polynomial.iter().find(|x| !x.is_finite()) {
            return wrong(format!("a coefficient of damping is {x}, expected a finite number"));
        }
        for (name, x) in [("damping", self.damping), ("friction", self.friction), ("armature", self.armature)] {
            if !(x >= 0.0 && x.is_finite()) {
                return wrong(format!("{name} is {x}, expected a finite number of at least 0"));
            }
        }
        Ok(())
    }
}

/// Adds warnings about the inertia of a body. There is no warning about bodies that connect joints of a chain, because
/// they have no mass on purpose.
fn check_inertia(body: &Body, between: bool, warnings: &mut Vec<Warning>) {
    let (I, name) = (body.inertia, || body.name.clone());
    if I == Inertia::zero() {
        if !between {
            warnings.push(Warning::Massless { body: name() });
        }
        return;
    }
    let com = if I.mass > 0.0 { I.mass_com.scale(1.0 / I.mass) } else { I.mass_com };
    let shift = Inertia::from_com(I.mass, com, condyle_spatial::Sym3::zero()).rotational;
    let c = I.rotational - shift;
    let moments = Matrix3::new(c.xx, c.xy, c.xz, c.xy, c.yy, c.yz, c.xz, c.yz, c.zz).symmetric_eigenvalues();
    let mut moments = [moments[0], moments[1], moments[2]];
    moments.sort_by(f64::total_cmp);
    let [.., greatest] = moments;
    let unlikely = |what: String| Warning::Unlikely { body: name(), what };
    if I.mass == 0.0 {
        warnings.push(unlikely(format!("has no mass and a moment of inertia of {greatest:e} kg m²")));
    } else if greatest > 0.0 {
        let radius = Scalar::sqrt(greatest / I.mass);
        let what = format!("{} kg and {greatest:e} kg m² are a radius of gyration of", I.mass);
        if radius > LARGEST_RADIUS {
            warnings.push(unlikely(format!("{what} {radius:.0} m, expected at most {LARGEST_RADIUS} m")));
        } else if radius < LEAST_RADIUS && greatest > COM_ROUNDING * com.norm_squared() * I.mass {
            warnings.push(unlikely(format!("{what} {radius:.1e} m, expected at least {LEAST_RADIUS:e} m")));
        }
    }
    let rounding = MOMENT_ROUNDING * greatest.abs();
    if moments[0] < -rounding {
        warnings.push(Warning::Negative { body: name(), moment: moments[0] });
    } else if moments[2] > moments[0] + moments[1] + rounding {
        warnings.push(Warning::Triangle { body: name(), moments });
    }
}

/// Adds warnings about limits with which a joint with one degree of freedom cannot work. A follower does not have its
/// own limits.
fn check_limits(body: &Body, limits: &Limits, warnings: &mut Vec<Warning>) {
    if body.mimic.is_some() || body.joint.nv() != 1 {
        return;
    }
    let mut warn = |what: String| warnings.push(Warning::Limit { joint: body.joint_name.clone(), what });
    let (q, v) = (body.idx_q, body.idx_v);
    if body.joint.nq() == 1 && limits.lower[q] == limits.upper[q] {
        warn(format!("both limits of position are {}: it cannot move", limits.lower[q]));
    }
    if limits.velocity[v] == 0.0 {
        warn("its limit of velocity is 0: it cannot move".to_owned());
    }
    if limits.effort_lower[v] == limits.effort_upper[v] {
        warn(format!("both limits of effort are {}: it cannot be driven", limits.effort_upper[v]));
    }
}

impl Model {
    /// Checks all numbers of the model, and computes its warnings again. Every function that creates a model ends with
    /// this check.
    ///
    /// # Errors
    /// Returns [`Error::Body`], [`Error::Frame`], [`Error::Joint`] or [`Error::Gravity`] if a number is invalid.
    pub(crate) fn validate(&mut self) -> Result<(), Error> {
        self.bodies.iter().try_for_each(check_body)?;
        self.frames.iter().try_for_each(check_frame)?;
        for body in self.bodies.iter().skip(1).filter(|body| body.mimic.is_none()) {
            let (q, v) = (body.idx_q..body.idx_q + body.joint.nq(), body.idx_v..body.idx_v + body.joint.nv());
            for k in 0..q.len().max(v.len()) {
                let q = (q.start + k).min(q.end - 1);
                let v = (v.start + k).min(v.end - 1);
                self.joint_options(q, v).check(&body.joint_name)?;
            }
        }
        self.find_free_armature()?;
        self.check_magnitudes()?;
        self.check_additions()?;
        let mut warnings = Vec::new();
        for (body, &between) in self.bodies.iter().zip(&self.between).skip(1) {
            check_inertia(body, between, &mut warnings);
        }
        for body in self.bodies.iter().skip(1) {
            check_limits(body, &self.limits, &mut warnings);
        }
        self.find_singular();
        warnings.extend(self.singular.iter().map(|&i| Warning::Singular { joint: self.bodies[i].joint_name.clone() }));
        // Warnings about files, and about limits of followers that are ignored, are kept, because they are not computed
        // from the model.
        let followers = self.bodies.iter().filter(|body| body.mimic.is_some());
        let followers: BTreeSet<&str> = followers.map(|body| &*body.joint_name).collect();
        let is_limit = |w: &Warning| matches!(w, Warning::Limit { joint, .. } if followers.contains(&**joint));
        warnings.extend(self.warnings.drain(..).filter(|w| w.is_about_source() || is_limit(w)));
        self.warnings = warnings;
        Ok(())
    }

    /// Returns the options of the joint whose position begins at index `q` and whose velocity begins at index `v`.
    pub(crate) fn joint_options(&self, q: usize, v: usize) -> JointOptions {
        JointOptions {
            position: Some((self.limits.lower[q], self.limits.upper[q])),
            velocity: Some(self.limits.velocity[v]),
            effort: Some((self.limits.effort_lower[v], self.limits.effort_upper[v])),
            damping: self.damping[v],
            damping_polynomial: self.damping_polynomial[v],
            friction: self.friction[v],
            armature: self.armature[v],
        }
    }

    /// Finds the joints along which M is singular at all positions.
    fn find_singular(&mut self) {
        let mut always = vec![true; self.bodies.len()];
        let mut rng = StdRng::seed_from_u64(0);
        for _ in 0..SAMPLES {
            let q = random_configuration(self, &mut rng);
            let placed = Placed::at(self, &q);
            let here =
                if self.has_mimic() { self.singular_by_matrix(&placed) } else { self.singular_by_bodies(&placed) };
            always.iter_mut().zip(here).for_each(|(always, here)| *always &= here);
        }
        self.singular = (1..self.bodies.len()).filter(|&i| always[i]).collect();
    }

    /// Finds singular joints by the pivots D = Sᵀ Iᴬ S of the articulated bodies. Iᴬ is the inertia of an articulated
    /// body, and S is the motion subspace of its joint. Degrees of freedom with pivot 0 are not eliminated.
    fn singular_by_bodies(&self, Placed { oX, S }: &Placed) -> Vec<bool> {
        let l = Single::<f64, f64>::new(self);
        let mut singular = vec![false; self.bodies.len()];
        let mut IA = vec![ArticulatedInertia::zero(); self.bodies.len()];
        for i in l.bodies().rev() {
            let mut Ia = IA[i] + oX[i].act(l.inertia(i)).into();
            for k in (0..l.joint(i).nv()).rev() {
                let S = S[l.column(i) + k];
                let U = Ia * S;
                let D = S.dot(U) + l.armature(i, k);
                let products = S.to_array().iter().zip(U.to_array()).map(|(s, u)| (s * u).abs()).sum::<f64>();
                if D <= (PIVOT_ROUNDING * products).max(LEAST_PIVOT) {
                    singular[i] = true;
                } else {
                    Ia = Ia.minus_outer(U, 1.0 / D);
                }
            }
            l.add_to_parent(&mut IA, i, Ia);
        }
        singular
    }

    /// Finds singular joints by the pivots of the inertia matrix M. This method is used for robots whose joints share
    /// coordinates.
    fn singular_by_matrix(&self, placed: &Placed) -> Vec<bool> {
        let mut M = self.inertia_matrix(placed);
        let diagonal = M.diagonal();
        let mut singular = vec![false; self.tree.nv];
        for k in (0..self.tree.nv).rev() {
            let D = M[(k, k)];
            if D <= (PIVOT_ROUNDING * diagonal[k]).max(LEAST_PIVOT) {
                singular[k] = true;
                continue;
            }
            for i in 0..k {
                let x = M[(k, i)] / D;
                for j in 0..=i {
                    M[(i, j)] -= x * M[(k, j)];
                }
            }
        }
        let owns = |b: &Body| b.mimic.is_none() && (b.idx_v..b.idx_v + b.joint.nv()).any(|k| singular[k]);
        self.bodies.iter().enumerate().map(|(i, b)| i > 0 && owns(b)).collect()
    }
}

/// Poses of the bodies, and columns of the joints' motion subspaces S in the world's frame, at one position.
struct Placed {
    /// Poses oXi of the bodies, by index of the body.
    oX: Vec<Se3<f64>>,
    /// Columns of S, by index of the column.
    S: Vec<Motion<f64>>,
}

impl Placed {
    fn at(model: &Model, q: &[f64]) -> Self {
        let l = Single::<f64, f64>::new(model);
        let (mut oX, mut S) = (vec![Se3::identity(); model.bodies.len()], Vec::with_capacity(model.tree.columns.len()));
        for i in l.bodies() {
            oX[i] = l.parent(&oX, i) * Joint::placement(&l, i, q); // oXi = oXλ λXi
            S.extend((0..l.joint(i).nv()).map(|k| l.joint(i).column(&oX[i], k)));
        }
        Self { oX, S }
    }
}

impl Model {
    /// Finds the free joints that have armature along their linear coordinates. This armature is a mass along the axes
    /// of the parent, so its three numbers must be equal.
    fn find_free_armature(&mut self) -> Result<(), Error> {
        self.free_armature.clear();
        for body in self.bodies[1..].iter().filter(|body| body.joint == Joint::FreeFlyer) {
            let [x, y, z] = [0, 1, 2].map(|k| self.armature[body.idx_v + k]);
            if x != y || y != z {
                let what = format!(
                    "armature is {x}, {y} and {z} along its linear coordinates, expected three equal numbers: \
                     the armature of a free joint is a mass in the axes of its parent"
                );
                return Err(Error::Joint { joint: body.joint_name.clone(), what });
            }
            if x > 0.0 {
                self.free_armature.push(body.idx_v);
            }
        }
        Ok(())
    }

    /// Computes the inertia matrix M in the world's frame by the method of composite rigid bodies. Source: Featherstone
    /// (2008), table 6.2.
    fn inertia_matrix(&self, Placed { oX, S }: &Placed) -> DMatrix<f64> {
        let l = Single::<f64, f64>::new(self);
        let mut M = DMatrix::zeros(self.tree.nv, self.tree.nv);
        let mut IC: Vec<_> = oX.iter().zip(&self.tree.nodes).map(|(X, node)| X.act(node.inertia)).collect();
        for i in l.bodies().rev() {
            let support = l.support(i);
            let before = support.len() - l.joint(i).nv();
            for own in before..support.len() {
                let F = IC[i] * l.at(S, support[own]); // F = Iᶜ S
                for &e in &support[..own] {
                    let x = l.at(S, e).dot(F); // M_ej = S_eᵀ F for every ancestor e
                    l.add_entry(M.as_mut_slice(), support[own], e, x);
                    l.add_entry(M.as_mut_slice(), e, support[own], x);
                }
                l.add_entry(M.as_mut_slice(), support[own], support[own], l.at(S, support[own]).dot(F));
            }
            let IC_i = IC[i];
            l.add_to_parent(&mut IC, i, IC_i); // Iᶜ_λ += Iᶜ_i
        }
        l.add_armature(M.as_mut_slice());
        M
    }
}

impl<R> Model<R> {
    /// Returns warnings about unusual properties of the robot.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Returns the bodies whose joints make the inertia matrix M singular, because nothing that they carry has inertia
    /// along these joints. Forward dynamics and M⁻¹ refuse such a robot; an armature on these joints solves the
    /// problem.
    pub fn singular_joints(&self) -> &[usize] {
        &self.singular
    }

    /// Panics with the name of a joint if the inertia matrix M has no inverse.
    #[doc(hidden)]
    #[inline]
    #[track_caller]
    pub fn check_regular(&self) {
        if let Some(&i) = self.singular.first() {
            singular(&self.bodies[i].joint_name);
        }
    }
}

/// Panics with the message of [`Model::check_regular`].
#[cold]
#[inline(never)]
#[track_caller]
fn singular(joint: &str) -> ! {
    panic!("{}", Warning::Singular { joint: joint.to_owned() });
}
