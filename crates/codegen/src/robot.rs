//! Functions of a robot, recorded from the algorithms of the library.

use crate::error::Error;
use crate::expression::Expression;
use crate::forms::{aba, aba_derivatives, crba, minv};
use crate::function::{Function, Recorder, record};
use crate::identifiers::identifiers;
use crate::partitions::limbs_of_results;
use condyle_dynamics::{
    ConstraintSet, ContactConstraint, Data, ReferenceFrame, aba_hessian, centroidal_map_rate, constrained_dynamics,
    constrained_dynamics_derivatives, forward_kinematics, forward_velocities, gravity, impulse_dynamics,
    impulse_dynamics_derivatives, neutral, nonlinear_effects, rnea, rnea_derivatives, rnea_hessian,
};
use condyle_model::inertial_parameters::to_inertia;
use condyle_model::{Model, Vec3};
use condyle_spatial::{Force, Inertia, Matrix, Scalar};
use core::num::NonZero;
use nalgebra::DMatrix;

/// Names of all functions that [`functions`] can record.
pub const FUNCTIONS: [&str; 16] = [
    "rnea",
    "aba",
    "crba",
    "minv",
    "gravity",
    "nonlinear_effects",
    "rnea_derivatives",
    "aba_derivatives",
    "rnea_hessian",
    "aba_hessian",
    "frames",
    "centroidal",
    "constrained_dynamics",
    "constrained_dynamics_derivatives",
    "impulse_dynamics",
    "impulse_dynamics_derivatives",
];

/// Names of the functions that need the inverse of the joint-space inertia matrix M.
const INVERTING: [&str; 8] = [
    "aba",
    "minv",
    "aba_derivatives",
    "aba_hessian",
    "constrained_dynamics",
    "constrained_dynamics_derivatives",
    "impulse_dynamics",
    "impulse_dynamics_derivatives",
];

/// Settings for the functions of a robot.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// Frames of the function `frames`, by name.
    pub frames: Vec<String>,
    /// Constraints of `constrained_dynamics` and `impulse_dynamics`, and of their derivatives.
    pub constraints: Vec<ContactConstraint>,
    /// Whether dynamics and its derivatives have an argument `f_ext` for external forces on the bodies: six numbers for
    /// each body except the world.
    pub external_forces: bool,
    /// Whether the inertial parameters of the bodies are an argument `inertia` instead of constants: ten numbers for
    /// each body except the world, as in [`inertial_parameters`](condyle_model::inertial_parameters).
    pub inertia_is_input: bool,
    /// Whether the armature of the coordinates is an argument `armature` instead of constants.
    pub armature_is_input: bool,
    /// Whether the gravitational acceleration is an argument `gravity_vector` of three numbers instead of a constant.
    pub gravity_is_input: bool,
    /// Number of threads of a CUDA kernel that compute one state together: at most one for each limb and one for the
    /// trunk. The part of the function that one of these threads computes is a partition. By default, only functions
    /// that gain from partitions have partitions ([`Function::partitions`]). A launch uses the partitions only for few
    /// states. Other languages ignore this setting.
    pub partitions: Option<NonZero<usize>>,
}

/// Records functions of a robot, given by names in [`FUNCTIONS`]. Arguments and results are the same as in the
/// library's functions.
///
/// ```
/// use condyle_codegen::{Settings, functions};
/// use condyle_dynamics::robots;
/// let arm = robots::arm7();
/// let [aba] = &functions(&arm, &["aba"], &Settings::default())?[..] else { unreachable!() };
/// assert_eq!(aba.inputs.iter().map(|a| &*a.name).collect::<Vec<_>>(), ["q", "v", "tau"]);
/// # Ok::<(), condyle_codegen::Error>(())
/// ```
///
/// # Errors
/// [`Error::Function`] for an unknown name; [`Error::Twice`] for a name that occurs twice. [`Error::Missing`] if a
/// function needs frames or constraints and none are given; [`Error::Singular`] if M is singular and a function needs
/// its inverse. [`Error::Model`] for frames and constraints that the robot does not have.
///
/// # Panics
/// If a recording is in progress on this thread.
pub fn functions(model: &Model, names: &[&str], settings: &Settings) -> Result<Vec<Function>, Error> {
    if let Some((_, name)) = names.iter().enumerate().find(|(i, name)| names[..*i].contains(name)) {
        return Err(Error::Twice { name: (*name).to_owned() });
    }
    names.iter().map(|name| function(model, name, settings)).collect()
}

fn function(model: &Model, name: &str, settings: &Settings) -> Result<Function, Error> {
    let unknown = || Error::Function { name: name.to_owned() };
    let name = FUNCTIONS.into_iter().find(|&known| known == name).ok_or_else(unknown)?;
    if let (true, Some(&i)) = (INVERTING.contains(&name), model.singular_joints().first()) {
        return Err(Error::Singular { name, joint: model.bodies()[i].joint_name.clone() });
    }
    let frames: Vec<usize> = settings.frames.iter().map(|name| model.frame(name)).collect::<Result<_, _>>()?;
    let is_constrained = name.starts_with("constrained_dynamics") || name.starts_with("impulse_dynamics");
    ConstraintSet::<Expression>::check_all(model, &settings.constraints)?;
    if is_constrained && settings.constraints.is_empty() {
        return Err(Error::Missing { name, needs: "constraints" });
    }
    if name == "frames" && frames.is_empty() {
        return Err(Error::Missing { name, needs: "frames" });
    }
    let mut result = Ok(());
    let function = record(name, &about(name, model), |r| {
        result = Robot::new(model, settings, r).and_then(|mut robot| {
            match name {
                _ if is_constrained => return robot.constrained(r, name),
                "frames" => robot.frames(r, &frames),
                // Keep the world's frame here: in second derivatives of accelerations, the inverse inertia matrix M⁻¹
                // would amplify the rounding errors of another frame beyond the tolerance of the tests.
                "centroidal" | "aba_hessian" => robot.unconstrained(r, name),
                _ => {
                    robot.in_frame_of_first_body()?;
                    robot.unconstrained(r, name);
                }
            }
            Ok(())
        });
    });
    result?;
    Ok(Function { limbs: limbs_of_results(model, &function), partitions: settings.partitions, ..function })
}

/// Returns the description of a function, with the robot's name.
fn about(name: &str, model: &Model) -> String {
    let what = match name {
        "rnea" => "Inverse dynamics, tau = M(q) a + h(q, v)",
        "aba" => "Forward dynamics, a = M(q)^-1 (tau - h(q, v))",
        "crba" => "The joint-space inertia matrix M(q), armature included",
        "minv" => "The inverse of the joint-space inertia matrix, M(q)^-1",
        "gravity" => "The efforts that hold the robot still, g(q)",
        "nonlinear_effects" => "The efforts that keep the velocity as it is, h(q, v) = C(q, v) v + g(q)",
        "rnea_derivatives" => "The derivatives of inverse dynamics, tau = M(q) a + h(q, v)",
        "aba_derivatives" => "Forward dynamics, a = M(q)^-1 (tau - h(q, v)), and its derivatives",
        "rnea_hessian" => "The second derivatives of lambda^T tau, tau = M(q) a + h(q, v)",
        "aba_hessian" => "The second derivatives of lambda^T a, a = M(q)^-1 (tau - h(q, v))",
        "frames" => "Frames of the robot: poses, velocities, Jacobians and their rates, the axes those of the world",
        "centroidal" => "The centre of mass and the momentum about it, hg = Ag(q) v, the axes those of the world",
        "constrained_dynamics" => "Forward dynamics under constraints, J a + gamma = 0",
        "constrained_dynamics_derivatives" => {
            "Forward dynamics under constraints, J a + gamma = 0, and its derivatives"
        }
        "impulse_dynamics" => {
            "The velocity after an impact on the constraints, M (v_after - v) = J^T lambda, J v_after = -restitution J v"
        }
        _ => "The velocity after an impact on the constraints, J v_after = -restitution J v, and its derivatives",
    };
    let (nq, nv) = (model.nq(), model.nv());
    format!("{what}. Of the robot `{}`, nq = {nq}, nv = {nv}.", model.name().replace("*/", "* /").replace('\n', " "))
}

/// Adds the second derivatives of a weighted sum as results. Derivatives taken twice with respect to the last argument
/// are 0, and are left out.
fn hessian(r: &mut Recorder, [qq, vq, vv, xq]: [&Matrix<Expression>; 4], last: &str) {
    r.matrix("dqdq", qq, "derivative by q twice, symmetric");
    r.matrix("dvdq", vq, "derivative by v (rows) and q (columns)");
    r.matrix("dvdv", vv, "derivative by v twice, symmetric");
    r.matrix(&format!("d{last}dq"), xq, &format!("derivative by {last} (rows) and q (columns)"));
}

/// Robot whose constants are expressions, and the inputs that all functions of the robot have.
struct Robot<'s> {
    model: Model<Expression>,
    data: Data<Expression>,
    settings: &'s Settings,
    q: Vec<Expression>,
}

impl<'s> Robot<'s> {
    fn new(model: &Model, settings: &'s Settings, r: &mut Recorder) -> Result<Self, Error> {
        let bodies = model.bodies().len();
        let q = r.input("q", model.nq(), "position");
        let mut inertias = Vec::new();
        if settings.inertia_is_input {
            let about = "m, m c (3), Ixx, Ixy, Iyy, Ixz, Iyz, Izz of each body, about the origin of its frame";
            inertias = r.input("inertia", 10 * (bodies - 1), about);
        }
        let given = |i: usize| inertias.as_chunks::<10>().0.get(i.wrapping_sub(1)).map(|&pi| to_inertia(pi));
        let lifted = |I: Inertia<f64>| -> Inertia<Expression> { I.lift() };
        let mut model = model.clone().without_residues().with_inertias(|i, I| given(i).unwrap_or_else(|| lifted(I)))?;
        if settings.armature_is_input {
            let about = "inertia of the rotors, added to the diagonal of M; the same along x, y and z of a free joint";
            let armature = r.input("armature", model.nv(), about);
            model = model.with_scalar_armature(&armature);
        }
        if settings.gravity_is_input {
            let g = r.input("gravity_vector", 3, "acceleration of free fall in the world's frame");
            model = model.with_gravity(Vec3::new(g[0], g[1], g[2]))?;
        }
        Ok(Self { data: Data::new(&model), model, settings, q })
    }

    /// Computes the dynamics in a frame that moves with the first joint: replaces the position of this joint by the
    /// neutral position, and rotates gravity accordingly. The joint dynamics are the same in this frame. Except for the
    /// rotation of gravity, no result depends on the position of the first joint.
    ///
    /// The function changes nothing if the world carries several bodies, or if another joint follows the first one.
    fn in_frame_of_first_body(&mut self) -> Result<(), Error> {
        let Self { model, data, q, .. } = self;
        let [_, first, others @ ..] = model.nodes() else { return Ok(()) };
        if others.iter().any(|node| node.parent == 0 || node.idx_v == first.idx_v) {
            return Ok(());
        }
        let neutral: Vec<Expression> = neutral(model).into_iter().map(Expression::splat).collect();
        let oR = forward_kinematics(model, data, q).body(1).rotation;
        q[first.idx_q..][..first.joint.nq()].copy_from_slice(&neutral[first.idx_q..][..first.joint.nq()]);
        let aR = forward_kinematics(model, data, q).body(1).rotation;
        let gravity = aR * oR.transpose_mul(*model.gravity()); // aR₁ oR₁ᵀ g
        self.model = self.model.clone().with_gravity(gravity)?;
        Ok(())
    }

    fn input(&self, r: &mut Recorder, name: &str, about: &str) -> Vec<Expression> {
        r.input(name, self.model.nv(), about)
    }

    fn velocity(&self, r: &mut Recorder) -> Vec<Expression> {
        self.input(r, "v", "velocity")
    }

    /// Returns the external forces on the bodies. The list is empty if external forces are not an argument.
    fn forces(&self, r: &mut Recorder) -> Vec<Force<Expression>> {
        if !self.settings.external_forces {
            return Vec::new();
        }
        let bodies = self.model.bodies().len();
        let f = r.input("f_ext", 6 * (bodies - 1), "force and moment on each body, at its origin, in its frame");
        let given = f.as_chunks::<6>().0.iter().map(|&f| Force::from(f));
        core::iter::once(Force::zero()).chain(given).collect()
    }

    /// Records a function that needs neither frames nor constraints.
    fn unconstrained(&mut self, r: &mut Recorder, name: &str) {
        match name {
            "crba" => return r.matrix("M", &crba(&self.model, &self.q), "inertia matrix"),
            "minv" => {
                return r.matrix("Minv", &minv(&self.model, &mut self.data, &self.q), "inverse of the inertia matrix");
            }
            "gravity" => return r.output("g", gravity(&self.model, &mut self.data, &self.q), "efforts"),
            _ => {}
        }
        let v = self.velocity(r);
        match name {
            "nonlinear_effects" => {
                r.output("h", nonlinear_effects(&self.model, &mut self.data, &self.q, &v), "efforts");
            }
            "centroidal" => self.centroidal(r, &v),
            "rnea" | "rnea_derivatives" | "rnea_hessian" => {
                let a = self.input(r, "a", "acceleration");
                let f_ext = self.forces(r);
                if name == "rnea_hessian" {
                    let lambda = self.input(r, "lambda", "weights of the efforts");
                    let H = rnea_hessian(&self.model, &mut self.data, &self.q, &v, &a, &f_ext, &lambda);
                    return hessian(r, [H.dqdq, H.dvdq, H.dvdv, H.dadq], "a");
                }
                let Self { model, data, q, .. } = self;
                if name == "rnea" {
                    return r.output("tau", rnea(model, data, q, &v, &a, &f_ext), "efforts");
                }
                let d = rnea_derivatives(model, data, q, &v, &a, &f_ext);
                r.matrix("dtau_dq", d.dtau_dq, "derivative by q");
                r.matrix("dtau_dv", d.dtau_dv, "derivative by v");
                r.matrix("dtau_da", d.dtau_da, "derivative by a, the inertia matrix");
            }
            _ => {
                let tau = self.input(r, "tau", "efforts");
                let f_ext = self.forces(r);
                if name == "aba_hessian" {
                    let lambda = self.input(r, "lambda", "weights of the accelerations");
                    let H = aba_hessian(&self.model, &mut self.data, &self.q, &v, &tau, &f_ext, &lambda);
                    return hessian(r, [H.dqdq, H.dvdq, H.dvdv, H.dtaudq], "tau");
                }
                let Self { model, data, q, .. } = self;
                if name == "aba" {
                    return r.output("a", &aba(model, data, q, &v, &tau, &f_ext), "acceleration");
                }
                let d = aba_derivatives(model, data, q, &v, &tau, &f_ext);
                r.output("a", &d.a, "acceleration");
                r.matrix("da_dq", &d.da_dq, "derivative by q");
                r.matrix("da_dv", &d.da_dv, "derivative by v");
                r.matrix("da_dtau", &d.da_dtau, "derivative by tau, the inverse of the inertia matrix");
            }
        }
    }

    fn centroidal(&mut self, r: &mut Recorder, v: &[Expression]) {
        let map = centroidal_map_rate(&self.model, &mut self.data, &self.q, v);
        r.output("com", &map.com.to_array(), "centre of mass");
        r.output("com_velocity", &map.com_velocity.to_array(), "its velocity");
        r.output("hg", &map.hg.to_array(), "momentum about it, linear first");
        r.matrix("Jcom", map.Jcom, "Jacobian of the centre of mass");
        r.matrix("Ag", map.Ag, "centroidal momentum matrix");
        r.matrix("dAg", map.dAg, "its rate");
    }

    fn frames(&mut self, r: &mut Recorder, frames: &[usize]) {
        let v = self.velocity(r);
        let kinematics = forward_velocities(&self.model, &mut self.data, &self.q, &v);
        let names = identifiers(frames.iter().map(|&frame| &*self.model.frames()[frame].name));
        let (axes, nv) = (ReferenceFrame::LocalWorldAligned, self.model.nv());
        for (name, &frame) in names.iter().zip(frames) {
            let (oXf, velocity) = (kinematics.frame(frame), kinematics.frame_velocity(frame, axes));
            let rotation: Vec<Expression> = oXf.rotation.columns().into_iter().flat_map(Vec3::to_array).collect();
            let [mut J, mut dJ] = [(); 2].map(|()| DMatrix::from_element(6, nv, Expression::zero()));
            kinematics.frame_jacobian(frame, axes, &mut J);
            kinematics.frame_jacobian_rate(frame, axes, &mut dJ);
            r.matrix(&format!("{name}_rotation"), &DMatrix::from_vec(3, 3, rotation), "rotation to the world's axes");
            r.output(&format!("{name}_translation"), &oXf.translation.to_array(), "origin in the world");
            r.output(&format!("{name}_velocity"), &velocity.to_array(), "velocity, of the origin first, then angular");
            r.matrix(&format!("{name}_J"), &J, "Jacobian");
            r.matrix(&format!("{name}_dJ"), &dJ, "its rate");
        }
    }

    fn constrained(&mut self, r: &mut Recorder, name: &str) -> Result<(), Error> {
        let mut set = ConstraintSet::new(&self.model, &self.settings.constraints)?;
        let v = self.velocity(r);
        if name.starts_with("impulse_dynamics") {
            let restitution = r.input("restitution", 1, "0 (the constraints hold) to 1 (nothing is lost)")[0];
            let Self { model, data, q, .. } = self;
            let impulse = |r: &mut Recorder, v: &[Expression], lambda: &[Expression]| {
                r.output("v_after", v, "velocity after the impact");
                r.output("lambda", lambda, "impulses of the constraints");
            };
            if name == "impulse_dynamics" {
                let after = impulse_dynamics(model, data, &mut set, q, &v, restitution);
                impulse(r, after.v, after.lambda);
                return Ok(());
            }
            let d = impulse_dynamics_derivatives(model, data, &mut set, q, &v, restitution);
            impulse(r, d.v, d.lambda);
            r.matrix("dv_dq", d.dv_dq, "derivative of v_after by q");
            r.matrix("dv_dv", d.dv_dv, "derivative of v_after by v");
            r.matrix("dlambda_dq", d.dlambda_dq, "derivative of lambda by q");
            r.matrix("dlambda_dv", d.dlambda_dv, "derivative of lambda by v");
            return Ok(());
        }
        let tau = self.input(r, "tau", "efforts");
        let f_ext = self.forces(r);
        let Self { model, data, q, .. } = self;
        if name == "constrained_dynamics" {
            let d = constrained_dynamics(model, data, &mut set, q, &v, &tau, &f_ext);
            r.output("a", d.a, "acceleration");
            r.output("lambda", d.lambda, "forces of the constraints");
            return Ok(());
        }
        let d = constrained_dynamics_derivatives(model, data, &mut set, q, &v, &tau, &f_ext);
        r.output("a", d.a, "acceleration");
        r.output("lambda", d.lambda, "forces of the constraints");
        r.matrix("da_dq", d.da_dq, "derivative of a by q");
        r.matrix("da_dv", d.da_dv, "derivative of a by v");
        r.matrix("da_dtau", d.da_dtau, "derivative of a by tau");
        r.matrix("dlambda_dq", d.dlambda_dq, "derivative of lambda by q");
        r.matrix("dlambda_dv", d.dlambda_dv, "derivative of lambda by v");
        r.matrix("dlambda_dtau", d.dlambda_dtau, "derivative of lambda by tau");
        Ok(())
    }
}
